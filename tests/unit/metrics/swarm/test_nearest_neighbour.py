from math import lgamma

import numpy as np
import pytest
from hypothesis import given, settings

from swarmwire.metrics.metrics import Metrics
from tests.support.metrics.swarm.swarms import said, stand, swarms


def mean_nearest_m(swarm):
    values = []
    for pose, _ in swarm.arenas:
        apart_m = swarm.apart_m(pose)
        np.fill_diagonal(apart_m, np.inf)
        values.append(apart_m.min(axis=1).mean() if len(pose) > 1 else np.nan)
    return values


@given(swarms())
def test_it_is_that_of_all_pairs(swarm):
    assert said("nearest_neighbour", swarm) == pytest.approx(mean_nearest_m(swarm), abs=1e-12, nan_ok=True)


@settings(max_examples=300)
@given(swarms(least=9, most=40))
def test_it_is_that_of_all_pairs_of_more_robots(swarm):
    assert said("nearest_neighbour", swarm) == pytest.approx(mean_nearest_m(swarm), abs=1e-12, nan_ok=True)


@pytest.mark.parametrize("boundary", ["walls", "torus"])
def test_what_it_remembers_of_the_tick_before_changes_nothing(boundary):
    rng = np.random.default_rng(1)
    metrics = Metrics(["nearest_neighbour"])
    metrics.begin(stand(*np.zeros((150, 2)), boundary=boundary).of)
    for tick in range(5):
        swarm = stand(*rng.uniform([-4.0, -3.0], [4.0, 3.0], (150, 2)), boundary=boundary)
        metrics.see(swarm.seen(tick))
        assert metrics.latest["nearest_neighbour"].tolist() == pytest.approx(mean_nearest_m(swarm), abs=1e-12)


def test_a_lattice_of_triangles_has_its_spacing_and_a_torus_goes_on():
    lattice = [(x + 0.5 * (row % 2) - 4.0, 0.75 * row - 3.0) for row in range(8) for x in range(8)]
    assert said("nearest_neighbour", stand(*lattice, boundary="torus")) == [pytest.approx(np.hypot(0.5, 0.75))]
    corners = (-3.9, 0.0), (3.9, 2.9), (3.9, -2.9)
    assert said("nearest_neighbour", stand(*corners)) == [pytest.approx((5.8 * 2 + np.hypot(7.8, 2.9)) / 3)]
    across = said("nearest_neighbour", stand(*corners, boundary="torus"))
    assert across == [pytest.approx((0.2 * 2 + np.hypot(0.2, 2.9)) / 3)]


def test_robots_at_random_have_the_known_mean():
    """sqrt(A) / 2 x Gamma(N) / Gamma(N + 1/2), near 1 / (2 sqrt(n)), with a variance near (4 - pi) / (4 pi n).

    5 standard errors of 100 x 48 robots, their square doubled since neighbours share distances: false alarm below 6e-7.
    """
    arenas, robots = 100, 48
    place = np.random.default_rng(1).uniform([-4.0, -3.0], [4.0, 3.0], (arenas * robots, 2))
    found = np.array(said("nearest_neighbour", stand(*place, boundary="torus", arenas=arenas)))
    exact = 0.5 * np.sqrt(48.0) * np.exp(lgamma(robots) - lgamma(robots + 0.5))
    error = np.sqrt((4.0 - np.pi) / (4.0 * np.pi * robots / 48.0) / (arenas * robots) * 2.0)
    assert found.mean() == pytest.approx(exact, abs=5.0 * error)
