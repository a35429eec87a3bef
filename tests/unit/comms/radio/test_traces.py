"""Measured links that are replayed."""

import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.geometry.shapes import Obstacle
from swarmwire.comms.radio.config.phy import Fading, Shadowing
from swarmwire.comms.radio.config.radio import Radio, Trace
from swarmwire.comms.radio.traces import LinkTraces, RefusedRow
from swarmwire.comms.robot.packets import Fate
from tests.support.comms.radio import (
    METHODS,
    TICK_NS,
    TRIO,
    Run,
    at,
    check_fates,
    everybody,
    make_medium,
    numbers_received,
    packets,
    random_traffic,
    run,
    scattered,
    trace_in_ns,
    trace_of,
    with_access,
)

ROBOTS = 3
# Keys are fixed; shares are held to 4.4 standard errors, a false alarm of 1 in 90 000 each.
AIRTIME_NS = 320_000
DISK = Radio(4.0, send_offset="tick")
NEAR, FAR = at((0, 0), (1, 0), (0, 1)), at((0, 0), (9000, 0), (0, 9000))
ALONE = with_access("none")
BOTH = [(0.0, s, r, -60.0) for s in range(3) for r in range(3) if s != r]


def value(link_trace_, sender: int, receiver: int, at_ns: int) -> float:
    return float(link_trace_.values_at(np.array([sender]), np.array([receiver]), np.array([at_ns]))[0])


@given(
    st.lists(st.tuples(st.integers(0, 50), st.integers(0, 2), st.integers(1, 2), st.floats(0, 1)), min_size=1),
    st.integers(-1, 51),
)
def test_trace_values_equal_a_search_of_the_rows(drawn, at_ns):
    latest = {(t, s, (s + d) % ROBOTS): v for t, s, d, v in drawn}
    rows = [(*key, v) for key, v in sorted(latest.items())]
    measured = trace_in_ns("delivery_ratio", rows)
    for s in range(ROBOTS):
        for r in range(ROBOTS):
            before = [v for t, sender, receiver, v in rows if (sender, receiver) == (s, r) and t <= at_ns]
            assert value(measured, s, r, at_ns) == pytest.approx(before[-1] if before else np.nan, nan_ok=True)


@pytest.mark.parametrize(
    ("quantity", "row", "message"),
    [
        ("delivery_ratio", (1, 0, 3, 0.5), "row 1, receiver: is not one of the robots"),
        ("delivery_ratio", (1, -1, 1, 0.5), "row 1, sender: is not one of the robots"),
        ("delivery_ratio", (1, 1, 1, 0.5), "row 1, receiver: is the sender itself; expected another robot"),
        ("delivery_ratio", (1, 0, 1, 1.01), "row 1, value: expected a ratio from 0 to 1"),
        ("delivery_ratio", (1, 0, 1, np.nan), "row 1, value: expected a ratio from 0 to 1"),
        ("delay_s", (1, 0, 1, -0.1), "row 1, value: expected 0 to 1e+09 s"),
        ("delay_s", (1, 0, 1, 1e308), "row 1, value: expected 0 to 1e+09 s"),  # more than 2^63 ns
        ("rssi_dbm", (1, 0, 1, -np.inf), "row 1, value: expected -1000 to 1000 dBm"),
        ("rssi_dbm", (1, 0, 1, 4000.0), "row 1, value: expected -1000 to 1000 dBm"),  # 10^400 mW is no float64
        ("delay_s", (0, 0, 1, 0.5), "row 1, time: does not rise on this link"),
    ],
)
def test_trace_row_that_is_impossible_is_refused(quantity, row, message):
    with pytest.raises(RefusedRow, match=f"^{re.escape(message)}"):
        trace_in_ns(quantity, [(0, 0, 1, 0.5), row])


def replayed(
    traces: LinkTraces, others: str, ticks: int, radio: Radio = DISK, pose: FloatArray = NEAR, arenas: int = 1
) -> Run:
    """Everybody broadcasts in each tick."""
    medium = make_medium(replace(radio, trace=Trace("a.csv", others)), TRIO, range(arenas), traces=traces)
    return run(medium, np.tile(pose, (arenas, 1)), everybody(arenas * TRIO), ticks, 8)


