"""Order of headings, of neighbours' headings and of velocities: known values, and their formulas."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.metrics.swarm.order import OrderLocal
from tests.support.metrics.swarms import said, stand, swarms
from tests.support.metrics.truths import measured, poses, static, truth


@pytest.mark.parametrize(
    ("heading_rad", "exact"),
    [([0.7] * 9, 1.0), ([0.3, 0.3 + np.pi, -1.0, -1.0 - np.pi], 0.0), ([0.0, np.pi / 2], np.sqrt(0.5))],
)
def test_headings_that_agree_cancel_or_stand_at_a_right_angle_have_the_known_order(heading_rad, exact):
    of = static(len(heading_rad))
    assert measured("order", of, truth(of, pose=poses(heading_rad))) == [pytest.approx(exact, abs=1e-15)]


@pytest.mark.parametrize(("robots", "exact"), [(5, 0.402), (10, 0.282), (40, 0.1404), (100, 0.0887), (400, 0.0445)])
def test_headings_at_random_have_the_known_mean_order(robots, exact):
    """E[order^2] = 1/N gives a variance below 0.22/N; 5 standard errors of 2000 samples: false alarm 6e-7."""
    samples = 2000
    of = static(robots, arenas=samples)
    heading_rad = np.random.default_rng(1).uniform(-np.pi, np.pi, samples * robots)
    found = np.array(measured("order", of, truth(of, pose=poses(heading_rad))))
    tolerance = 5 * np.sqrt(0.22 / robots / samples) + 0.0005  # and the rounding of the table
    assert found.mean() == pytest.approx(exact, abs=tolerance)
    assert np.square(found).mean() == pytest.approx(1 / robots, rel=5 / np.sqrt(samples))


ranges = st.sampled_from([0.1, 1.0, 3.5])


@given(swarms(), ranges)
def test_local_order_is_that_of_the_formula(swarm, range_m):
    values = []
    for pose, _ in swarm.arenas:
        near = swarm.apart_m(pose) < range_m
        means = []
        for i in range(len(pose)):
            others = [j for j in range(len(pose)) if j != i and near[i, j]]
            means.append(np.mean([np.cos(pose[i, 2] - pose[j, 2]) for j in others]) if others else 1.0)
        values.append(np.mean(means) if means else np.nan)
    assert said(OrderLocal(range_m=range_m), swarm) == pytest.approx(values, abs=1e-12, nan_ok=True)


def test_groups_that_agree_each_within_itself_are_ordered_however_they_differ():
    groups = stand((0, 0, 0), (0.1, 0, 0), (3, 0, np.pi), (3.1, 0, np.pi))
    assert said("order_local", groups) == [pytest.approx(1.0)]
    assert said("order", groups) == [pytest.approx(0.0, abs=1e-15)]


def test_opposite_neighbours_count_minus_one_and_a_robot_alone_one():
    assert said("order_local", stand((0, 0, 0), (0.1, 0, np.pi))) == [pytest.approx(-1.0)]
    assert said("order_local", stand((0, 0, 0), (0.1, 0, np.pi), (3, 0, 0))) == [pytest.approx(-1 / 3)]


def test_headings_at_random_have_no_local_order():
    """A mean of 400 x 190 cosines of pairs, variance 1/2 each and uncorrelated: 5 standard errors, false alarm 6e-7."""
    rng, arenas, robots = np.random.default_rng(1), 400, 20
    pose = np.column_stack([np.zeros((arenas * robots, 2)), rng.uniform(-np.pi, np.pi, arenas * robots)])
    found = np.array(said("order_local", stand(*pose, arenas=arenas)))
    assert found.mean() == pytest.approx(0.0, abs=5 * np.sqrt(0.5 / (arenas * robots * (robots - 1) / 2)))


def order_of_velocities(*velocity):
    of = static(len(velocity))
    table = np.zeros((len(velocity), 3))
    table[:, :2] = velocity
    return measured("order_velocity", of, truth(of, velocity=table))[0]


def test_robots_count_by_their_speed():
    assert order_of_velocities((0.1, 0.1), (0.2, 0.2), (0.0, 0.0)) == pytest.approx(1.0)
    assert order_of_velocities((0.3, 0.0), (-0.1, 0.0)) == pytest.approx(0.5)
    assert order_of_velocities((0.1, 0.0), (0.0, 0.1)) == pytest.approx(np.sqrt(0.5))
    assert order_of_velocities((0.0, 0.0), (0.0, 0.0)) == 0.0
