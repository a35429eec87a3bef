"""Measured links of signals: strengths stand in for the model's, ratios and delays come on top, each way for itself.

Keys are fixed; shares are held to 4.4 standard errors, a false alarm of 1 in 90 000 each.
"""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.radio.config.phy import Fading, Shadowing
from swarmwire.comms.radio.config.radio import Radio, Trace
from swarmwire.comms.radio.traces import LinkTraces
from swarmwire.comms.truth import Obstacle
from tests.support.comms.radio.measured import TRIO, numbers_received, trace_of
from tests.support.comms.radio.phy.radios import METHODS, with_access
from tests.support.comms.radio.runs import TICK_NS, Run, at, everybody, make_medium, packets, run, scattered
from tests.support.comms.radio.traffic import random_traffic

NEAR, FAR = at((0, 0), (1, 0), (0, 1)), at((0, 0), (9000, 0), (0, 9000))
ALONE = with_access("none")
BOTH = [(0.0, s, r, -60.0) for s in range(3) for r in range(3) if s != r]


def replayed(
    traces: LinkTraces, others: str, ticks: int, radio: Radio = ALONE, pose: FloatArray = NEAR, arenas: int = 1
) -> Run:
    """Everybody broadcasts in each tick."""
    medium = make_medium(replace(radio, trace=Trace("a.csv", others)), TRIO, range(arenas), traces=traces)
    return run(medium, np.tile(pose, (arenas, 1)), everybody(arenas * TRIO), ticks, 8)


def strengths(told: Run, sender: int, receiver: int) -> list[float]:
    """Of the packets that the receiver was told of, in order."""
    mine = (told.finished("sender") == sender) & (told.finished("receiver") == receiver)
    return np.round(told.finished("rssi_dbm")[mine], 6).tolist()


def test_a_strength_stands_in_for_the_model_each_way_and_for_as_long_as_it_holds():
    rssi = trace_of("rssi_dbm", [(0, 0, 1, -60), (0, 1, 0, -75.5), (2, 0, 1, -70), (1, 2, 0, -50)])
    for pose in (NEAR, FAR):
        told = replayed(LinkTraces(rssi_dbm=rssi), "none", 3, pose=pose)
        assert strengths(told, 0, 1) == [-60.0, -60.0, -70.0]
        assert strengths(told, 1, 0) == [-75.5] * 3
        assert strengths(told, 2, 0) == [-50.0] * 2
        assert told.fates() == {"RECEIVED": 8, "OUT_OF_RANGE": 10}
        assert told.tally.in_range.sum() == 8


def test_links_without_a_strength_are_as_the_model_has_them():
    bare = replayed(LinkTraces(rssi_dbm=trace_of("rssi_dbm", [(5, 0, 1, -60)])), "model", 2)
    mixed = replayed(LinkTraces(rssi_dbm=trace_of("rssi_dbm", [(0, 0, 1, -60)])), "model", 2)
    assert strengths(mixed, 0, 1) == [-60.0] * 2
    for link in ((1, 0), (0, 2), (1, 2)):
        assert strengths(mixed, *link) == strengths(bare, *link)
    assert strengths(bare, 0, 1) == strengths(bare, 1, 0)
    far = replayed(LinkTraces(rssi_dbm=trace_of("rssi_dbm", [(0, 0, 1, -60)])), "model", 2, pose=FAR)
    assert far.fates() == {"RECEIVED": 2, "OUT_OF_RANGE": 10}


def test_a_strength_is_too_weak_where_the_receiver_says_so():
    told = replayed(LinkTraces(rssi_dbm=trace_of("rssi_dbm", [(0, 0, 1, -130), (0, 1, 0, -60)])), "none", 4)
    assert (numbers_received(told, 0, 1), numbers_received(told, 1, 0)) == ([], [0, 1, 2, 3])


def test_what_was_measured_holds_shadows_and_obstacles_and_fades_on_top():
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