def test_delivery_ratio_holds_from_its_time_on_for_its_direction():
    ratio = trace_of("delivery_ratio", [(0, 0, 1, 1.0), (2, 0, 1, 0.0), (4, 0, 1, 1.0), (0, 1, 0, 0.0)])
    result = replayed(LinkTraces(delivery_ratio=ratio), "model", 6)
    assert numbers_received(result, 0, 1) == [0, 1, 4, 5]
    assert numbers_received(result, 1, 0) == []
    assert numbers_received(result, 0, 2) == numbers_received(result, 2, 1) == list(range(6))
    assert result.fates() == {"RECEIVED": 4 + 4 * 6, "LOST": 2 + 6}
    assert result.tally.in_range.sum() == 36


def test_trace_links_without_a_value_are_out_of_range_or_modelled():
    traces = LinkTraces(
        trace_of("delivery_ratio", [(0, 0, 1, 1.0), (3, 2, 0, 0.0)]), None, trace_of("delay_s", [(2, 1, 0, 0.0)])
    )
    result = replayed(traces, "none", 5)
    assert (numbers_received(result, 0, 1), numbers_received(result, 1, 0)) == ([0, 1, 2, 3, 4], [2, 3, 4])
    assert result.fates() == {"RECEIVED": 8, "LOST": 2, "OUT_OF_RANGE": 20}
    assert result.tally.in_range.sum() == 10
    assert Fate.OUT_OF_RANGE not in result.finished("fate")
    assert result.departed("out_of_range").sum() == 20
    assert replayed(traces, "model", 5).fates() == {"RECEIVED": 28, "LOST": 2}


def test_trace_delay_adds_to_the_latency():
    delay = trace_of("delay_s", [(0, 0, 1, 0.25), (1, 0, 1, 0.0)])
    result = replayed(LinkTraces(delay_s=delay), "none", 2, replace(DISK, latency_s=0.01))
    expected_ns = [TICK_NS + AIRTIME_NS + 10_000_000, AIRTIME_NS + 260_000_000]
    assert result.received("received_at_ns").tolist() == expected_ns


def test_trace_shifts_no_other_draw_and_keeps_the_disk_range():
    lossy = replace(DISK, loss=0.4, jitter_s=0.05, range_m=1.2)
    without = run(make_medium(lossy, TRIO, [0]), NEAR, everybody(TRIO), 30, 8)
    perfect = trace_of("delivery_ratio", [(0, s, (s + d) % 3, 1.0) for s in range(3) for d in (1, 2)])
    result = replayed(LinkTraces(delivery_ratio=perfect), "none", 30, lossy)
    for name in ("sender_index", "receiver", "sequence", "received_at_ns"):
        np.testing.assert_array_equal(result.received(name), without.received(name))
    assert not numbers_received(result, 1, 2)


def test_trace_graph_joins_pairs_by_their_worse_direction():
    ratio = trace_of("delivery_ratio", [(0, 0, 1, 0.9), (0, 1, 0, 0.4), (0, 0, 2, 0.9), (0, 2, 0, 0.2), (2, 2, 0, 0.6)])
    for others, expected in (("none", []), ("model", [[1, 2]])):
        radio = replace(DISK, trace=Trace("a.csv", others), min_delivery=0.3)
        medium = make_medium(radio, TRIO, traces=LinkTraces(delivery_ratio=ratio))
        assert medium.step(0, NEAR).edges.tolist() == [[0, 1], *expected]
        assert medium.step(2 * TICK_NS, NEAR).edges.tolist() == [[0, 1], [0, 2], *expected]


@pytest.mark.parametrize("radio", [DISK, replace(DISK, trace=Trace("a.csv"))])
def test_trace_and_its_file_go_together(radio: Radio):
    traces = None if radio.trace else LinkTraces()
    with pytest.raises(ValueError, match="traces: expected"):
        make_medium(radio, TRIO, traces=traces)


def strengths(result: Run, sender: int, receiver: int) -> list[float]:
    """Of the packets that the receiver was told of, in order."""
    is_link = (result.finished("sender") == sender) & (result.finished("receiver") == receiver)
    return np.round(result.finished("rssi_dbm")[is_link], 6).tolist()


