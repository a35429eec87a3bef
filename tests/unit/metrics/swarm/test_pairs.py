"""Pairs of robots: near each other, in each other's way, and deadlocked; against all pairs."""

from dataclasses import replace
from math import lgamma

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from swarmwire.metrics.measures.measure import Metrics
from swarmwire.metrics.measures.metric import TickView
from swarmwire.metrics.measures.swarm.contacts import smallest_gap_m
from swarmwire.metrics.measures.swarm.motion import Deadlocked
from swarmwire.metrics.measures.swarm.pairs import NearPairs
from tests.support.metrics.swarms import Swarm, last_values, measure, rolled, stand, swarms
from tests.support.metrics.truths import measured, static, truth


def pairs_found(swarm: Swarm, reach_m, finder=None):
    pairs = (finder or NearPairs(swarm.static, reach_m)).find(TickView(swarm.static, swarm.truth()))
    return sorted(tuple(sorted(pair)) for pair in pairs.tolist())


def all_pairs(swarm: Swarm, reach_m):
    n = swarm.static.robots
    pairs = []
    for first in range(0, len(swarm.pose), n):
        apart_m = swarm.apart_m(swarm.pose[first : first + n])
        near = apart_m < reach_m[:, None] + reach_m[None, :]
        living = swarm.alive[first : first + n]
        pairs += [(first + i, first + j) for j in range(n) for i in range(j) if near[i, j] and living[i] and living[j]]
    return sorted(pairs)


@settings(max_examples=150)
@given(swarms(least=5), st.sampled_from([0.02, 0.2, 0.9, 1.3, 2.1, 9.0]), st.integers(0, 1000))
def test_near_pairs_are_those_of_all_pairs_each_once_whatever_the_reaches(swarm, reach_m, seed):
    reaches_m = reach_m * np.random.default_rng(seed).choice([0.3, 1.0, 1.01], swarm.static.robots)
    assert pairs_found(swarm, reaches_m) == all_pairs(swarm, reaches_m)


@pytest.mark.parametrize("boundary", ["walls", "torus"])
def test_near_pairs_of_many_moving_robots_are_found_tick_by_tick(boundary):
    rng = np.random.default_rng(1)
    position = rng.uniform([-4.0, -3.0], [4.0, 3.0], (200, 2))
    reach_m = rng.choice([0.02, 0.3], 200)
    finder = NearPairs(stand(*position, boundary=boundary).static, reach_m)
    for _ in range(5):
        position = rolled(position + rng.normal(0.0, 0.2, position.shape))
        swarm = stand(*position, boundary=boundary)
        assert pairs_found(swarm, reach_m, finder) == all_pairs(swarm, reach_m)


@pytest.mark.parametrize("x", [-4.0, -3.0, -1.0, 0.0])
def test_half_a_torus_apart_is_one_pair_not_two(x):
    half = stand((x, 1.0), (x + 4.0, 1.0), boundary="torus")
    assert pairs_found(half, np.full(2, 2.5)) == [(0, 1)]


def test_robots_far_outside_an_open_arena_are_found():
    swarm = stand((0.0, 0.0), (900.0, -500.0), (900.1, -500.0), (-7.0, 2.0), boundary="open")
    assert pairs_found(swarm, np.full(4, 0.1)) == [(1, 2)]


def test_near_pairs_are_shared_within_a_tick_only_for_equal_reaches():
    swarm = stand((0.0, 0.0), (1.0, 0.0))
    wide, as_wide, narrow = (NearPairs(swarm.static, np.full(2, reach_m)) for reach_m in (0.6, 0.6, 0.4))
    view = TickView(swarm.static, swarm.truth())
    assert as_wide.find(view) is wide.find(view)
    assert (len(wide.find(view)), len(narrow.find(view))) == (1, 0)
    assert wide.find(TickView(swarm.static, swarm.truth(1))) is not wide.find(view)


