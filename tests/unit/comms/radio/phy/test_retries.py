"""Medium access: what happens between attempts."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from swarmwire.comms.packets import Fate, SentPackets, TxResult
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.disruption import NEWEST, Disruption
from tests.support.comms.radio.phy.radios import with_access
from tests.support.comms.radio.runs import TICK_NS, Run, at, make_medium, packets

# A frame of 117 bytes lasts 78 ms: attempts and ticks overlap.
SLOW = replace(with_access("csma-802154"), bit_rate_bps=12_000, send_offset="tick")
Plan = Callable[[int], dict[str, list[float]]]


def told(radio: Radio, plan: Plan, *, sends: int = 1, metres: float = 1.0, ticks: int = 12) -> Run:
    """Robot 0 sends to robot 1 in the first ticks, while disruptions go by plan(tick)."""
    medium = make_medium(radio, 2)
    out = Run(medium)
    for tick in range(ticks):
        now = Disruption.none(2)
        for name, value in plan(tick).items():
            setattr(now, name, np.array(value, getattr(now, name).dtype))
        out.news.append(medium.step(tick * TICK_NS, at((0, 0), (metres, 0)), now))
        if tick < sends:
            one = packets([0], 1, 100)
            medium.send(tick * TICK_NS, tick, SentPackets(one.sender, one.to, one.payloads, np.array([tick])))
    out.last = medium.end()
    return out


def departures(out: Run) -> list[tuple[int, int]]:
    """Sequence and fate of each packet that left its radio."""
    return [(int(s), int(f)) for one in out.news for s, f in zip(one.departed.sequence, one.departed.fate, strict=True)]


def results(out: Run) -> list[tuple[int, int]]:
    """Id and result of each transmit status."""
    return [(int(i), int(r)) for one in out.news for i, r in zip(one.tx_status.id, one.tx_status.result, strict=True)]


@pytest.mark.parametrize("end", ["alive", "radio_on"])
def test_a_packet_that_was_received_is_not_refused_as_well_when_its_sender_ends(end: str):
    """Robot 0 is deaf to the acknowledgement, tries again, and dies, or its radio goes off."""
    out = told(SLOW, lambda tick: {"receive_gain_db": [-200.0, 0.0], end: [tick < 2, True]})
    assert out.fates() == {"RECEIVED": 1}
    assert departures(out) == [(0, int(Fate.RECEIVED))]
    assert out.tally.in_range.tolist() == [1]


def test_a_packet_that_was_lost_on_air_is_lost_though_its_sender_dies_before_the_next_attempt():
    out = told(replace(SLOW, loss=1.0), lambda tick: {"alive": [tick < 2, True]})
    assert out.fates() == {"LOST": 1}


def test_a_packet_that_was_on_air_out_of_reach_stays_so_when_the_radio_goes_off():
    out = told(SLOW, lambda tick: {"radio_on": [tick < 2, True]}, metres=5000.0)
    assert out.fates() == {"OUT_OF_RANGE": 1}
    assert departures(out) == [(0, int(Fate.RECEIVED))]


def test_at_low_bit_rates_the_sender_waits_as_long_as_an_acknowledgement_takes():
    out = told(SLOW, lambda _: {})
    assert results(out) == [(0, TxResult.ACKNOWLEDGED)]


def test_a_robot_that_was_revived_is_not_told_of_a_packet_from_before():
    """A frame of 234 ms; the robot is dead in one tick of it."""
    out = told(replace(SLOW, bit_rate_bps=4_000), lambda tick: {"alive": [tick != 1, True]})
    assert out.fates() == {"RECEIVED": 1}
    assert results(out) == []


def test_newest_only_keeps_one_packet_also_if_an_attempt_fails_meanwhile():
    backlog = {"backlog": [NEWEST, NEWEST]}
    out = told(replace(SLOW, loss=1.0), lambda tick: {**backlog, "radio_on": [not 1 <= tick <= 3, True]}, sends=2)
    assert [sequence for sequence, _ in departures(out)] == [0, 1]
    assert out.fates() == {"LOST": 2}
    first, second = (next(k for k, one in enumerate(out.news) if s in one.departed.sequence) for s in (0, 1))
    assert first <= 3 < second


def test_a_broadcast_that_nobody_could_hear_departs_all_the_same():
    medium = make_medium(with_access("csma-802154"), 1)
    medium.step(0, at((0, 0)))
    medium.send(0, 0, packets([0], -1, 10))
    news = medium.step(TICK_NS, at((0, 0)))
    assert news.departed.sequence.tolist() == [0]
