"""How a swarm stands around its centroid: cohesion, dispersion and rotation by their formulas, and known values."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given

from tests.support.metrics.swarms import away_m, mixed, rolled, said, stand, swarms


@given(swarms())
def test_cohesion_is_the_largest_distance_to_the_centroid(swarm):
    values = [np.hypot(*away_m(swarm, pose).T).max() if len(pose) else np.nan for pose, _ in swarm.arenas]
    assert said("cohesion", swarm) == pytest.approx(values, abs=1e-9, nan_ok=True)


def test_a_ring_has_its_radius():
    angle = np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False)
    ring = stand(*np.column_stack([1.0 + 0.5 * np.cos(angle), 0.5 * np.sin(angle)]))
    assert said("cohesion", ring) == [pytest.approx(0.5)]


@pytest.mark.parametrize("name", ["cohesion", "dispersion", "rotation"])
def test_places_spread_evenly_over_a_torus_have_no_centroid(name):
    at = (-4, 0), (-2, 0), (0, 0), (2, 0)
    assert np.isnan(said(name, stand(*at, boundary="torus"))).all()
    assert np.isfinite(said(name, stand(*at))).all()


RADIUS_M = stand((0, 0)).of.groups[0].body.radius_m


def hexagon(rings, apart_m):
    """A hexagonal packing of so many rings around one robot."""
    cells = range(-rings, rings + 1)
    return [((q + 0.5 * r) * apart_m, 0.75**0.5 * r * apart_m) for q in cells for r in cells if abs(q + r) <= rings]


@given(swarms())
def test_dispersion_is_that_of_the_formula(swarm):
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


def test_of_mixed_bodies_the_radius_squared_is_the_mean_of_those_alive():
    two = stand((0, 0), (1, 0), (0.5, 0))
    both = replace(two, of=mixed(two.of, 1), alive=np.array([True, True, False]))
    small_m, large_m = (group.body.radius_m for group in both.of.groups)
    assert said("dispersion", both) == [pytest.approx(0.5 / (2.0 * (small_m**2 + large_m**2)))]


def ring(robots, heading_offset_rad, at=(0.0, 0.0)):
    angle = np.linspace(0.0, 2.0 * np.pi, robots, endpoint=False)
    return np.column_stack([at[0] + np.cos(angle), at[1] + np.sin(angle), angle + heading_offset_rad])


@given(swarms())
def test_rotation_is_that_of_the_formula(swarm):
    values = []
    for pose, _ in swarm.arenas:
        away = away_m(swarm, pose) if len(pose) else np.empty((0, 2))
        length_m = np.hypot(*away.T)
        # Who is nearly at the centroid is a matter of rounding.
        assume(not np.any((length_m > 1e-12) & (length_m < 1e-6)))
        unit = away / np.where(length_m > 1e-12, length_m, np.inf)[:, None]
        crosses = unit[:, 0] * np.sin(pose[:, 2]) - unit[:, 1] * np.cos(pose[:, 2])
        values.append(abs(crosses.sum()) / len(pose) if len(pose) else np.nan)
    assert said("rotation", swarm) == pytest.approx(values, abs=1e-6, nan_ok=True)


HALF_TURNED = np.arange(12) % 2 * np.pi


@pytest.mark.parametrize(
    ("offset_rad", "exact"), [(np.pi / 2, 1.0), (-np.pi / 2, 1.0), (0.0, 0.0), (np.pi / 2 + HALF_TURNED, 0.0)]
)
def test_a_ring_that_mills_either_way_has_one_and_a_ring_that_opens_or_mills_both_ways_none(offset_rad, exact):
    assert said("rotation", stand(*ring(12, offset_rad, at=(1.0, -0.5)))) == [pytest.approx(exact, abs=1e-12)]


def test_a_ring_that_goes_one_way_has_none():
    one_way = ring(12, 0.0)
    one_way[:, 2] = 0.4
    assert said("rotation", stand(*one_way)) == [pytest.approx(0.0, abs=1e-12)]


def test_a_mill_across_the_corner_of_a_torus_is_one():
    mill = ring(12, np.pi / 2, at=(4.0, 3.0))
    mill[:, :2] = rolled(mill[:, :2])
    assert said("rotation", stand(*mill, boundary="torus")) == [pytest.approx(1.0)]


def test_a_robot_at_the_centroid_adds_nothing():
    assert said("rotation", stand((1.0, 1.0, 0.3))) == [0.0]
    assert said("rotation", stand(*ring(4, np.pi / 2), (0.0, 0.0, 1.0))) == [pytest.approx(0.8)]
