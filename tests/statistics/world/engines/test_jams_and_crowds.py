"""Both engines of the floor agree in jams, and in how often a crowd meets.

Jams are compared at 20 physics steps a tick. With 5, strong motors shake pymunk's robots, which overlap, through gaps
where they would jam with finer steps; the array engine is nearer to that already.
"""

import numpy as np
import pytest

from swarmwire.comms.truth import Obstacle
from tests.support.world.engines.conformance import FLOOR, Make, R, asked, made, packed, towards


def through_a_gap(make: Make, robots_wide: float, arenas: int) -> tuple[float, float]:
    """How many of 25 robots a mean arena lets through a gap in half a minute, and contacts that they begin."""
    side_m, gap_m = 3.0, robots_wide * 2.0 * R
    high_m = 0.5 * (side_m - gap_m)
    walls = [Obstacle("box", 0.0, s * 0.5 * (gap_m + high_m), 0.0, size_m=(0.1, high_m)) for s in (1, -1)]
    poses = np.stack([packed(25, 1.35, R, seed) for seed in range(arenas)]) - [0.75, 0.0, 0.0]
    engine = made(make, poses, (side_m, side_m), obstacles=walls, steps=20)
    onsets = np.zeros(2)
    for _ in range(300):
        x, y = engine.state[:, :, 0], engine.state[:, :, 1]
        goal_x, goal_y = np.where(x < -0.05, 0.05, 1.4), np.where(x < 0.1, 0.0, y)
        onsets += engine.tick(asked(engine, 0.2, towards(engine, goal_x, goal_y))).sum(axis=0)
    return float((engine.state[:, :, 0] > 0.0).sum()) / arenas, float(onsets[0]) / arenas


def test_jams_at_a_gap_are_as_tight() -> None:
    """A gap of 1.6 robots lets some 1.2 pass, 0.4 more or less from arena to arena; one of 2.5 robots 8, and 6."""
    for robots_wide, arenas, passed, contacts in ((1.6, 8, 0.5, 8.0), (2.5, 12, 4.0, 20.0)):
        of_pymunk, of_discs = (through_a_gap(make, robots_wide, arenas) for make in FLOOR)
        assert of_discs[0] == pytest.approx(of_pymunk[0], abs=passed)
        assert of_discs[1] == pytest.approx(of_pymunk[1], abs=contacts)


def contacts_per_robot_hour(make: Make) -> tuple[float, float]:
    """How often robots of a crowd meet each other, and walls; they back off from what they touch, turning."""
    n, arenas, ticks = 40, 6, 600
    poses = np.stack([packed(n, 3.0, R, seed) for seed in range(arenas)])
    engine = made(make, poses, (3.0, 3.0))
    rng = np.random.default_rng(3)
    turning, way = np.zeros((arenas, n), np.int64), np.ones((arenas, n))
    onsets = np.zeros(2)
    for _ in range(ticks):
        turning = np.maximum(turning - 1, 0)
        struck = (engine.touched > 0) & (turning == 0)
        turning = np.where(struck, rng.integers(5, 25, (arenas, n)), turning)
        way = np.where(struck, rng.choice([-1.0, 1.0], (arenas, n)), way)
        target = asked(engine, np.where(turning > 0, -0.05, 0.1), np.where(turning > 0, 2.0 * way, 0.0))
        onsets += engine.tick(target).sum(axis=0)
    per_hour = onsets / (arenas * n * ticks * 0.1 / 3600.0)
    return float(per_hour[0]), float(per_hour[1])


def test_a_diffusing_crowd_meets_as_often() -> None:
    """Some 1,900 contacts with robots and 1,400 with walls each; both rates differ by 3 % from sample to sample."""
    of_pymunk, of_discs = (contacts_per_robot_hour(make) for make in FLOOR)
    assert of_discs == pytest.approx(of_pymunk, rel=0.12)
