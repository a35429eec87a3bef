"""What waits at a radio while it is off, and when that goes on air."""

from dataclasses import replace

import numpy as np
import pytest

from swarmwire.comms.air.disruption import ALL, DROP, NEWEST, Disruption
from swarmwire.comms.air.radio import Radio
from swarmwire.comms.fates import Fate
from swarmwire.comms.packets import Sent
from tests.support.comms.air.runs import Run, at, make_air, packets
from tests.unit.comms.air.test_disruption import ran

PAIR = at((0, 0), (1, 0))
# Ten bytes take 80 ms.
SLOW = Radio(2.0, bit_rate_bps=1000, send_offset="tick", queue_limit=4)


def off(backlog: int, *rows: int) -> Disruption:
    now = Disruption.none(2)
    now.radio_on[list(rows)] = False
    now.backlog[:] = backlog
    return now


def one_each(first: int, stop: int, count: int = 1) -> dict[int, Sent]:
    return {tick: packets([0] * count) for tick in range(first, stop)}


def blacked_out(backlog: int, sent: dict[int, Sent], radio: Radio = SLOW, ticks: int = 15) -> Run:
    """The sender's radio is off from 0.2 to 0.8 s."""
    return ran(make_air(radio, 2), PAIR, sent, {2: off(backlog, 0), 8: Disruption.none(2)}, ticks)


