from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.metrics.metrics import Metrics
from swarmwire.metrics.swarm.min_gap import smallest_gap_m
from tests.support.metrics.truths import measured, static, truth

SPANS = (0.0, 0.1), (0.05, 0.3), (0.1, 0.4), (1.0, 1.05)  # the first and third meet, and do not overlap
places = st.tuples(st.floats(-4, 4), st.floats(-3, 3), st.sampled_from([0.035, 0.085, 0.2]), st.sampled_from(SPANS))


def gap(*at, arenas=1, **fields):
    of = static(len(at) // arenas, arenas=arenas)
    pose = np.zeros((len(at), 3))
    pose[:, :2] = at
    return measured("min_gap", of, truth(of, pose=pose, **fields))


def test_it_is_from_surface_to_surface():
    assert gap((0, 0), (3, 4), (0.3, 0.4)) == [pytest.approx(0.5 - 0.07)]


def test_dead_robots_have_no_gap():
    at = (0, 0), (0.1, 0), (1, 0)
    assert gap(*at, alive=np.array([True, False, True])) == [pytest.approx(1.0 - 0.07)]
    assert np.isnan(gap(*at, alive=np.array([True, False, False]))).all()
    assert np.isnan(gap(*at, alive=np.zeros(3, np.bool_))).all()


def test_robots_of_different_arenas_have_no_gap():
    assert gap((0, 0), (1, 0), (0, 0), (2, 0), arenas=2) == [pytest.approx(0.93), pytest.approx(1.93)]


@given(st.lists(places, min_size=2, max_size=20))
def test_it_is_that_of_all_pairs_also_of_different_bodies(robots):
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
    (told,) = smallest_gap_m(pose, radius, span, alive, order).tolist()
    assert told == pytest.approx(nearest, abs=1e-12, nan_ok=True)


def test_a_drone_above_a_robot_is_not_near_it():
    of = static(2)
    (flock,) = of.groups
    drone = replace(flock, name="air", body=replace(flock.body, altitude_m=1.0), start=2, stop=4)
    both = replace(of, groups=(flock, drone), robot_names=(*of.robot_names, "air-0", "air-1"))
    pose = np.zeros((4, 3))
    pose[:, :2] = (0, 0), (2, 0), (0, 0), (1, 0)
    assert measured("min_gap", both, truth(both, pose=pose)) == [pytest.approx(0.93)]
    alone = np.array([True, False, True, False])
    assert np.isnan(measured("min_gap", both, truth(both, pose=pose, alive=alone))).all()


def test_what_it_remembers_of_the_tick_before_changes_nothing():
    of, rng = static(30, arenas=2), np.random.default_rng(1)
    metrics = Metrics(["min_gap"])
    metrics.begin(of)
    for tick in range(20):
        seen = truth(of, tick, pose=rng.uniform(-2.0, 2.0, (60, 3)), alive=rng.random(60) < 0.8)
        metrics.see(seen)
        assert metrics.latest["min_gap"].tolist() == measured("min_gap", of, seen)
