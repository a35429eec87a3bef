"""Measured links: the last value holds; they lose, delay and end what they did when they were measured."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.packets import Fate
from swarmwire.comms.radio.config.radio import Radio, Trace
from swarmwire.comms.radio.traces import LinkTraces, RefusedRow, link_trace
from tests.support.comms.radio.measured import TRIO, numbers_received, trace_of
from tests.support.comms.radio.runs import TICK_NS, Run, at, everybody, make_medium, run

ROBOTS = 3
ROWS = [(20, 2, 0, 0.3), (0, 0, 1, 1.0), (10, 0, 1, 0.5), (5, 1, 0, 0.0), (30, 0, 1, 0.25)]


def trace(rows, quantity="delivery_ratio"):
    time_ns, sender, receiver, value = (np.array(column) for column in zip(*rows, strict=True))
    return link_trace(quantity, ROBOTS, time_ns, sender, receiver, value.astype(float))


def value(of, sender: int, receiver: int, at_ns: int) -> float:
    return float(of.at(np.array([sender]), np.array([receiver]), np.array([at_ns]))[0])


@pytest.mark.parametrize(
    ("at_ns", "expected"), [(-1, np.nan), (0, 1.0), (9, 1.0), (10, 0.5), (29, 0.5), (30, 0.25), (10**15, 0.25)]
)
def test_a_value_holds_until_the_next_of_its_link(at_ns, expected):
    assert value(trace(ROWS), 0, 1, at_ns) == pytest.approx(expected, nan_ok=True)


def test_directions_are_apart_and_links_never_measured_are_unknown():
    measured = trace(ROWS)
    assert value(measured, 1, 0, 5) == 0.0
    assert np.isnan(value(measured, 1, 0, 4))
    assert np.isnan(value(measured, 2, 1, 100))
    assert np.isnan(value(measured, 0, 2, 100))


@given(
    st.lists(st.tuples(st.integers(0, 50), st.integers(0, 2), st.integers(1, 2), st.floats(0, 1)), min_size=1),
    st.integers(-1, 51),
)
def test_every_link_is_as_its_rows_say(drawn, at_ns):
    latest = {(t, s, (s + d) % ROBOTS): v for t, s, d, v in drawn}
    rows = [(*key, v) for key, v in sorted(latest.items())]
    measured = trace(rows)
    for s in range(ROBOTS):
        for r in range(ROBOTS):
            before = [v for t, sender, receiver, v in rows if (sender, receiver) == (s, r) and t <= at_ns]
            assert value(measured, s, r, at_ns) == pytest.approx(before[-1] if before else np.nan, nan_ok=True)


@pytest.mark.parametrize(
    ("quantity", "row", "told"),
    [
        ("delivery_ratio", (1, 0, 3, 0.5), "row 1, receiver: is not one of the robots"),
        ("delivery_ratio", (1, -1, 1, 0.5), "row 1, sender: is not one of the robots"),
        ("delivery_ratio", (1, 1, 1, 0.5), "row 1, receiver: is the sender itself; expected another robot"),
        ("delivery_ratio", (1, 0, 1, 1.01), "row 1, value: expected a ratio from 0 to 1"),
        ("delivery_ratio", (1, 0, 1, np.nan), "row 1, value: expected a ratio from 0 to 1"),
        ("delay_s", (1, 0, 1, -0.1), "row 1, value: expected at least 0 s"),
        ("rssi_dbm", (1, 0, 1, -np.inf), "row 1, value: expected a number of dBm"),
        (
            "delay_s",
            (0, 0, 1, 0.5),
            "row 1, time: does not rise on this link; expected its rows in the order of time",
        ),
    ],
)
def test_what_cannot_be_is_refused(quantity, row, told):
    with pytest.raises(RefusedRow) as error:
        trace([(0, 0, 1, 0.5), row], quantity)
    assert str(error.value) == told


# Keys are fixed; shares are held to 4.4 standard errors, a false alarm of 1 in 90 000 each.
AIRTIME_NS = 320_000
POSE = at((0, 0), (1, 0), (0, 1))
DISK = Radio(4.0, send_offset="tick")


def replayed(traces: LinkTraces, others: str, ticks: int, radio: Radio = DISK, arenas: int = 1) -> Run:
    """Everybody broadcasts in each tick."""
    medium = make_medium(replace(radio, trace=Trace("a.csv", others)), TRIO, range(arenas), traces=traces)
    return run(medium, np.tile(POSE, (arenas, 1)), everybody(arenas * TRIO), ticks, 8)


def test_a_ratio_holds_from_its_time_on_for_its_direction_alone():
    ratio = trace_of("delivery_ratio", [(0, 0, 1, 1.0), (2, 0, 1, 0.0), (4, 0, 1, 1.0), (0, 1, 0, 0.0)])
    told = replayed(LinkTraces(delivery_ratio=ratio), "model", 6)
    assert numbers_received(told, 0, 1) == [0, 1, 4, 5]
    assert numbers_received(told, 1, 0) == []
    assert numbers_received(told, 0, 2) == numbers_received(told, 2, 1) == list(range(6))
    assert told.fates() == {"RECEIVED": 4 + 4 * 6, "LOST": 2 + 6}
    assert told.tally.in_range.sum() == 36


@pytest.mark.parametrize("ratio", [0.2, 0.7])
def test_a_ratio_is_the_share_that_is_received(ratio: float):
    told = replayed(LinkTraces(delivery_ratio=trace_of("delivery_ratio", [(0, 0, 1, ratio)])), "none", 500, arenas=4)
    share = len(told.received("sequence")) / 2000
    assert abs(share - ratio) < 4.4 * np.sqrt(ratio * (1.0 - ratio) / 2000)


def test_links_without_a_value_yet_are_out_of_range_or_as_the_model_has_them():
    traces = LinkTraces(
        trace_of("delivery_ratio", [(0, 0, 1, 1.0), (3, 2, 0, 0.0)]), None, trace_of("delay_s", [(2, 1, 0, 0.0)])
    )
    told = replayed(traces, "none", 5)
    assert (numbers_received(told, 0, 1), numbers_received(told, 1, 0)) == ([0, 1, 2, 3, 4], [2, 3, 4])
    assert told.fates() == {"RECEIVED": 8, "LOST": 2, "OUT_OF_RANGE": 20}
    assert told.tally.in_range.sum() == 10
    assert Fate.OUT_OF_RANGE not in told.finished("fate")
    assert replayed(traces, "model", 5).fates() == {"RECEIVED": 28, "LOST": 2}


def test_a_delay_comes_on_top_of_the_radio_s_own():
    delay = trace_of("delay_s", [(0, 0, 1, 0.25), (1, 0, 1, 0.0)])
    told = replayed(LinkTraces(delay_s=delay), "none", 2, replace(DISK, latency_s=0.01))
    assert told.received("received_at_ns").tolist() == [
        TICK_NS + AIRTIME_NS + 10_000_000,
        AIRTIME_NS + 260_000_000,
    ]


def test_a_trace_shifts_no_other_draw_and_reaches_no_farther_than_the_disk():
    lossy = replace(DISK, loss=0.4, jitter_s=0.05, range_m=1.2)
    without = run(make_medium(lossy, TRIO, [0]), POSE, everybody(TRIO), 30, 8)
    ones = trace_of("delivery_ratio", [(0, s, (s + d) % 3, 1.0) for s in range(3) for d in (1, 2)])
    told = replayed(LinkTraces(delivery_ratio=ones), "none", 30, lossy)
    for name in ("sender", "receiver", "sequence", "received_at_ns"):
        np.testing.assert_array_equal(told.received(name), without.received(name))
    assert not numbers_received(told, 1, 2)


def test_the_graph_has_the_pairs_whose_worse_direction_suffices_now():
    ratio = trace_of("delivery_ratio", [(0, 0, 1, 0.9), (0, 1, 0, 0.4), (0, 0, 2, 0.9), (0, 2, 0, 0.2), (2, 2, 0, 0.6)])
    for others, expected in (("none", []), ("model", [[1, 2]])):
        radio = replace(DISK, trace=Trace("a.csv", others), min_delivery=0.3)
        medium = make_medium(radio, TRIO, traces=LinkTraces(delivery_ratio=ratio))
        assert medium.step(0, POSE).edges.tolist() == [[0, 1], *expected]
        assert medium.step(2 * TICK_NS, POSE).edges.tolist() == [[0, 1], [0, 2], *expected]


@pytest.mark.parametrize("radio", [DISK, replace(DISK, trace=Trace("a.csv"))])
def test_a_trace_and_its_file_go_together(radio: Radio):
    traces = None if radio.trace else LinkTraces()
    with pytest.raises(ValueError, match="traces: expected"):
        make_medium(radio, TRIO, traces=traces)