def test_trace_rssi_replaces_the_model_by_direction_and_time():
    rssi = trace_of("rssi_dbm", [(0, 0, 1, -60), (0, 1, 0, -75.5), (2, 0, 1, -70), (1, 2, 0, -50)])
    for pose in (NEAR, FAR):
        result = replayed(LinkTraces(rssi_dbm=rssi), "none", 3, ALONE, pose)
        assert strengths(result, 0, 1) == [-60.0, -60.0, -70.0]
        assert strengths(result, 1, 0) == [-75.5] * 3
        assert strengths(result, 2, 0) == [-50.0] * 2
        assert result.fates() == {"RECEIVED": 8, "OUT_OF_RANGE": 10}
        assert result.tally.in_range.sum() == 8


def test_trace_links_without_rssi_are_modelled():
    bare = replayed(LinkTraces(rssi_dbm=trace_of("rssi_dbm", [(5, 0, 1, -60)])), "model", 2, ALONE)
    mixed = replayed(LinkTraces(rssi_dbm=trace_of("rssi_dbm", [(0, 0, 1, -60)])), "model", 2, ALONE)
    assert strengths(mixed, 0, 1) == [-60.0] * 2
    for link in ((1, 0), (0, 2), (1, 2)):
        assert strengths(mixed, *link) == strengths(bare, *link)
    assert strengths(bare, 0, 1) == strengths(bare, 1, 0)
    far = replayed(LinkTraces(rssi_dbm=trace_of("rssi_dbm", [(0, 0, 1, -60)])), "model", 2, ALONE, FAR)
    assert far.fates() == {"RECEIVED": 2, "OUT_OF_RANGE": 10}


def test_trace_rssi_below_the_sensitivity_is_too_weak():
    result = replayed(LinkTraces(rssi_dbm=trace_of("rssi_dbm", [(0, 0, 1, -130), (0, 1, 0, -60)])), "none", 4, ALONE)
    assert (numbers_received(result, 0, 1), numbers_received(result, 1, 0)) == ([], [0, 1, 2, 3])


def test_trace_rssi_includes_shadowing_and_obstacles_but_not_fading():
    traces = LinkTraces(rssi_dbm=trace_of("rssi_dbm", BOTH))
    between = [Obstacle("cylinder", 0.5, 0.5, radius_m=0.1)]
    blocked = make_medium(replace(ALONE, line_of_sight=True, trace=Trace("a.csv")), TRIO, [0], [between], traces)
    assert run(blocked, NEAR, everybody(TRIO), 1, 1).fates() == {"RECEIVED": 6}
    shaded = replayed(traces, "none", 1, replace(ALONE, shadowing=Shadowing(8.0, 1.0)))
    assert set(np.round(shaded.finished("rssi_dbm"), 6)) == {-60.0}
    fading = replace(ALONE, fading=Fading())
    measured = replayed(traces, "none", 1, fading)
    modelled, unfaded = (run(make_medium(radio, TRIO, [0]), NEAR, everybody(TRIO), 1, 8) for radio in (fading, ALONE))
    gain_db = [strengths(modelled, *link)[0] - strengths(unfaded, *link)[0] for link in ((0, 1), (2, 0))]
    assert [strengths(measured, *link)[0] + 60.0 for link in ((0, 1), (2, 0))] == pytest.approx(gain_db, abs=1e-4)


def test_trace_ratio_holds_for_each_link_of_the_phy():
    """All or nothing; robots send one after the other, each in a run of its own."""
    ratios = {(0, 1): 0.0, (0, 2): 1.0, (1, 2): 0.0, (2, 0): 1.0, (2, 1): 0.0}
    ratio = trace_of("delivery_ratio", [(0, *link, share) for link, share in ratios.items()])
    passing = set[tuple[int, int]]()
    for sender in range(TRIO):
        radio = replace(ALONE, trace=Trace("a.csv", "model"))
        medium = make_medium(radio, TRIO, traces=LinkTraces(delivery_ratio=ratio))
        result = run(medium, NEAR, lambda _, sender=sender: packets([sender]), 3, 1)
        passing |= {(sender, r) for r in result.received("receiver").tolist()}
    assert passing == {(0, 2), (1, 0), (2, 0)}