def mean_nearest_m(swarm):
    values = []
    for pose, _ in swarm.arenas:
        apart_m = swarm.apart_m(pose)
        np.fill_diagonal(apart_m, np.inf)
        values.append(apart_m.min(axis=1).mean() if len(pose) > 1 else np.nan)
    return values


@settings(max_examples=150)
@given(swarms(least=9, most=40))
def test_nearest_neighbour_is_that_of_all_pairs(swarm):
    assert measure("nearest_neighbour", swarm) == pytest.approx(mean_nearest_m(swarm), abs=1e-12, nan_ok=True)


@pytest.mark.parametrize("boundary", ["walls", "torus"])
def test_neighbours_of_the_tick_before_change_nothing(boundary):
    rng = np.random.default_rng(1)
    metrics = Metrics(["nearest_neighbour"])
    metrics.begin(stand(*np.zeros((150, 2)), boundary=boundary).static)
    for tick in range(5):
        swarm = stand(*rng.uniform([-4.0, -3.0], [4.0, 3.0], (150, 2)), boundary=boundary)
        metrics.see(swarm.truth(tick))
        assert metrics.latest["nearest_neighbour"].tolist() == pytest.approx(mean_nearest_m(swarm), abs=1e-12)


def test_nearest_neighbour_in_a_triangular_lattice_is_its_spacing():
    lattice = [(x + 0.5 * (row % 2) - 4.0, 0.75 * row - 3.0) for row in range(8) for x in range(8)]
    assert measure("nearest_neighbour", stand(*lattice, boundary="torus")) == [pytest.approx(np.hypot(0.5, 0.75))]
    corners = (-3.9, 0.0), (3.9, 2.9), (3.9, -2.9)
    assert measure("nearest_neighbour", stand(*corners)) == [pytest.approx((5.8 * 2 + np.hypot(7.8, 2.9)) / 3)]
    across = measure("nearest_neighbour", stand(*corners, boundary="torus"))
    assert across == [pytest.approx((0.2 * 2 + np.hypot(0.2, 2.9)) / 3)]


def test_robots_at_random_have_the_known_mean():
    """sqrt(A) / 2 x Gamma(N) / Gamma(N + 1/2), near 1 / (2 sqrt(n)), with a variance near (4 - pi) / (4 pi n).

    5 standard errors of 100 x 48 robots, their square doubled since neighbours share distances: false alarm below 6e-7.
    """
    arenas, robots = 100, 48
    position = np.random.default_rng(1).uniform([-4.0, -3.0], [4.0, 3.0], (arenas * robots, 2))
    nearest_m = np.array(measure("nearest_neighbour", stand(*position, boundary="torus", arenas=arenas)))
    exact = 0.5 * np.sqrt(48.0) * np.exp(lgamma(robots) - lgamma(robots + 0.5))
    error = np.sqrt((4.0 - np.pi) / (4.0 * np.pi * robots / 48.0) / (arenas * robots) * 2.0)
    assert nearest_m.mean() == pytest.approx(exact, abs=5.0 * error)


SPANS = (0.0, 0.1), (0.05, 0.3), (0.1, 0.4), (1.0, 1.05)  # the first and third meet, and do not overlap
places = st.tuples(st.floats(-4, 4), st.floats(-3, 3), st.sampled_from([0.035, 0.085, 0.2]), st.sampled_from(SPANS))


