"""Obstacles by cell hold robots back as all of them would that are looked at one after the other."""

from typing import Any

import numpy as np
import pytest

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.geometry.obstacles import Obstacles, obstacle_arrays
from swarmwire.comms.truth import Obstacle
from swarmwire.world.engines.engine import EngineConfig, Motors
from swarmwire.world.engines.kinematic import KinematicEngine

SIZE_M, TICK_S, ROBOTS = (4.0, 3.0), 0.1, 30


def engine(
    pose: FloatArray, standing: tuple[tuple[Obstacle, ...], ...], arrays: Obstacles, boundary: Any
) -> KinematicEngine:
    """Discs of several sizes, every third of them above low obstacles."""
    n = pose.shape[1]
    radius_m, bottom_m = np.resize([0.02, 0.1, 0.05, 0.04], n), np.resize([0.0, 0.0, 0.2], n)
    motors = Motors(*(np.full(n, value) for value in (0.06, 1.0, 1.0, 1.0, 1.0)))
    of = radius_m, bottom_m, bottom_m + 0.1, motors
    return KinematicEngine(EngineConfig(SIZE_M, boundary, standing, arrays, *of, TICK_S, 5), pose)


def crowded(rng: np.random.Generator, count: int) -> tuple[Obstacle, ...]:
    """Small and large cylinders and boxes, of which some are low and some reach over the border."""
    made: list[Obstacle] = []
    for i in range(count):
        x, y, heading, long, wide = (
            rng.uniform(-0.5, 0.5, 5) * [*SIZE_M, 6.0, 1.0, 0.2] + [0, 0, 0, 0.52, 0.12]
        ).tolist()
        height_m = 0.1 if i % 4 == 0 else 1.0
        if i % 2:
            made.append(Obstacle("cylinder", x, y, radius_m=wide, height_m=height_m))
        else:
            made.append(Obstacle("box", x, y, heading, size_m=(long, wide), height_m=height_m))
    return tuple(made)


def held_alike(rng: np.random.Generator, standing: tuple[tuple[Obstacle, ...], ...], boundary: str, ticks: int) -> int:
    """Robots anywhere go bit for bit as beside one so fast that all obstacles are near; how often one is held back."""
    pose = rng.uniform(-0.5, 0.5, (len(standing), ROBOTS + 1, 3)) * [*SIZE_M, 6.0]
    arrays = obstacle_arrays(standing)
    alone, beside = (engine(some, standing, arrays, boundary) for some in (pose[:, :ROBOTS].copy(), pose))
    held = 0
    for _ in range(ticks):
        target = rng.uniform(-1.0, 1.0, pose.shape) * [1.0, 3.0, 0.3]
        target[:, ROBOTS] = 80.0, 0.0, 0.0  # 8 m in a tick
        alone.tick(target[:, :ROBOTS].copy())
        beside.tick(target)
        held += int(alone.touched.sum())
        assert alone.state.tobytes() == beside.state[:, :ROBOTS].tobytes()
        assert alone.travel_m.tobytes() == beside.travel_m[:, :ROBOTS].tobytes()
    return held


@pytest.mark.parametrize("boundary", ["walls", "torus", "open"])
@pytest.mark.parametrize("count", [3, 40, 120])
def test_robots_are_held_back_bit_for_bit_as_if_all_obstacles_were_looked_at(boundary: str, count: int) -> None:
    rng = np.random.default_rng(count)
    assert held_alike(rng, tuple(crowded(rng, some) for some in (count, 0, count // 2)), boundary, 40)


def test_who_is_pushed_far_is_pushed_on_from_there_before_the_wall_holds_it() -> None:
    posts = tuple(
        Obstacle("cylinder", *at, radius_m=0.02) for at in np.linspace([-1.9, -1.0], [-1.0, 1.0], 120).tolist()
    )
    tower, beyond = Obstacle("cylinder", 1.0, 0.0, radius_m=1.0), Obstacle("cylinder", 2.02, 0.1, radius_m=0.3)
    standing = ((tower, beyond, *posts),)
    towards = np.array([0.97, 0.243]) / np.hypot(0.97, 0.243)
    pose = np.zeros((1, 1, 3))
    pose[0, 0, :2] = [1.0, 0.0] + 0.1 * towards
    moved = engine(pose, standing, obstacle_arrays(standing), "walls")
    moved.tick(np.zeros((1, 1, 3)))
    out = [1.0, 0.0] + 1.02 * towards  # of the tower
    away = out - [2.02, 0.1]
    assert moved.state[0, 0, :2] == pytest.approx([2.02, 0.1] + 0.32 * away / np.hypot(*away), abs=1e-12)


def test_an_obstacle_that_is_pushed_holds_back_where_it_then_is() -> None:
    standing = ((Obstacle("cylinder", -1.0, 0.0, radius_m=0.1, mass_kg=1.0),),)
    arrays = obstacle_arrays(standing)
    moved = engine(np.zeros((1, 1, 3)), standing, arrays, "walls")
    forward = np.array([[[1.0, 0.0, 0.0]]])
    moved.tick(forward)
    arrays.circle[0, 0] = 1.0
    for _ in range(15):
        moved.tick(forward)
    assert moved.state[0, 0, 0] == pytest.approx(1.0 - 0.1 - 0.02)
