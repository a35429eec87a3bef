import numpy as np
import pytest

from swarmwire.comms.truth import Light
from tests.support.metrics.truths import measured, static, truth

LIGHTS = [Light(0.0, 0.0, 1.0), Light(3.0, 0.0, 1.0)]


def targets(lights, *at, arenas=1, **fields):
    of = static(len(at) // arenas, arenas=arenas, lights=lights)
    pose = np.zeros((len(at), 3))
    pose[:, :2] = at
    seen = truth(of, pose=pose, **fields)
    return measured("target_best", of, seen), measured("target_mean", of, seen)


def test_each_robot_counts_to_the_light_nearest_to_it():
    assert targets([LIGHTS], (0.3, 0.4), (3.0, 1.0), (5.0, 0.0)) == ([0.5], [pytest.approx(3.5 / 3)])


def test_only_robots_alive_search():
    alive = np.array([False, True])
    assert targets([LIGHTS], (0.0, 0.0), (3.0, 1.0), alive=alive) == ([1.0], [1.0])
    assert np.isnan(targets([LIGHTS], (0.0, 0.0), alive=np.zeros(1, np.bool_))).all()


def test_arenas_have_lights_of_their_own_or_none():
    best, mean = targets([LIGHTS, [], LIGHTS[1:]], (1.0, 0.0), (1.0, 0.0), (1.0, 0.0), arenas=3)
    for found in (best, mean):
        assert found == pytest.approx([1.0, np.nan, 2.0], nan_ok=True)


def test_without_lights_there_is_no_target():
    assert np.isnan(targets([], (1.0, 0.0), (2.0, 0.0), arenas=2)).all()
