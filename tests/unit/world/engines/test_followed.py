"""Robots that a source moves, in every engine: they go where it says, and others give way."""

import numpy as np
import pytest

from swarmwire.world.engines.engine import Engine
from tests.support.world.engines.conformance import EVERY, FLOOR, TICK_S, Make, R, build_engine, targets


def end_states(engine: Engine, pose: list[list[float]]) -> np.ndarray:
    """States at the end of the next tick of followed robots at pose (k, 3), of which the engine has the first k."""
    end = np.zeros((len(engine.state), len(pose), 6))
    end[:, :, :3] = pose
    end[:, :, 3:] = (end[:, :, :3] - engine.state[:, : len(pose), :3]) / TICK_S
    return end


@pytest.mark.parametrize("make", EVERY)
def test_followed_robot_is_exactly_at_its_pose_after_each_tick(make: Make) -> None:
    engine = build_engine(make, [[0.0, 0.0, 0.0], [1.0, 1.0, 0.0]], followed=[True, False])
    for pose in ([0.01, 0.02, 0.1], [0.37, 0.11, 3.3], [0.37, 0.11, 3.3]):
        end = end_states(engine, [pose])
        engine.follow(end)
        engine.tick(targets(engine))
        assert np.array_equal(engine.state[:, :1], end)
        assert engine.state[0, 1, :2] == pytest.approx([1.0, 1.0])


@pytest.mark.parametrize("make", EVERY)
def test_followed_robot_adds_its_way_to_the_travel_of_its_wheels(make: Make) -> None:
    engine = build_engine(make, [[0.0, 0.0, np.pi / 2]], followed=[True], wheel_base_m=0.2)
    for k in range(1, 11):
        engine.follow(end_states(engine, [[0.0, 0.05 * k, np.pi / 2]]))
        engine.tick(targets(engine))
    assert engine.travel_m[0, 0] == pytest.approx([0.5, 0.5])
    engine.follow(end_states(engine, [[0.0, 0.5, np.pi / 2 + 0.3]]))
    engine.tick(targets(engine))
    assert engine.travel_m[0, 0] == pytest.approx([0.5 - 0.03, 0.5 + 0.03])  # half the base, 0.1 m, times 0.3 rad


@pytest.mark.parametrize("make", FLOOR)
def test_followed_robot_pushes_another_one_ahead_of_itself(make: Make) -> None:
    engine = build_engine(make, [[-0.5, 0.0, 0.0], [0.0, 0.0, 0.0]], followed=[True, False])
    onsets = 0
    for k in range(1, 21):
        engine.follow(end_states(engine, [[-0.5 + 0.05 * k, 0.0, 0.0]]))
        onsets += engine.tick(targets(engine))[0, 0]
    assert engine.state[0, 0, 0] == pytest.approx(0.5)
    assert engine.state[0, 1, 0] > 0.5 + 2 * R - 0.1 * R
    assert engine.state[0, 1, 0] < 0.5 + 2 * R + 0.05
    assert onsets >= 1


@pytest.mark.parametrize("make", FLOOR)
def test_followed_robot_that_stands_stops_one_that_drives_against_it(make: Make) -> None:
    engine = build_engine(make, [[0.5, 0.0, 0.0], [0.0, 0.0, 0.0]], followed=[True, False])
    for _ in range(40):
        engine.follow(end_states(engine, [[0.5, 0.0, 0.0]]))
        engine.tick(targets(engine, forward_mps=[0.0, 0.3]))
    assert np.array_equal(engine.state[0, 0, :3], [0.5, 0.0, 0.0])
    assert engine.state[0, 1, 0] == pytest.approx(0.5 - 2 * R, abs=0.1 * R)


@pytest.mark.parametrize("make", EVERY)
def test_followed_robots_may_overlap_one_another_and_walls_without_a_contact(make: Make) -> None:
    engine = build_engine(make, [[0.0, 0.0, 0.0], [0.5, 0.0, 0.0], [0.0, 1.5, 0.0]], followed=[True, True, False])
    engine.follow(end_states(engine, [[1.95, 0.0, 0.0], [1.95, 0.05, 0.0]]))
    onsets = engine.tick(targets(engine))
    assert onsets.tolist() == [[0, 0]]
    assert engine.state[0, :2, :2].tolist() == [[1.95, 0.0], [1.95, 0.05]]


@pytest.mark.parametrize("make", EVERY)
def test_followed_robots_move_in_running_arenas_alone(make: Make) -> None:
    pose = np.zeros((2, 1, 3))
    engine = build_engine(make, pose, followed=[True])
    engine.leave(np.array([True, False]))
    engine.follow(end_states(engine, [[0.1, 0.0, 0.0]]))
    engine.tick(targets(engine))
    assert engine.state[:, 0, 0].tolist() == [0.0, 0.1]
