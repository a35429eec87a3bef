"""Arenas for any engine, and the measures of the conformance tests."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.geometry.obstacles import obstacle_arrays
from swarmwire.comms.base.geometry.shapes import Boundary, Obstacle
from swarmwire.comms.robot.bodies.body import load_body
from swarmwire.world.engines.discs.engine import DiscsEngine
from swarmwire.world.engines.engine import Engine, EngineConfig, EngineMotors
from swarmwire.world.engines.kinematic import KinematicEngine
from swarmwire.world.engines.pymunk_engine import PymunkEngine

Make = Callable[[EngineConfig, FloatArray], Engine]
FLOOR: tuple[Make, ...] = (PymunkEngine, DiscsEngine)
EVERY: tuple[Make, ...] = (*FLOOR, KinematicEngine)
TICK_S = 0.1
FOOTBOT = load_body("footbot")
R = FOOTBOT.radius_m


def build_engine(
    make: Make,
    pose: Any,
    size_m: tuple[float, float] = (4.0, 4.0),
    boundary: Boundary = "walls",
    obstacles: Sequence[Obstacle] = (),
    steps: int = 5,
    radius_m: Any = R,
    mass_kg: Any = FOOTBOT.mass_kg,
    max_force_n: Any = 15.0,
    max_torque_nm: Any = 150.0,
    wheel_base_m: Any = 0.14,
    bottom_m: Any = 0.0,
    followed: Any = False,
) -> Engine:
    """An engine of foot-bots, but for the arguments, at pose (n, 3) or (arenas, n, 3)."""
    at = np.array(pose, np.float64)
    at = at if at.ndim == 3 else at[None]
    arenas, n = at.shape[:2]
    radius, mass, force, torque, base, low = (
        np.broadcast_to(np.asarray(value, np.float64), n).copy()
        for value in (radius_m, mass_kg, max_force_n, max_torque_nm, wheel_base_m, bottom_m)
    )
    motors = EngineMotors(base, force, torque, mass, 0.5 * mass * radius**2)
    standing = (tuple(obstacles),) * arenas
    shapes = size_m, boundary, standing, obstacle_arrays(standing), radius, low, low + 0.1, motors
    return make(EngineConfig(*shapes, TICK_S, steps, np.broadcast_to(followed, n).copy()), at)


def targets(engine: Engine, forward_mps: Any = 0.0, turn_radps: Any = 0.0, left_mps: Any = 0.0) -> FloatArray:
    """Targets for all robots: numbers, or (n,) or (arenas, n) each."""
    shape = engine.touched.shape
    columns = [np.broadcast_to(np.asarray(v, np.float64), shape) for v in (forward_mps, turn_radps, left_mps)]
    return np.ascontiguousarray(np.stack(columns, axis=2))


def towards(engine: Engine, x_m: Any, y_m: Any) -> FloatArray:
    """Turn rates (arenas, n) that make robots face a point."""
    x, y, heading = engine.state[:, :, :3].transpose(2, 0, 1)
    off = np.angle(np.exp(1j * (np.arctan2(y_m - y, x_m - x) - heading)))
    return np.clip(4.0 * off, -3.0, 3.0)


def overlap_m(engine: Engine, radius_m: Any, size_m: tuple[float, float] | None = None) -> float:
    """Deepest overlap of two robots, or of a robot with the walls of an arena of this size; negative: a gap."""
    radius = np.broadcast_to(np.asarray(radius_m, np.float64), engine.touched.shape[1])
    deepest = -np.inf
    for state in engine.state:
        xy = state[:, :2]
        apart = np.hypot(*(xy[:, None] - xy).transpose(2, 0, 1))
        np.fill_diagonal(apart, np.inf)
        deepest = max(deepest, float((radius[:, None] + radius - apart).max()))
        if size_m is not None:
            deepest = max(deepest, float((np.abs(xy) + radius[:, None] - 0.5 * np.array(size_m)).max()))
    return deepest


def packed(n: int, side_m: float, radius_m: float, seed: int) -> FloatArray:
    """Poses (n, 3) that do not overlap, anywhere in a square: shaken off a grid, in random order and direction."""
    rng = np.random.default_rng(seed)
    per_side = int(np.ceil(np.sqrt(n)))
    line = np.linspace(-0.5, 0.5, per_side) * (side_m - 2.1 * radius_m)
    free_m = 0.5 * (line[1] - line[0]) - radius_m
    assert free_m > 0.0
    xy = np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)[rng.permutation(per_side**2)[:n]]
    xy = np.clip(xy + rng.uniform(-free_m, free_m, xy.shape), -0.5 * side_m + radius_m, 0.5 * side_m - radius_m)
    return np.column_stack([xy, rng.uniform(-np.pi, np.pi, n)])
