"""Noisy wheels run at f (w + b): b once for each wheel, f for each wheel and tick, and truth keeps the command."""

from typing import Any

import numpy as np
import pytest

from swarmwire.comms.bodies.body import body_from
from swarmwire.comms.bodies.drives import twist_of_wheels, wheels_of_twist
from swarmwire.comms.draws import derive_key
from swarmwire.comms.tick_io import Actions
from swarmwire.comms.truth import Group
from swarmwire.world.actuation.actuators import Actuators
from swarmwire.world.world import World
from tests.support.world.samples import commanded, posed

BASE_M = 0.053  # the e-puck's
ROBOTS = 2000
KEYS = np.array([derive_key("arena", seed) for seed in (4, 5)], np.uint64)


def noisy(robots: int = ROBOTS, keys: Any = KEYS, **noise: float) -> Actuators:
    body = body_from({"like": "epuck", "name": "noisy", "drive": {"noise": noise}}, "noisy.toml")
    return Actuators([Group("a", body, 0, robots)], keys)


def wheels_of(actuators: Actuators, left_mps: float, right_mps: float) -> Any:
    """What the wheels run at in the next tick, (arenas, robots, 2)."""
    rows = np.arange(len(actuators.command))
    ahead_mps, turn_radps = twist_of_wheels(left_mps, right_mps, BASE_M)
    command = np.full(len(rows), ahead_mps), np.full(len(rows), turn_radps), np.zeros(len(rows))
    actuators.take(Actions(rows, np.ones(len(rows), np.bool_), *command), np.ones(len(rows), np.bool_))
    assert not actuators.target[..., 2].any()
    return np.stack(wheels_of_twist(actuators.target[..., 0], actuators.target[..., 1], BASE_M), axis=2)


def test_a_factor_multiplies_what_each_wheel_is_asked_for() -> None:
    np.testing.assert_allclose(wheels_of(noisy(factor=0.9), 0.1, -0.05)[0, 0], [0.09, -0.045])


def test_a_bias_comes_before_the_factor() -> None:
    got = wheels_of(noisy(factor=0.5, bias_mps=0.02), 0.1, -0.05)
    np.testing.assert_allclose(got[1, 3], [0.06, -0.015])


def test_factors_are_normal_and_new_for_each_wheel_robot_arena_and_tick() -> None:
    noise = noisy(factor_std=0.05)
    factors = np.stack([wheels_of(noise, 0.1, 0.1) / 0.1 for _ in range(5)])
    count = factors.size  # 40,000: five standard errors, a false alarm in two million
    assert abs(factors.mean() - 1.0) < 5 * 0.05 / np.sqrt(count)
    assert abs(factors.std() - 0.05) < 5 * 0.05 / np.sqrt(2 * count)
    assert len(np.unique(factors.round(12))) > 0.999 * count


def test_biases_are_drawn_once_for_each_wheel() -> None:
    noise = noisy(bias_std_mps=0.01)
    first, later = wheels_of(noise, 0.1, 0.12), wheels_of(noise, 0.1, 0.12)
    np.testing.assert_array_equal(first, later)
    bias = first - [0.1, 0.12]
    assert abs(bias.mean()) < 5 * 0.01 / np.sqrt(bias.size)
    assert abs(bias.std() - 0.01) < 5 * 0.01 / np.sqrt(2 * bias.size)
    assert abs(np.corrcoef(bias[..., 0].ravel(), bias[..., 1].ravel())[0, 1]) < 5 / np.sqrt(bias.size / 2)


def test_wheels_that_should_stand_still_do() -> None:
    noise = noisy(bias_mps=0.1, factor_std=0.5)
    assert not wheels_of(noise, 0.0, 0.0).any()
    assert wheels_of(noise, 0.0, 1e-6).all()


def test_an_arena_alone_and_a_robot_more_have_the_same_noise() -> None:
    both = wheels_of(noisy(bias_std_mps=0.01, factor_std=0.1), 0.1, 0.1)
    alone = wheels_of(noisy(bias_std_mps=0.01, factor_std=0.1, keys=KEYS[1:], robots=7), 0.1, 0.1)
    np.testing.assert_array_equal(alone[0], both[1, :7])


def test_without_noise_the_target_is_the_command() -> None:
    for still in (noisy(), noisy(factor=1.0, bias_std_mps=0.0)):
        wheels_of(still, 0.1, -0.05)
        np.testing.assert_array_equal(still.target.reshape(-1, 3), still.command)


@pytest.mark.parametrize("kind", ["noisy", "still"])
def test_truth_keeps_the_command_and_the_robot_drifts(kind: str) -> None:
    world = World(posed([[0.0, 0.0, 0.0]]), [1], {})
    if kind == "noisy":
        world.actuators = noisy(robots=1, keys=world.keys, bias_std_mps=0.02)
    for _ in range(20):
        world.move(commanded(world, 0.05, 0.0))
    assert world.command.tolist() == [[0.05, 0.0, 0.0]]
    assert (abs(world.pose[0, 2]) > 0.01) == (kind == "noisy")
    assert (world.actuators.target[0, 0].tolist() == [0.05, 0.0, 0.0]) == (kind == "still")
