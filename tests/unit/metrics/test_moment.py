"""A moment gives a metric's author a row per arena and a column per robot."""

import numpy as np
import pytest

from swarmwire.metrics.moment import Components, Moment, agreement
from tests.support.metrics.truths import edges, poses, static, truth


def test_rows_are_folded_by_arena():
    of = static(3, arenas=2)
    pose, velocity = np.arange(36.0).reshape(2, 6, 3)
    alive = np.array([True, True, False, True, False, False])
    moment = Moment(of, truth(of, pose=pose, velocity=velocity, alive=alive))
    assert (moment.position_m[1, 2] == pose[5, :2]).all()
    assert (moment.velocity[1, 2, :2] == velocity[5, :2]).all()
    assert moment.heading_rad[0, 1] == pose[1, 2]
    assert moment.robots_alive.tolist() == moment.sum_alive(np.ones((2, 3))).tolist() == [2, 1]
    assert moment.components is None


def test_components_are_those_of_the_robots_alive():
    of = static(3, arenas=2)
    alive = np.array([True, True, True, True, True, False])
    found = Moment(of, truth(of, alive=alive, edges=edges((0, 1), (1, 2), (4, 5)))).components
    assert isinstance(found, Components)
    assert found.pieces.tolist() == [1, 2]
    assert found.largest.tolist() == [3, 1]


def test_vectors_agree_by_how_near_their_sum_comes_to_the_most():
    x = np.array([[3.0, 3.0, 9.0], [1.0, 1.0, -1.0], [1.0, 1.0, 1.0], [0.0, 0.0, 0.0]])
    y = np.array([[4.0, 4.0, 9.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    alive = np.array([[1, 1, 0], [1, 1, 1], [0, 0, 0], [1, 1, 1]], np.bool_)
    assert agreement(x, y, alive, True)[[0, 1, 3]].tolist() == [1.0, pytest.approx(1 / 3), 0.0]
    assert agreement(x / 5, y / 5, alive, False)[[0, 1]].tolist() == [pytest.approx(1.0), pytest.approx(1 / 15)]
    assert np.isnan(agreement(x, y, alive, True)[2])


def test_directions_are_the_cosines_and_sines_of_headings():
    of = static(3, arenas=2)
    moment = Moment(of, truth(of, pose=poses([0.3, -2.0, 9.0, 0.0, 3.1, -0.1])))
    np.testing.assert_allclose(moment.direction[0], np.cos(moment.heading_rad))
    np.testing.assert_allclose(moment.direction[1], np.sin(moment.heading_rad))
