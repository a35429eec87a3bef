"""A sender's radio sends one packet after the other, keeps what waits while it is off, and refuses the rest."""

from dataclasses import replace

import numpy as np
import pytest

from swarmwire.comms.radio.config.phy import Access
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.disruption import ALL, DROP, NEWEST, Disruption
from swarmwire.comms.robot.packets import Fate, SentPackets
from tests.support.comms.radio import Run, at, living, make_medium, packets, run, run_disrupted, with_access

PAIR = at((0, 0), (1, 0))
# Ten bytes take 80 ms.
SLOWEST = Radio(2.0, bit_rate_bps=1000, send_offset="tick", queue_limit=4)


def off(backlog: int, *rows: int) -> Disruption:
    now = Disruption.none(2)
    now.radio_on[list(rows)] = False
    now.backlog[:] = backlog
    return now


def one_each(first: int, stop: int, count: int = 1) -> dict[int, SentPackets]:
    return {tick: packets([0] * count) for tick in range(first, stop)}


def blacked_out(backlog: int, sent: dict[int, SentPackets], radio: Radio = SLOWEST, ticks: int = 15) -> Run:
    """The sender's radio is off from 0.2 to 0.8 s."""
    return run_disrupted(make_medium(radio, 2), PAIR, sent, {2: off(backlog, 0), 8: Disruption.none(2)}, ticks)


