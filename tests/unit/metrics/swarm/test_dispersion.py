from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.support.metrics.swarm.centroids import away_m
from tests.support.metrics.swarm.swarms import mixed, moved, said, stand, swarms

RADIUS_M = stand((0, 0)).of.groups[0].body.radius_m


def hexagon(rings, apart_m):
    """A hexagonal packing of so many rings around one robot."""
    cells = range(-rings, rings + 1)
    return [((q + 0.5 * r) * apart_m, 0.75**0.5 * r * apart_m) for q in cells for r in cells if abs(q + r) <= rings]


@given(swarms())
def test_it_is_that_of_the_formula(swarm):
    values = [
        np.sum(away_m(swarm, pose) ** 2) / (4.0 * np.mean(radius_m**2)) if len(pose) else np.nan
        for pose, radius_m in swarm.arenas
    ]
    assert said("dispersion", swarm) == pytest.approx(values, rel=1e-6, abs=1e-9, nan_ok=True)


@pytest.mark.parametrize(("rings", "least"), [(0, 0.0), (1, 6.0), (2, 48.0), (3, 186.0)])
def test_a_hexagonal_packing_has_its_known_second_moment(rings, least):
    """Squares of distances in diameters: 6 x 1, then 6 x 4 + 6 x 3, then 6 x 9 + 12 x 7."""
    packed = stand(*hexagon(rings, 2.0 * RADIUS_M))
    assert said("dispersion", packed) == [pytest.approx(least, abs=1e-12)]
    assert said("dispersion", stand(*hexagon(rings, 4.0 * RADIUS_M))) == [pytest.approx(4.0 * least, abs=1e-12)]


@given(st.floats(-3, 3), st.floats(-np.pi, np.pi))
def test_turning_and_moving_all_changes_nothing(by_m, turn_rad):
    swarm = stand(*np.random.default_rng(2).uniform(-2.0, 2.0, (10, 3)), boundary="open")
    same = moved(swarm, (by_m, -by_m), turn_rad)
    for name in ("dispersion", "cohesion", "rotation", "nearest_neighbour", "aggregation"):
        assert said(name, same) == pytest.approx(said(name, swarm), rel=1e-9, abs=1e-12)


def test_of_mixed_bodies_the_radius_squared_is_the_mean_of_those_alive():
    two = stand((0, 0), (1, 0), (0.5, 0))
    both = replace(two, of=mixed(two.of, 1), alive=np.array([True, True, False]))
    small_m, large_m = (group.body.radius_m for group in both.of.groups)
    assert said("dispersion", both) == [pytest.approx(0.5 / (2.0 * (small_m**2 + large_m**2)))]
