"""The delivery ratio over distance: by hand, and against a loop over packets and robots."""

import math
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings

from swarmwire.comms.packets import BROADCAST, Fate
from swarmwire.metrics.run_folder import distances
from swarmwire.metrics.run_folder.distances import DistanceCounts, bin_width_m
from tests.support.metrics.radio import radio_runs, rows_of
from tests.support.metrics.recorded import links
from tests.support.metrics.truths import departed, static, truth

TICK_NS = 100_000_000


def line(*x_m):
    pose = np.zeros((len(x_m), 3))
    pose[:, 0] = x_m
    return pose


def seen_by(of, *ticks):
    counts = DistanceCounts(of)
    for tick, fields in enumerate(ticks):
        counts.see(truth(of, tick, **fields))
    return counts


def bins(table, arena=0):
    return {place: int(table[arena, place]) for place in np.flatnonzero(table[arena])}


@pytest.mark.parametrize(("range_m", "width_m"), [(2.0, 0.1), (3.9, 0.1), (4.0, 0.2), (100.0, 5.0), (0.05, 0.002)])
def test_bins_have_a_round_width_and_at_least_twenty_lie_within_range(range_m, width_m):
    assert bin_width_m(range_m) == pytest.approx(width_m)


@pytest.mark.parametrize("range_m", [5e-324, 1e-300, 1e-7, 0.2, 2.0, None, 1e300])
def test_however_short_the_range_the_bins_reach_across_the_arena_and_are_few(range_m):
    counts = DistanceCounts(replace(static(2), range_m=range_m))
    across_m = math.hypot(8.0, 6.0)
    assert across_m < counts.intended.shape[1] * counts.width_m < 1.2 * across_m
    assert 20 <= counts.intended.shape[1] <= 2002


def test_everybody_alive_is_meant_by_a_broadcast_however_far_away_and_only_one_by_an_addressed_packet():
    of = static(4)
    pose = line(0.0, 0.55, 1.55, 3.95)
    alive = np.array([True, True, True, False])
    ended = links([0], [1], 0, TICK_NS - 1)
    told = {"departed": departed([0], intended=2, out_of_range=1), "finished": ended}
    counts = seen_by(of, {"pose": pose, "alive": alive}, {"pose": line(9.0, 9.0, 9.0, 9.0), **told})
    assert counts.width_m == pytest.approx(0.1)
    assert (bins(counts.intended), bins(counts.received)) == ({5: 1, 15: 1}, {5: 1})
    addressed = {"departed": departed([0], intended=1, to=2), "finished": links([], [], 0, 0)}
    assert bins(seen_by(of, {"pose": pose, **addressed}).intended) == {15: 1}


def test_a_packet_that_never_went_on_air_tells_nothing_of_distance():
    refused = departed([0], fate=Fate.QUEUE_FULL)
    told = {"departed": refused, "finished": links([0], [-1], 0, 0, fate=Fate.QUEUE_FULL, receivers=3)}
    assert not seen_by(static(4), told).intended.any()


def test_who_received_so_late_that_the_distance_is_forgotten_is_counted_apart(monkeypatch):
    monkeypatch.setattr(distances, "POSES_KEPT_S", 0.2)
    nothing = {"departed": departed([]), "finished": links([], [], 0, 0)}
    late = {**nothing, "finished": links([0], [1], 0, 0)}
    assert [seen_by(static(2), *[nothing] * ticks, late).unknown for ticks in (2, 3)] == [0, 1]


@pytest.mark.parametrize("pairs_per_tick", [10**6, 10, 3])
@settings(max_examples=15)
@given(run=radio_runs())
def test_it_is_that_of_a_loop_over_packets_and_robots(pairs_per_tick, run):
    of, seen = run
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(distances, "PAIRS_PER_TICK", pairs_per_tick)
        counts = DistanceCounts(of)
    spread = int(distances.SPREAD_SEQUENCE), int(distances.SPREAD_SENDER)
    intended, received = Counter(), Counter()

    def place(arena, a, b, on_air_at_ns):
        tick = max(one.tick for one in seen if one.time_ns <= on_air_at_ns)
        pose = seen[tick].pose.reshape(of.arenas, of.robots, 3)[arena]
        return arena, int(math.dist(pose[a, :2], pose[b, :2]) / counts.width_m)

    def taken(sender, sequence):
        return (sequence * spread[0] + sender * spread[1]) % 2**64 * counts.every < 2**64

    for one in seen:
        counts.see(one)
        for arena, sender, to, sequence, fate, on_air in rows_of(
            one.departed, "arena", "sender", "to", "sequence", "fate", "on_air_at_ns"
        ):
            tick = max(one.tick for one in seen if one.time_ns <= on_air)
            alive = seen[tick].alive.reshape(of.arenas, of.robots)[arena]
            for robot in range(of.robots):
                meant = alive[robot] if to == BROADCAST else robot == to
                if meant and robot != sender and fate == Fate.RECEIVED and taken(sender, sequence):
                    intended[place(arena, sender, robot, on_air)] += 1
        for arena, sender, receiver, sequence, fate, on_air in rows_of(
            one.finished, "arena", "sender", "receiver", "sequence", "fate", "on_air_at_ns"
        ):
            if fate == Fate.RECEIVED and taken(sender, sequence):
                received[place(arena, sender, receiver, on_air)] += 1
    last = counts.intended.shape[1] - 1  # beyond the arena's corners, where these robots may walk
    for table, expected in ((counts.intended, intended), (counts.received, received)):
        within = Counter()
        for (arena, b), packets in expected.items():
            within[arena, min(b, last)] += packets
        assert {(a, b): int(table[a, b]) for a, b in zip(*np.nonzero(table), strict=True)} == dict(within)
    assert counts.unknown == 0


def test_of_many_robots_about_as_many_packets_are_counted_as_said_whatever_their_turn():
    of = static(1000)
    counts = DistanceCounts(of)
    assert counts.every == 256
    sender, sequence = (one.ravel() for one in np.meshgrid(np.arange(1000), np.arange(600)))
    taken = counts._taken(sender, sequence)
    assert taken.mean() == pytest.approx(1 / 256, rel=0.02)
    for period in (2, 3, 4, 16):
        turns = np.bincount(sequence[taken] % period)
        assert turns.min() > 0.9 * turns.max()
    in_tick = np.bincount(sequence[taken], minlength=600)
    assert (in_tick.min() >= 1, in_tick.max() <= 9) == (True, True)
