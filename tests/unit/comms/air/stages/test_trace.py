"""Measured links are replayed: they lose, delay and end what they did when they were measured.

Keys are fixed; shares are held to 4.4 standard errors, a false alarm of 1 in 90 000 each.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from swarmwire.comms.air.parameters.trace import Trace
from swarmwire.comms.air.radio import Radio
from swarmwire.comms.air.traces.link_trace import LinkTrace, Quantity, link_trace
from swarmwire.comms.air.traces.link_traces import LinkTraces
from swarmwire.comms.fates import Fate
from tests.support.comms.air.runs import TICK_NS, Run, at, everybody, make_air, run

ROBOTS, AIRTIME_NS = 3, 320_000
POSE = at((0, 0), (1, 0), (0, 1))
DISK = Radio(4.0, send_offset="tick")
Row = tuple[float, int, int, float]  # tick, sender, receiver, value


def of(quantity: Quantity, rows: Sequence[Row]) -> LinkTrace:
    """The trace of rows (tick, sender, receiver, value)."""
    tick, sender, receiver, value = (np.array(column) for column in zip(*rows, strict=True))
    return link_trace(
        quantity, ROBOTS, np.round(tick * TICK_NS).astype(np.int64), sender, receiver, value.astype(np.float64)
    )


def replayed(traces: LinkTraces, others: str, ticks: int, radio: Radio = DISK, arenas: int = 1) -> Run:
    """Everybody broadcasts in each tick."""
    air = make_air(replace(radio, trace=Trace("a.csv", others)), ROBOTS, range(arenas), traces=traces)
    return run(air, np.tile(POSE, (arenas, 1)), everybody(arenas * ROBOTS), ticks, 8)


def heard(told: Run, sender: int, receiver: int) -> list[int]:
    """The numbers of the packets that the receiver heard of the sender."""
    mine = (told.heard("sender") == sender) & (told.heard("receiver") == receiver)
    return told.heard("sequence")[mine].tolist()


def test_a_ratio_holds_from_its_time_on_for_its_direction_alone():
    ratio = of("delivery_ratio", [(0, 0, 1, 1.0), (2, 0, 1, 0.0), (4, 0, 1, 1.0), (0, 1, 0, 0.0)])
    told = replayed(LinkTraces(delivery_ratio=ratio), "model", 6)
    assert heard(told, 0, 1) == [0, 1, 4, 5]
    assert heard(told, 1, 0) == []
    assert heard(told, 0, 2) == heard(told, 2, 1) == list(range(6))
    assert told.fates() == {"HEARD": 4 + 4 * 6, "LOST": 2 + 6}
    assert told.tally.in_range.sum() == 36


@pytest.mark.parametrize("ratio", [0.2, 0.7])
def test_a_ratio_is_the_share_that_is_heard(ratio: float):
    told = replayed(LinkTraces(delivery_ratio=of("delivery_ratio", [(0, 0, 1, ratio)])), "none", 500, arenas=4)
    share = len(told.heard("sequence")) / 2000
    assert abs(share - ratio) < 4.4 * np.sqrt(ratio * (1.0 - ratio) / 2000)


def test_links_without_a_value_yet_are_out_of_range_or_as_the_model_has_them():
    traces = LinkTraces(of("delivery_ratio", [(0, 0, 1, 1.0), (3, 2, 0, 0.0)]), None, of("delay_s", [(2, 1, 0, 0.0)]))
    told = replayed(traces, "none", 5)
    assert (heard(told, 0, 1), heard(told, 1, 0)) == ([0, 1, 2, 3, 4], [2, 3, 4])
    assert told.fates() == {"HEARD": 8, "LOST": 2, "OUT_OF_RANGE": 20}
    assert told.tally.in_range.sum() == 10
    assert Fate.OUT_OF_RANGE not in told.finished("fate")
    assert replayed(traces, "model", 5).fates() == {"HEARD": 28, "LOST": 2}


def test_a_delay_comes_on_top_of_the_radio_s_own():
    delay = of("delay_s", [(0, 0, 1, 0.25), (1, 0, 1, 0.0)])
    told = replayed(LinkTraces(delay_s=delay), "none", 2, replace(DISK, latency_s=0.01))
    assert told.heard("heard_at_ns").tolist() == [
        TICK_NS + AIRTIME_NS + 10_000_000,
        AIRTIME_NS + 260_000_000,
    ]


def test_a_trace_shifts_no_other_draw_and_reaches_no_farther_than_the_disk():
    lossy = replace(DISK, loss=0.4, jitter_s=0.05, range_m=1.2)
    without = run(make_air(lossy, ROBOTS, [0]), POSE, everybody(ROBOTS), 30, 8)
    ones = of("delivery_ratio", [(0, s, (s + d) % 3, 1.0) for s in range(3) for d in (1, 2)])
    told = replayed(LinkTraces(delivery_ratio=ones), "none", 30, lossy)
    for name in ("sender", "receiver", "sequence", "heard_at_ns"):
        np.testing.assert_array_equal(told.heard(name), without.heard(name))
    assert not heard(told, 1, 2)


def test_the_graph_has_the_pairs_whose_worse_direction_suffices_now():
    ratio = of("delivery_ratio", [(0, 0, 1, 0.9), (0, 1, 0, 0.4), (0, 0, 2, 0.9), (0, 2, 0, 0.2), (2, 2, 0, 0.6)])
    alive = np.ones(ROBOTS, np.bool_)
    for others, expected in (("none", []), ("model", [[1, 2]])):
        radio = replace(DISK, trace=Trace("a.csv", others), min_delivery=0.3)
        air = make_air(radio, ROBOTS, traces=LinkTraces(delivery_ratio=ratio))
        assert air.edges(POSE, alive).tolist() == [[0, 1], *expected]
        air.advance(2 * TICK_NS)
        assert air.edges(POSE, alive).tolist() == [[0, 1], [0, 2], *expected]


@pytest.mark.parametrize("radio", [DISK, replace(DISK, trace=Trace("a.csv"))])
def test_a_trace_and_its_file_go_together(radio: Radio):
    traces = None if radio.trace else LinkTraces()
    with pytest.raises(ValueError, match="traces: expected"):
        make_air(radio, ROBOTS, traces=traces)
