"""What happened to frames is told wholly, in however many goes, to whoever was meant, from where it happened."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from swarmwire.comms.air.disruption import Disruption
from swarmwire.comms.air.parameters.gives import Gives, RangeGiven
from swarmwire.comms.air.signal import signal_way
from swarmwire.comms.air.signal.reports import Reports
from swarmwire.comms.air.signal.told import Told
from swarmwire.comms.air.way import Decided
from tests.support.comms.air.runs import TICK_NS, Run, at, make_air, packets, run, scattered
from tests.support.comms.air.signal.radios import with_access

ROBOTS = 12


def crowded() -> Run:
    """Five packets of each robot in each of three ticks."""
    radio = replace(with_access("aloha"), queue_limit=9)
    return run(make_air(radio, ROBOTS), scattered(ROBOTS), lambda _: packets(np.repeat(range(ROBOTS), 5)), 3, 2)


def finished(told: Run) -> list[tuple[int, ...]]:
    """Every link's fate, with when."""
    columns = ("sender", "sequence", "receiver", "fate", "on_air_at_ns", "final_at_ns")
    return sorted(zip(*(told.finished(name).tolist() for name in columns), strict=True))


def test_in_how_many_goes_it_is_told_does_not_matter(monkeypatch: pytest.MonkeyPatch):
    at_once, goes, decided = finished(crowded()), set[int](), Reports.decided

    def counted(self: Reports, parts: list[Told], *more: Any) -> Decided:
        goes.add(len(parts))
        return decided(self, parts, *more)

    monkeypatch.setattr(Reports, "decided", counted)
    for room in (1, 200, 300, 400):
        monkeypatch.setattr(signal_way, "LEAST_ROOM", room)
        assert finished(crowded()) == at_once
    assert goes >= {1, 2, 3}


@pytest.mark.parametrize("queue_limit", [0, 9])
def test_the_dead_are_meant_only_by_who_addresses_them(queue_limit: int):
    """Robot 2 is dead; of what a full queue refuses, too, and then it would have been in range."""
    radio = replace(with_access("aloha"), queue_limit=queue_limit, send_offset="tick")
    air, alive = make_air(radio, 4), np.array([True, True, False, True])
    told = Run(air)
    air.hold(at((0, 0), (1, 0), (0, 1), (500, 0)), alive)
    air.send(0, 0, packets([0, 0, 0, 0], [-1, -1, 2, 1]))
    told.news.append(air.advance(5 * TICK_NS))
    told.last = air.end()
    refused = {
        0: {"HEARD": 1, "OUT_OF_RANGE": 1, "QUEUE_FULL": 4},
        9: {"HEARD": 3, "OUT_OF_RANGE": 2, "RECEIVER_DEAD": 1},
    }
    assert told.fates() == refused[queue_limit]
    assert told.tally.intended.tolist() == [6]
    assert told.tally.in_range.tolist() == [4]


def test_what_its_sender_did_not_live_to_send_would_have_been_in_range():
    """Frames of 90 ms: at 100 ms the second is on air, and the third waits."""
    air, held = make_air(replace(with_access("aloha"), bit_rate_bps=2400, send_offset="tick"), 2), Disruption.none(2)
    told = Run(air)
    air.hold(at((0, 0), (1, 0)), np.ones(2, np.bool_))
    air.send(0, 0, packets([0, 0, 0]))
    held.alive[0] = False
    air.disrupt(held)
    told.news += [air.advance(TICK_NS), air.advance(5 * TICK_NS)]
    assert told.fates() == {"HEARD": 2, "SENDER_DEAD": 1}
    assert told.tally.in_range.tolist() == [3]


def test_ranges_are_those_at_which_frames_went_on_air():
    """Two frames that end in the same tick; one went on air in the tick before, when the robots were nearer."""
    radio = replace(with_access("aloha"), bit_rate_bps=10_000, send_offset=0.06, gives=Gives(RangeGiven(0.0)))
    air, alive = make_air(radio, 2), np.ones(2, np.bool_)
    told = Run(air)
    for tick, (x_m, sender, size) in enumerate([(1.0, 0, 90), (2.0, 1, 10), (4.0, 0, 10)]):
        told.news.append(air.advance(tick * TICK_NS))
        air.hold(at((0, 0), (x_m, 0)), alive)
        air.send(tick * TICK_NS, tick, packets([sender], size=size))
    told.news.append(air.advance(4 * TICK_NS))
    assert [len(one.heard.receiver) for one in told.news] == [0, 0, 2, 1]
    assert told.given("range_m").tolist() == pytest.approx([2.0, 1.0, 4.0])  # by receiver
