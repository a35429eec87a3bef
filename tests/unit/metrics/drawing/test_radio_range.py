import numpy as np
import pytest

from swarmwire.comms.geometry.obstacles import is_blocked, obstacle_arrays
from swarmwire.comms.truth import Obstacle
from swarmwire.metrics.drawing.radio_range import in_range
from tests.support.metrics.films import OBSTACLES


def test_pairs_are_of_those_alive_that_are_near_enough():
    position_m = np.array([[0.0, 0.0], [1.0, 0.0], [2.5, 0.0], [0.0, 1.0]])
    alive = np.array([True, True, True, False])
    assert in_range(position_m, alive, 1.5, ()).tolist() == [[0, 1], [1, 2]]
    assert in_range(position_m, alive, 1.4, ()).tolist() == [[0, 1]]
    assert in_range(position_m, ~alive, 9.0, ()).tolist() == []
    assert in_range(position_m, np.zeros(4, np.bool_), 9.0, ()).tolist() == []


@pytest.mark.parametrize("obstacle", OBSTACLES, ids=lambda obstacle: obstacle.shape)
def test_obstacles_are_in_the_way_as_they_are_in_the_air(obstacle: Obstacle):
    centre = np.array([obstacle.x_m, obstacle.y_m])
    position_m = centre + np.random.default_rng(4).uniform(-1.0, 1.0, (60, 2))
    kernel = obstacle_arrays(((obstacle,),))
    expected = {
        (i, j) for i in range(60) for j in range(i + 1, 60) if not is_blocked(kernel, 0, *position_m[i], *position_m[j])
    }
    found = in_range(position_m, np.ones(60, np.bool_), 9.0, (obstacle,))
    assert {(min(pair), max(pair)) for pair in found.tolist()} == expected
    assert 0 < len(expected) < 60 * 59 / 2