def test_each_link_has_its_own_ratio_and_one_that_was_not_measured_is_as_the_model_has_it():
    """All or nothing; robots send one after the other, each in a run of its own."""
    ratios = {(0, 1): 0.0, (0, 2): 1.0, (1, 2): 0.0, (2, 0): 1.0, (2, 1): 0.0}
    traces = LinkTraces(
        delivery_ratio=trace_of("delivery_ratio", [(0, *link, ratio) for link, ratio in ratios.items()])
    )
    passing = set[tuple[int, int]]()
    for sender in range(TRIO):
        medium = make_medium(replace(ALONE, trace=Trace("a.csv", "model")), TRIO, traces=traces)
        told = run(medium, NEAR, lambda _, sender=sender: packets([sender]), 3, 1)
        passing |= {(sender, r) for r in told.received("receiver").tolist()}
    assert passing == {(0, 2), (1, 0), (2, 0)}


@pytest.mark.parametrize("method", METHODS)
def test_a_ratio_is_the_share_that_is_received_whatever_the_access(method: str):
    """Of lone packets, so that nothing else takes any."""
    ratio = LinkTraces(delivery_ratio=trace_of("delivery_ratio", [(0, 0, 1, 0.6), (0, 0, 2, 1.0)]))
    medium = make_medium(replace(with_access(method), trace=Trace("a.csv")), TRIO, range(4), traces=ratio)
    told = run(medium, np.tile(NEAR, (4, 1)), lambda _: packets(range(0, 12, 3)), 300, 2)
    shares = [len(numbers_received(told, 0, r)) / 300 for r in range(12)]
    assert shares[2::3] == [1.0] * 4
    assert abs(np.mean(shares[1::3]) - 0.6) < 4.4 * np.sqrt(0.6 * 0.4 / 1200)
    assert set(told.fates()) == {"RECEIVED", "LOST"}


@pytest.mark.parametrize("method", ["csma-802154", "dcf"])
def test_what_a_ratio_takes_is_sent_again_and_so_is_what_takes_acknowledgements(method: str):
    lossy = [(0, 0, 1, 0.5), (0, 1, 0, 0.5)]
    radio = replace(with_access(method), trace=Trace("a.csv"))
    medium = make_medium(radio, TRIO, range(3), traces=LinkTraces(delivery_ratio=trace_of("delivery_ratio", lossy)))
    told = run(medium, np.tile(NEAR, (3, 1)), lambda _: packets([0, 3, 6], to=1), 100, 2)
    assert 0.9 < len(told.received("sequence")) / 300 <= 1.0
    late_ns = told.received("received_at_ns") - told.received("sequence") * TICK_NS
    assert (late_ns > 2 * late_ns.min()).sum() > 50


def test_a_delay_comes_after_reception():
    without = run(make_medium(ALONE, TRIO, [0]), NEAR, everybody(TRIO), 1, 8)
    told = replayed(LinkTraces(delay_s=trace_of("delay_s", [(0, 0, 1, 0.25)])), "none", 1)
    first = (without.received("sender") == 0) & (without.received("receiver") == 1)
    assert (
        told.received("received_at_ns").tolist() == (without.received("received_at_ns")[first] + 250_000_000).tolist()
    )


def test_the_graph_has_the_pairs_that_strength_and_ratio_join_both_ways():
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
def test_fates_add_up_and_arenas_do_not_meet(method: str, seed: int, others: str, arenas: int):
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
        one = sent[tick]
        if arenas == 1:
            return one
        sender = np.concatenate([one.sender, one.sender + robots])
        sizes = np.tile(one.payloads.sizes, 2)
        return packets(sender, np.tile(one.to, 2), sizes)

    medium = make_medium(radio, robots, range(arenas), traces=LinkTraces(ratio, rssi))
    told = run(medium, pose, in_all, 4, 2)
    np.testing.assert_array_equal(told.tally.fates.sum(axis=1), told.tally.intended)
    assert (told.tally.fates >= 0).all()
    alone = run(make_medium(radio, robots, [0], traces=LinkTraces(ratio, rssi)), pose[:robots], lambda t: sent[t], 4, 2)
    np.testing.assert_array_equal(told.tally.fates[0], alone.tally.fates[0])
