import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.metrics.swarm.order_local import OrderLocal
from tests.support.metrics.swarm.swarms import moved, said, stand, swarms

ranges = st.sampled_from([0.1, 1.0, 3.5])


@given(swarms(), ranges)
def test_it_is_that_of_the_formula(swarm, range_m):
    values = []
    for pose, _ in swarm.arenas:
        near = swarm.apart_m(pose) < range_m
        means = []
        for i in range(len(pose)):
            others = [j for j in range(len(pose)) if j != i and near[i, j]]
            means.append(np.mean([np.cos(pose[i, 2] - pose[j, 2]) for j in others]) if others else 1.0)
        values.append(np.mean(means) if means else np.nan)
    assert said(OrderLocal(range_m=range_m), swarm) == pytest.approx(values, abs=1e-12, nan_ok=True)


@given(swarms(), ranges)
def test_it_is_within_minus_one_and_one(swarm, range_m):
    assert all(np.isnan(value) or -1.0 <= value <= 1.0 for value in said(OrderLocal(range_m=range_m), swarm))


def test_turning_and_moving_all_alike_changes_nothing():
    swarm = stand(*np.random.default_rng(1).uniform(-2.0, 2.0, (20, 3)), boundary="open")
    same = said(OrderLocal(), moved(swarm, (3.0, -40.0), turn_rad=0.7))
    assert same == pytest.approx(said(OrderLocal(), swarm), abs=1e-12)


def test_groups_that_agree_each_within_itself_are_ordered_however_they_differ():
    groups = stand((0, 0, 0), (0.1, 0, 0), (3, 0, np.pi), (3.1, 0, np.pi))
    assert said("order_local", groups) == [pytest.approx(1.0)]
    assert said("order", groups) == [pytest.approx(0.0, abs=1e-15)]


def test_opposite_neighbours_count_minus_one_and_a_robot_alone_one():
    assert said("order_local", stand((0, 0, 0), (0.1, 0, np.pi))) == [pytest.approx(-1.0)]
    assert said("order_local", stand((0, 0, 0), (0.1, 0, np.pi), (3, 0, 0))) == [pytest.approx(-1 / 3)]


def test_headings_at_random_have_none():
    """A mean of 400 x 190 cosines of pairs, variance 1/2 each and uncorrelated: 5 standard errors, false alarm 6e-7."""
    rng, arenas, robots = np.random.default_rng(1), 400, 20
    pose = np.column_stack([np.zeros((arenas * robots, 2)), rng.uniform(-np.pi, np.pi, arenas * robots)])
    found = np.array(said("order_local", stand(*pose, arenas=arenas)))
    assert found.mean() == pytest.approx(0.0, abs=5 * np.sqrt(0.5 / (arenas * robots * (robots - 1) / 2)))