def on_air_ms(result: Run) -> list[int]:
    return (result.on_air("on_air_at_ns") // 1_000_000).tolist()


DEAD = replace(living([False, True]), radio_on=np.array([False, True]), backlog=np.full(2, ALL))
ON = Disruption.none(2)


@pytest.mark.parametrize(
    ("now", "sent", "fates", "on_air"),
    [
        ({2: off(DROP, 0), 8: ON}, one_each(0, 9), {"RECEIVED": 3, "BLACKOUT": 6}, [0, 100, 800]),
        # Four packets at 0.1 s begin at 100, 180, 260 and 340 ms: that of 180 ms is on air when the radio goes off.
        ({2: off(ALL, 0), 8: ON}, one_each(1, 2, 4), {"RECEIVED": 4}, [100, 180, 800, 880]),
        ({2: off(ALL, 0), 3: ON}, one_each(1, 2, 4), {"RECEIVED": 4}, [100, 180, 300, 380]),
        ({2: off(ALL, 0), 3: ON}, {1: packets([0, 0], size=[100, 10])}, {"RECEIVED": 2}, [100, 900]),  # a long frame
        ({2: off(ALL, 0), 4: DEAD, 6: off(ALL, 0), 8: ON}, one_each(2, 3, 3) | one_each(7, 8),
         {"RECEIVED": 1, "SENDER_DEAD": 3}, [800]),
        ({2: off(ALL, 0)}, one_each(3, 4, 3), {"IN_FLIGHT": 3}, []),
        ({2: off(ALL, 0), 5: off(NEWEST, 0), 8: ON}, one_each(3, 4, 3), {"RECEIVED": 1, "BLACKOUT": 2}, [800]),
        ({2: off(ALL, 0), 5: off(DROP, 0), 8: ON}, one_each(3, 4, 3), {"BLACKOUT": 3}, []),
        ({2: off(ALL, 0), 8: ON}, {3: packets([0, 0], size=[201, 10])}, {"RECEIVED": 1, "TOO_LARGE": 1}, [800]),
    ],
    ids=["drop", "frame on air", "short", "long frame", "dead", "the end", "newest later", "drop later", "too large"],
)  # fmt: skip
def test_backlog_waits_while_the_radio_is_off(now, sent, fates: dict[str, int], on_air: list[int]):
    result = run_disrupted(make_medium(replace(SLOWEST, max_payload_bytes=200), 2), PAIR, sent, now, 15)
    assert result.fates() == fates
    assert on_air_ms(result) == on_air


def test_backlog_of_all_waits_up_to_the_limit_and_sends_in_order():
    """Handed over at 0.2 to 0.8 s: four wait, two find the queue full, and the one at 0.8 s goes last."""
    result = blacked_out(ALL, one_each(0, 9))
    assert result.fates() == {"RECEIVED": 7, "QUEUE_FULL": 2}
    assert on_air_ms(result) == [0, 100, 800, 880, 960, 1040, 1120]
    assert result.received("sequence").tolist() == [0, 1, 2, 3, 4, 5, 8]
    refused = result.finished("receiver") < 0
    assert (result.finished("sent_at_ns")[refused] // 10**8).tolist() == [6, 7]


@pytest.mark.parametrize("limit", [0, 1, 4])
def test_backlog_of_newest_waits_with_any_limit(limit: int):
    result = blacked_out(NEWEST, one_each(0, 8), replace(SLOWEST, queue_limit=limit))
    assert result.fates() == {"RECEIVED": 3, "BLACKOUT": 5}
    assert on_air_ms(result) == [0, 100, 800]
    assert result.received("sequence").tolist() == [0, 1, 7]
    result = blacked_out(NEWEST, {2: packets([0] * 3)}, replace(SLOWEST, queue_limit=limit))
    assert result.received("sequence").tolist() == [2]
    assert result.fates() == {"RECEIVED": 1, "BLACKOUT": 2}


def test_backlog_is_independent_of_other_radios():
    """Robot 1 goes on as if nothing were, and its queue does not count for the other's."""
    both = {tick: packets([0, 1, 1]) for tick in range(2, 6)}
    result = blacked_out(ALL, both)
    sender, on_air = result.on_air("sender"), np.array(on_air_ms(result))
    assert on_air[sender == 0].tolist() == [800, 880, 960, 1040]
    assert on_air[sender == 1].tolist() == [200, 280, 360, 440, 520, 600, 680, 760]
    assert result.fates() == {"RECEIVED": 4, "BLACKOUT": 8}


def test_backlog_holds_only_packets_accepted_by_the_radio():
    """Handed over at 0.35 s: the radio of robot 1 is off by then, and of its two packets the first is too large."""
    later = replace(SLOWEST, send_offset=0.25)
    sent, now = {1: packets([0, 0, 1, 1], size=[10, 10, 101, 10])}, {2: off(ALL, 1), 8: Disruption.none(2)}
    result = run_disrupted(make_medium(later, 2), PAIR, sent, now, 12)
    assert result.fates() == {"RECEIVED": 1, "BLACKOUT": 2, "TOO_LARGE": 1}
    assert on_air_ms(result) == [350, 430, 800]
    assert [step.tally.fates[0, Fate.TOO_LARGE] for step in result.news].index(1) == 4


def test_backlog_is_released_by_each_radio_separately():
    """Both are off from 0.2 s on, that of robot 1 until 0.5 s, that of robot 0 until 0.8 s."""
    now = {2: off(ALL, 0, 1), 5: off(ALL, 0), 8: Disruption.none(2)}
    result = run_disrupted(make_medium(SLOWEST, 2), PAIR, {3: packets([0, 0, 1, 1])}, now, 15)
    sender, on_air = result.on_air("sender"), np.array(on_air_ms(result))
    assert on_air[sender == 1].tolist() == [500, 580]
    assert on_air[sender == 0].tolist() == [800, 880]


def test_phy_queue_equals_the_unit_disk_queue():
    """Without access there is nothing else to wait for: the same packets go on air at the same instants."""
    signals = replace(with_access("none"), send_offset="uniform", bit_rate_bps=20_000, queue_limit=3)
    assert signals.access == Access("none")
    sizes = {"overhead_bytes": signals.overhead_bytes, "max_payload_bytes": signals.max_payload_bytes}
    disk = Radio(9.0, bit_rate_bps=20_000, queue_limit=3, **sizes)
    draws, tables = np.random.default_rng(3), []
    sent = [packets(draws.integers(0, 3, 20), size=draws.integers(1, 100, 20)) for _ in range(20)]
    for radio in (signals, disk):
        result = run(make_medium(radio, 3), at((0, 0), (1, 0), (0, 1)), sent.__getitem__, 20, 30)
        tables.append(sorted(result.rows("finished", "sender", "sequence", "receiver", "on_air_at_ns", "fate")))
    assert len({row[3] for row in tables[0]}) > 50
    assert tables[0] == tables[1]