@given(st.lists(places, min_size=2, max_size=20))
@example([(0.0, 0.0, 0.1, (0.0, 1.0)), (0.5, 0.0, 0.05, (0.0, 1.0)), (1.0, 0.0, 0.8, (0.0, 1.0))])  # far, but large
def test_smallest_gap_of_different_bodies_is_that_of_all_pairs(robots):
    x, y, radius = np.array([robot[:3] for robot in robots]).T
    span = np.array([robot[3] for robot in robots])
    pairs = [
        np.hypot(x[i] - x[j], y[i] - y[j]) - radius[i] - radius[j]
        for i in range(len(robots))
        for j in range(i)
        if max(span[i, 0], span[j, 0]) < min(span[i, 1], span[j, 1])
    ]
    pose, alive, order = np.stack([x, y, 0 * x], 1), np.ones(len(x), np.bool_), np.arange(len(x))[None]
    nearest = min(pairs, default=np.nan)
    (gap_m,) = smallest_gap_m(pose, radius, span, alive, order).tolist()
    assert gap_m == pytest.approx(nearest, abs=1e-12, nan_ok=True)


def test_drone_above_a_robot_is_not_near_it():
    run = static(2)
    (flock,) = run.groups
    drone = replace(flock, name="air", body=replace(flock.body, altitude_m=1.0), start=2, stop=4)
    both = replace(run, groups=(flock, drone), robot_names=(*run.robot_names, "air-0", "air-1"))
    pose = np.zeros((4, 3))
    pose[:, :2] = (0, 0), (2, 0), (0, 0), (1, 0)
    assert measured("min_gap", both, truth(both, pose=pose)) == [pytest.approx(0.93)]
    alone = np.array([True, False, True, False])
    assert np.isnan(measured("min_gap", both, truth(both, pose=pose, alive=alone))).all()


def test_gap_does_not_depend_on_the_order_of_the_tick_before():
    run, rng = static(30, arenas=2), np.random.default_rng(1)
    metrics = Metrics(["min_gap"])
    metrics.begin(run)
    for tick in range(20):
        moved = truth(run, tick, pose=rng.uniform(-2.0, 2.0, (60, 3)), alive=rng.random(60) < 0.8)
        metrics.see(moved)
        assert metrics.latest["min_gap"].tolist() == measured("min_gap", run, moved)


def rate_per_h(run, onsets, alive):
    """`onsets` (ticks, arenas), `alive` (ticks, rows)."""
    ticks = [
        truth(run, tick, contact_onsets=np.column_stack([now, 7 + 0 * now]), alive=living)
        for tick, (now, living) in enumerate(zip(onsets, alive, strict=True))
    ]
    return last_values("collision_rate", *ticks, run=run)


@given(st.integers(0, 1000), st.integers(1, 20), st.sampled_from([0.0, 0.1, 0.9]))
def test_collision_rate_is_twice_the_onsets_over_living_robot_time(seed, ticks, dead):
    rng, run = np.random.default_rng(seed), static(3, arenas=2)
    onsets, alive = rng.integers(0, 3, (ticks, 2)), rng.random((ticks, 6)) >= dead
    alive[:, 3:] &= rng.random() < 0.8
    values = []
    for arena in range(2):
        robot_h = sum(np.count_nonzero(tick[3 * arena : 3 * arena + 3]) / run.rate_hz / 3600 for tick in alive)
        values.append(2 * sum(tick[arena] for tick in onsets) / robot_h if robot_h else np.nan)
    assert rate_per_h(run, onsets, alive) == pytest.approx(values, nan_ok=True)