def on_air_ms(told: Run) -> list[int]:
    return (told.on_air("on_air_at_ns") // 1_000_000).tolist()


def test_nothing_waits_by_default():
    told = blacked_out(DROP, one_each(0, 9))
    assert told.fates() == {"HEARD": 3, "BLACKOUT": 6}
    assert on_air_ms(told) == [0, 100, 800]


def test_all_wait_up_to_the_limit_and_go_out_one_after_the_other():
    """Handed over at 0.2 to 0.8 s: four wait, two find the queue full, and the one at 0.8 s goes last."""
    told = blacked_out(ALL, one_each(0, 9))
    assert told.fates() == {"HEARD": 7, "QUEUE_FULL": 2}
    assert on_air_ms(told) == [0, 100, 800, 880, 960, 1040, 1120]
    assert told.heard("sequence").tolist() == [0, 1, 2, 3, 4, 5, 8]
    refused = told.finished("receiver") < 0
    assert (told.finished("sent_at_ns")[refused] // 10**8).tolist() == [6, 7]


@pytest.mark.parametrize("limit", [0, 1, 4])
def test_the_newest_waits_whatever_the_limit(limit: int):
    told = blacked_out(NEWEST, one_each(0, 8), replace(SLOW, queue_limit=limit))
    assert told.fates() == {"HEARD": 3, "BLACKOUT": 5}
    assert on_air_ms(told) == [0, 100, 800]
    assert told.heard("sequence").tolist() == [0, 1, 7]
    told = blacked_out(NEWEST, {2: packets([0] * 3)}, replace(SLOW, queue_limit=limit))
    assert told.heard("sequence").tolist() == [2]
    assert told.fates() == {"HEARD": 1, "BLACKOUT": 2}


def test_what_waited_already_waits_on_and_what_is_on_air_ends_in_peace():
    """Four packets at 0.1 s begin at 100, 180, 260 and 340 ms: that of 180 ms is on air when the radio goes off."""
    told = blacked_out(ALL, {1: packets([0] * 4)})
    assert on_air_ms(told) == [100, 180, 800, 880]
    assert told.fates() == {"HEARD": 4}


def test_a_frame_longer_than_the_blackout_is_not_interrupted_by_what_waited():
    long_ = replace(SLOW, max_payload_bytes=200)
    sent = {1: packets([0, 0], size=[100, 10])}
    now = {2: off(ALL, 0), 3: Disruption.none(2)}
    told = ran(make_air(long_, 2), PAIR, sent, now, 15)
    assert on_air_ms(told) == [100, 900]


def test_a_packet_too_large_does_not_wait():
    told = blacked_out(ALL, {3: packets([0, 0], size=[101, 10])})
    assert told.fates() == {"HEARD": 1, "TOO_LARGE": 1}
    assert told.news[4].tally.fates.sum() == 1


def test_the_backlog_of_a_robot_that_dies_dies_with_it_and_the_next_starts_afresh():
    dead = off(ALL, 0)
    dead.alive[0] = False
    now = {2: off(ALL, 0), 4: dead, 6: off(ALL, 0), 8: Disruption.none(2)}
    told = ran(make_air(SLOW, 2), PAIR, {2: packets([0] * 3), 7: packets([0])}, now, 12)
    assert told.fates() == {"HEARD": 1, "SENDER_DEAD": 3}
    assert on_air_ms(told) == [800]


def test_what_still_waits_at_the_end_is_in_flight():
    told = ran(make_air(SLOW, 2), PAIR, {3: packets([0] * 3)}, {2: off(ALL, 0)}, 6)
    assert told.fates() == {"IN_FLIGHT": 3}


def test_a_backlog_that_gets_stricter_is_cut_at_once():
    sent = {3: packets([0] * 3)}
    told = ran(make_air(SLOW, 2), PAIR, sent, {2: off(ALL, 0), 5: off(NEWEST, 0), 8: Disruption.none(2)}, 12)
    assert told.fates() == {"HEARD": 1, "BLACKOUT": 2}
    told = ran(make_air(SLOW, 2), PAIR, sent, {2: off(ALL, 0), 5: off(DROP, 0), 8: Disruption.none(2)}, 12)
    assert told.fates() == {"BLACKOUT": 3}


def test_a_backlog_keeps_to_its_own_radio():
    """Robot 1 goes on as if nothing were, and its queue does not count for the other's."""
    both = {tick: packets([0, 1, 1]) for tick in range(2, 6)}
    told = blacked_out(ALL, both)
    sender, on_air = told.on_air("sender"), np.array(on_air_ms(told))
    assert on_air[sender == 0].tolist() == [800, 880, 960, 1040]
    assert on_air[sender == 1].tolist() == [200, 280, 360, 440, 520, 600, 680, 760]
    assert told.fates() == {"HEARD": 4, "BLACKOUT": 8}


def test_a_radio_keeps_back_only_its_own_packets_and_only_those_that_it_took():
    """Handed over at 0.35 s: the radio of robot 1 is off by then, and of its two packets the first is too large."""
    later = replace(SLOW, send_offset=0.25)
    sent, now = {1: packets([0, 0, 1, 1], size=[10, 10, 101, 10])}, {2: off(ALL, 1), 8: Disruption.none(2)}
    told = ran(make_air(later, 2), PAIR, sent, now, 12)
    assert told.fates() == {"HEARD": 1, "BLACKOUT": 2, "TOO_LARGE": 1}
    assert on_air_ms(told) == [350, 430, 800]
    assert [one.tally.fates[0, Fate.TOO_LARGE] for one in told.news].index(1) == 4


def test_the_first_that_waited_goes_on_air_when_the_one_before_it_has_ended():
    """As above, but the radio is on again at 300 ms: the second frame has ended at 260."""
    told = ran(make_air(SLOW, 2), PAIR, {1: packets([0] * 4)}, {2: off(ALL, 0), 3: Disruption.none(2)}, 15)
    assert on_air_ms(told) == [100, 180, 300, 380]


def test_each_radio_lets_go_its_own_packets():
    """Both are off from 0.2 s on, that of robot 1 until 0.5 s, that of robot 0 until 0.8 s."""
    now = {2: off(ALL, 0, 1), 5: off(ALL, 0), 8: Disruption.none(2)}
    told = ran(make_air(SLOW, 2), PAIR, {3: packets([0, 0, 1, 1])}, now, 15)
    sender, on_air = told.on_air("sender"), np.array(on_air_ms(told))
    assert on_air[sender == 1].tolist() == [500, 580]
    assert on_air[sender == 0].tolist() == [800, 880]
