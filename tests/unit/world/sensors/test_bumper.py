"""The bumper tells of touching in the tick before, whatever was touched."""

from typing import Any

import numpy as np
import pytest

from swarmwire.world.world import World
from tests.support.world.samples import commanded, posed

BOX = {"shape": "box", "size_m": [0.2, 0.2], "at": [0.0, 0.0]}
ROOM = {"size_m": [4.0, 4.0], "obstacles": [BOX]}


def pressed(world: World, tick: int = 0) -> list[float]:
    return world.sense(tick)["a"].fields["bumper.pressed"].tolist()


def built(poses: list[list[float]], **tables: Any) -> World:
    return World(posed(poses, **tables), [1], {"a": ("bumper",)})


@pytest.mark.parametrize("poses", [[[-0.15, 0.0, 0.0]], [[1.95, 0.0, 0.0]]], ids=["obstacle", "wall"])
def test_a_robot_that_runs_into_something_fixed_feels_it(poses: list[list[float]]) -> None:
    world = built([*poses, [-1.0, -1.0, 0.0]], arena=ROOM)
    assert pressed(world) == [0.0, 0.0]
    for _ in range(4):
        world.move(commanded(world, [0.1, 0.0], 0.0))
    assert pressed(world) == [1.0, 0.0]
    for _ in range(3):
        world.move(commanded(world, [-0.1, 0.0], 0.0))
    assert pressed(world) == [0.0, 0.0]


def test_both_robots_feel_that_they_touch() -> None:
    world = built([[0.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.09, 0.0, 0.0]])
    for _ in range(5):
        world.move(commanded(world, [0.1, 0.0, 0.0], 0.0))
    assert pressed(world) == [1.0, 0.0, 1.0]


def test_what_was_told_is_not_written_to_later() -> None:
    world = built([[-0.15, 0.0, 0.0]], arena=ROOM)
    told = world.sense(0)["a"].fields["bumper.pressed"]
    for _ in range(4):
        world.move(commanded(world, 0.1, 0.0))
    assert np.array_equal(told, [0.0])