@pytest.mark.parametrize("method", METHODS)
def test_trace_ratio_is_the_share_received_under_any_access(method: str):
    """Of lone packets, so that nothing else takes any."""
    ratio = LinkTraces(delivery_ratio=trace_of("delivery_ratio", [(0, 0, 1, 0.6), (0, 0, 2, 1.0)]))
    medium = make_medium(replace(with_access(method), trace=Trace("a.csv")), TRIO, range(4), traces=ratio)
    result = run(medium, np.tile(NEAR, (4, 1)), lambda _: packets(range(0, 12, 3)), 300, 2)
    shares = [len(numbers_received(result, 0, r)) / 300 for r in range(12)]
    assert shares[2::3] == [1.0] * 4
    assert abs(np.mean(shares[1::3]) - 0.6) < 4.4 * np.sqrt(0.6 * 0.4 / 1200)
    assert set(result.fates()) == {"RECEIVED", "LOST"}


@pytest.mark.parametrize("method", ["csma-802154", "dcf"])
def test_trace_ratio_applies_to_retries_and_acknowledgements(method: str):
    lossy = [(0, 0, 1, 0.5), (0, 1, 0, 0.5)]
    radio = replace(with_access(method), trace=Trace("a.csv"))
    medium = make_medium(radio, TRIO, range(3), traces=LinkTraces(delivery_ratio=trace_of("delivery_ratio", lossy)))
    result = run(medium, np.tile(NEAR, (3, 1)), lambda _: packets([0, 3, 6], to=1), 100, 2)
    assert 0.9 < len(result.received("sequence")) / 300 <= 1.0
    late_ns = result.received("received_at_ns") - result.received("sequence") * TICK_NS
    assert (late_ns > 2 * late_ns.min()).sum() > 50


def test_trace_delay_follows_reception():
    without = run(make_medium(ALONE, TRIO, [0]), NEAR, everybody(TRIO), 1, 8)
    result = replayed(LinkTraces(delay_s=trace_of("delay_s", [(0, 0, 1, 0.25)])), "none", 1, ALONE)
    first = (without.received("sender_index") == 0) & (without.received("receiver") == 1)
    np.testing.assert_array_equal(
        result.received("received_at_ns"), without.received("received_at_ns")[first] + 250_000_000
    )


def test_trace_graph_joins_by_rssi_and_ratio_both_ways():
    rows = [(0, 0, 1, -60), (0, 1, 0, -60), (0, 0, 2, -60), (0, 2, 0, -130), (2, 2, 0, -70)]
    strong = trace_of("rssi_dbm", rows)
    rare = trace_of("delivery_ratio", [(0, 0, 1, 0.05), (1, 0, 1, 0.5)])
    for others, expected in (("none", []), ("model", [[1, 2]])):
        for ratio, at_first in ((None, [[0, 1]]), (rare, [])):
            radio = replace(ALONE, trace=Trace("a.csv", others))
            medium = make_medium(radio, TRIO, traces=LinkTraces(ratio, strong))
            for now_ns, edges in ((0, at_first), (2 * TICK_NS, [[0, 1], [0, 2]])):
                assert medium.step(now_ns, NEAR).edges.tolist() == [*edges, *expected]


@given(st.sampled_from(METHODS), st.integers(0, 1000), st.sampled_from(["none", "model"]), st.integers(1, 2))
def test_trace_fates_add_up_and_arenas_are_independent(method: str, seed: int, others: str, arenas: int):
    rng = np.random.default_rng(seed)
    robots = TRIO
    links = [(t, s, r) for t in (0, 2) for s in range(robots) for r in range(robots) if s != r and rng.random() < 0.5]
    links.append((3, 0, 1))
    ratio = trace_of("delivery_ratio", [(*link, rng.random()) for link in links])
    rssi = trace_of("rssi_dbm", [(*link, rng.uniform(-110, -60)) for link in links])
    radio = replace(with_access(method), trace=Trace("a.csv", others))
    pose = scattered(arenas * robots, seed) * [20.0, 20.0, 1.0]
    sent = [random_traffic(rng, 1, robots) for _ in range(4)]

    def in_all(tick: int):
        """The same in each arena."""
        sender = np.concatenate([sent[tick].sender + arena * robots for arena in range(arenas)])
        return packets(sender, np.tile(sent[tick].to, arenas), np.tile(sent[tick].payloads.sizes, arenas))

    medium = make_medium(radio, robots, range(arenas), traces=LinkTraces(ratio, rssi))
    result = run(medium, pose, in_all, 4, 2)
    check_fates(result)
    alone = run(make_medium(radio, robots, [0], traces=LinkTraces(ratio, rssi)), pose[:robots], lambda t: sent[t], 4, 2)
    np.testing.assert_array_equal(result.tally.fates[0], alone.tally.fates[0])
