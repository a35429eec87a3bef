import numpy as np
import pytest
from hypothesis import assume, given

from tests.support.metrics.swarm.centroids import away_m
from tests.support.metrics.swarm.swarms import moved, said, stand, swarms


def ring(robots, heading_offset_rad, at=(0.0, 0.0)):
    angle = np.linspace(0.0, 2.0 * np.pi, robots, endpoint=False)
    return np.column_stack([at[0] + np.cos(angle), at[1] + np.sin(angle), angle + heading_offset_rad])


@given(swarms())
def test_it_is_that_of_the_formula(swarm):
    values = []
    for pose, _ in swarm.arenas:
        away = away_m(swarm, pose) if len(pose) else np.empty((0, 2))
        length_m = np.hypot(*away.T)
        assume(
            not np.any((length_m > 1e-12) & (length_m < 1e-6))
        )  # who is nearly at the centroid is a matter of rounding
        unit = away / np.where(length_m > 1e-12, length_m, np.inf)[:, None]
        crosses = unit[:, 0] * np.sin(pose[:, 2]) - unit[:, 1] * np.cos(pose[:, 2])
        values.append(abs(crosses.sum()) / len(pose) if len(pose) else np.nan)
    assert said("rotation", swarm) == pytest.approx(values, abs=1e-6, nan_ok=True)


@pytest.mark.parametrize("side", [1, -1])
def test_a_ring_that_mills_has_one_either_way_round(side):
    assert said("rotation", stand(*ring(12, side * np.pi / 2, at=(1.0, -0.5)))) == [pytest.approx(1.0)]


def test_a_ring_that_opens_or_goes_one_way_has_none():
    assert said("rotation", stand(*ring(12, 0.0))) == [pytest.approx(0.0, abs=1e-12)]
    one_way = ring(12, 0.0)
    one_way[:, 2] = 0.4
    assert said("rotation", stand(*one_way)) == [pytest.approx(0.0, abs=1e-12)]


def test_a_ring_of_which_half_mills_the_other_way_has_none():
    both = ring(12, np.pi / 2)
    both[::2, 2] += np.pi
    assert said("rotation", stand(*both)) == [pytest.approx(0.0, abs=1e-12)]


def test_a_mill_across_the_corner_of_a_torus_is_one():
    mill = stand(*ring(12, np.pi / 2), boundary="torus")
    assert said("rotation", moved(mill, (4.0, 3.0))) == [pytest.approx(1.0)]


def test_a_robot_at_the_centroid_adds_nothing():
    assert said("rotation", stand((1.0, 1.0, 0.3))) == [0.0]
    assert said("rotation", stand(*ring(4, np.pi / 2), (0.0, 0.0, 1.0))) == [pytest.approx(0.8)]


def test_headings_at_random_have_the_known_mean_square():
    """Crosses are sines at random: the mean of the square is 1 / 2N, its variance below 2 (1 / 2N)^2.

    5 standard errors of 2000 samples: false alarm 6e-7.
    """
    samples, robots, rng = 2000, 10, np.random.default_rng(1)
    pose = np.tile(ring(robots, 0.0), (samples, 1))
    pose[:, 2] = rng.uniform(-np.pi, np.pi, len(pose))
    found = np.array(said("rotation", stand(*pose, arenas=samples)))
    assert np.square(found).mean() == pytest.approx(1 / (2 * robots), rel=5 * np.sqrt(2 / samples))
