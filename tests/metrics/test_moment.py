"""A moment gives a metric's author a row per arena and a column per robot."""

import numpy as np

from swarmwire.metrics.moment import Components, Moment, agreement
from tests.metrics.truths import edges, static, truth


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
    x, y = np.array([3.0, 1.0, 0.0]), np.array([4.0, 0.0, 0.0])
    assert agreement(x, y, np.array([5.0, 2.0, 1.0]), np.array([5, 2, 0])).tolist()[:2] == [1.0, 0.5]