def test_robots_that_heed_nobody_collide_at_the_rate_of_the_kinetic_theory():
    """(8 / pi) n D v (N - 1) / N. Onsets are nearly Poisson: 5 standard errors, false alarm 6e-7.

    Straight paths on a torus; a chord shorter than a tick's way is missed, and takes less than 1 % away.
    """
    robots, arenas, ticks, side_m, diameter_m, speed_mps = 60, 6, 400, 4.0, 0.07, 0.1
    rng, run = np.random.default_rng(1), static(robots, arenas=arenas)
    position = rng.uniform(0.0, side_m, (arenas, robots, 2))
    heading = rng.uniform(-np.pi, np.pi, (arenas, robots))
    step = speed_mps / run.rate_hz * np.stack([np.cos(heading), np.sin(heading)], axis=-1)
    i, j = np.triu_indices(robots, 1)
    away, closing = position[:, i] - position[:, j], step[:, i] - step[:, j]
    touching, onsets = [], []
    for tick in range(ticks + 1):
        now = away + tick * closing
        now -= side_m * np.round(now / side_m)
        touching.append((now**2).sum(axis=-1) < diameter_m**2)
        onsets.append(np.count_nonzero(touching[-1] & ~touching[-2], axis=1) if tick else None)
    rates = np.array(rate_per_h(run, onsets[1:], np.ones((ticks, arenas * robots), np.bool_)))
    exact = 8 / np.pi * robots / side_m**2 * diameter_m * speed_mps * (robots - 1) / robots * 3600
    assert exact == pytest.approx(237, abs=1)
    expected_onsets = exact * arenas * robots * ticks / run.rate_hz / 3600 / 2
    assert rates.mean() == pytest.approx(exact, rel=5 / np.sqrt(expected_onsets))


WINDOW = Deadlocked(window_s=1.0, moved_m=0.05, told_m=0.05)  # of ten ticks


def after(position, command, alive=None, boundary="walls", arenas=1):
    """What is told at the last of ticks with places (ticks, rows, 2) and commands (ticks, rows, 3)."""
    alive = np.ones(np.shape(position)[:2], np.bool_) if alive is None else alive
    swarms = [
        replace(stand(*at, boundary=boundary, arenas=arenas), alive=a) for at, a in zip(position, alive, strict=True)
    ]
    ticks = [swarm.truth(tick, command=command[tick]) for tick, swarm in enumerate(swarms)]
    return last_values(WINDOW, *ticks, run=swarms[0].static)


def path(step_m, ticks=11, start=(0.0, 0.0)):
    return np.array(start) + np.arange(ticks)[:, None] * np.array(step_m)


def robots(*one):
    """Paths or commands of robots, (ticks, robots, …)."""
    return np.stack(one, axis=1)


AHEAD, TURN, ASIDE = np.tile([0.1, 0, 0], (11, 1)), np.tile([0, 1.0, 0], (11, 1)), np.tile([0, 0, -0.1], (11, 1))


def test_deadlocked_robot_is_one_that_drives_without_moving():
    still, driven = path((0, 0)), path((0.01, 0))
    assert after(robots(still, driven, still, still, still), robots(AHEAD, AHEAD, TURN, TURN, ASIDE)) == [0.4]


@settings(max_examples=50)
@given(st.integers(0, 1000), st.integers(2, 30), st.sampled_from(["walls", "torus"]))
def test_deadlocked_robots_are_those_of_the_definition(seed, ticks, boundary):
    rng, window = np.random.default_rng(seed), 10
    position = rolled(np.cumsum(rng.normal(0.0, 0.02, (ticks, 6, 2)), axis=0) + rng.uniform(-4, 4, (1, 6, 2)))
    command = rng.normal(0.0, 0.06, (ticks, 6, 3)) * (rng.random((1, 6, 1)) < 0.7)
    alive = rng.random((ticks, 6)) < rng.choice([1.0, 0.8, 0.2])
    values = []
    for own in (slice(0, 3), slice(3, 6)):
        stuck, then = 0, ticks - 1 - window
        for robot in np.arange(6)[own]:
            if then < 0 or not alive[-1, robot]:
                continue
            told_m = sum(np.hypot(*command[k, robot, [0, 2]]) * 0.1 for k in range(then, ticks - 1) if alive[k, robot])
            away = stand((0, 0), boundary=boundary).shortest(position[-1, robot] - position[then, robot])
            stuck += told_m >= 0.05 and np.hypot(*away) < 0.05
        living = np.count_nonzero(alive[-1, own])
        values.append(stuck / living if living and then >= 0 else np.nan)
    shares = after(position, command, alive=alive, boundary=boundary, arenas=2)
    assert shares == pytest.approx(values, nan_ok=True)
