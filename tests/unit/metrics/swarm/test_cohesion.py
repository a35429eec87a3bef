import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.support.metrics.swarm.centroids import away_m
from tests.support.metrics.swarm.swarms import moved, said, stand, swarms


@given(swarms())
def test_it_is_the_largest_distance_to_the_centroid(swarm):
    values = [np.hypot(*away_m(swarm, pose).T).max() if len(pose) else np.nan for pose, _ in swarm.arenas]
    assert said("cohesion", swarm) == pytest.approx(values, abs=1e-9, nan_ok=True)


def test_a_ring_has_its_radius_and_one_robot_none():
    angle = np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False)
    ring = stand(*np.column_stack([1.0 + 0.5 * np.cos(angle), 0.5 * np.sin(angle)]))
    assert said("cohesion", ring) == [pytest.approx(0.5)]
    assert said("cohesion", stand((1.0, 2.0))) == [0.0]


@given(
    st.integers(0, 1000), st.floats(-8, 8), st.floats(-6, 6), st.sampled_from(["cohesion", "dispersion", "rotation"])
)
def test_a_swarm_smaller_than_half_a_torus_has_what_it_has_on_a_plane_wherever_it_is(seed, x, y, name):
    pose = np.random.default_rng(seed).uniform(-1.0, 1.0, (9, 3))
    on_torus = moved(stand(*pose, boundary="torus"), (x, y))
    assert said(name, on_torus) == pytest.approx(said(name, stand(*pose, boundary="open")), abs=1e-9)


@pytest.mark.parametrize("name", ["cohesion", "dispersion", "rotation"])
def test_places_spread_evenly_over_a_torus_have_no_centroid(name):
    at = (-4, 0), (-2, 0), (0, 0), (2, 0)
    assert np.isnan(said(name, stand(*at, boundary="torus"))).all()
    assert np.isfinite(said(name, stand(*at))).all()
