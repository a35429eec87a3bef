"""Where and beside whom a crowd moves does not matter: arenas alone and together, turned, shifted, far from others."""

import numpy as np
import pytest

from swarmwire.comms.arrays import FloatArray, IntArray
from swarmwire.comms.truth import Obstacle
from swarmwire.world.engines.discs.engine import DiscsEngine
from swarmwire.world.engines.engine import Engine
from tests.support.world.engines.conformance import EVERY, FLOOR, Make, R, asked, made, packed

SIDE_M, N = 2.4, 30
OBSTACLES = (
    Obstacle("cylinder", 0.2, 0.1, radius_m=0.05),
    Obstacle("box", -0.6, 0.4, 0.3, size_m=(0.05, 0.3)),
    Obstacle("polygon", 0.5, -0.6, 1.0, points_m=((-0.05, -0.05), (0.05, -0.05), (0.0, 0.08))),
)


def clear_of_obstacles(pose: FloatArray) -> FloatArray:
    """Those of the poses that stand free."""
    return pose[[all(np.hypot(x - o.x_m, y - o.y_m) > 0.17 + R for o in OBSTACLES) for x, y, _ in pose]]


def wander(engine: Engine, ticks: int, seed: int) -> tuple[list[FloatArray], IntArray]:
    """Let all robots of every arena wander by the same draws; the states after each tick, and contacts that began."""
    rng = np.random.default_rng(seed)
    arenas, n = engine.touched.shape
    states: list[FloatArray] = []
    onsets = np.zeros((arenas, 2), np.int64)
    for _ in range(ticks):
        target = asked(engine, rng.uniform(0.0, 0.3, n), rng.normal(0.0, 1.0, n), rng.choice([0.0, 0.1], n))
        onsets += engine.tick(target)
        states.append(np.concatenate([engine.state, engine.travel_m, engine.touched[:, :, None]], axis=2))
    return states, onsets


@pytest.mark.parametrize("make", EVERY)
def test_an_arena_moves_bit_for_bit_alike_alone_and_beside_others(make: Make) -> None:
    poses = [clear_of_obstacles(packed(40, SIDE_M, R, seed)) for seed in range(3)]
    n = min(len(pose) for pose in poses)
    poses = [pose[:n] for pose in poses]
    poses[0][:, :2] *= 0.999  # nothing alike in any two
    together, onsets = wander(made(make, poses, (SIDE_M, SIDE_M), obstacles=OBSTACLES), 60, 1)
    assert (onsets > 0).all()
    for arena, pose in enumerate(poses):
        alone, of_it = wander(made(make, pose, (SIDE_M, SIDE_M), obstacles=OBSTACLES), 60, 1)
        assert np.array_equal(np.array(together)[:, arena], np.array(alone)[:, 0])
        assert np.array_equal(onsets[arena], of_it[0])


@pytest.mark.parametrize("make", EVERY)
def test_an_arena_that_leaves_stays_as_it_is_and_the_others_go_on_as_alone(make: Make) -> None:
    poses = [clear_of_obstacles(packed(40, SIDE_M, R, seed)) for seed in range(3)]
    n = min(len(pose) for pose in poses)
    engine = made(make, [pose[:n] for pose in poses], (SIDE_M, SIDE_M), obstacles=OBSTACLES)
    ends: list[FloatArray] = []
    for over in (1, 0):
        together, _ = wander(engine, 10, over)
        ends.append(together[-1][over, :, :-1])
        engine.leave(np.arange(3) == over)
    together, onsets = wander(engine, 30, 2)
    assert not onsets[:2].any()
    for over, end in zip((1, 0), ends, strict=True):
        assert np.array_equal(together[-1][over, :, :-1], end)
    other = made(make, poses[2][:n], (SIDE_M, SIDE_M), obstacles=OBSTACLES)
    alone = [wander(other, ticks, seed) for ticks, seed in ((10, 1), (10, 0), (30, 2))]
    assert np.array_equal(np.array(together)[:, 2], np.array(alone[-1][0])[:, 0])
    assert onsets[2].tolist() == alone[-1][1][0].tolist()


@pytest.mark.parametrize("make", FLOOR)
def test_a_crowd_that_is_turned_or_shifted_moves_alike(make: Make) -> None:
    """To rounding, which grows with each contact: so for a second and a half."""
    pose = packed(N, 1.5, R, 2)
    states, onsets = wander(made(make, pose, boundary="open"), 15, 3)
    assert onsets[0, 0] > 10
    for turn, shift in ((0.7, (0.0, 0.0)), (np.pi / 2, (0.0, 0.0)), (0.0, (0.31, -0.27)), (2.0, (-0.2, 0.5))):
        rotate = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
        moved = np.column_stack([pose[:, :2] @ rotate.T + shift, pose[:, 2] + turn])
        there, began = wander(made(make, moved, boundary="open"), 15, 3)
        assert np.array_equal(began, onsets)
        assert there[-1][0, :, :2] == pytest.approx(states[-1][0, :, :2] @ rotate.T + shift, abs=1e-6)
        assert there[-1][0, :, 2] == pytest.approx(states[-1][0, :, 2] + turn, abs=1e-5)


def test_robots_far_away_and_faster_change_no_bit() -> None:
    """In the array engine; pymunk's order of contacts depends on all that there is."""
    pose = packed(N, 1.5, R, 2)
    alone, _ = wander(made(DiscsEngine, pose, (40.0, 40.0)), 60, 4)
    far = packed(20, 1.2, R, 5) + np.array([15.0, 15.0, 0.0])
    engine = made(DiscsEngine, np.concatenate([pose, far]), (40.0, 40.0))
    rng = np.random.default_rng(4)
    for tick in range(60):
        target = asked(engine, 3.0, 0.5)
        near = [rng.uniform(0.0, 0.3, N), rng.normal(0.0, 1.0, N), rng.choice([0.0, 0.1], N)]
        target[0, :N] = np.stack(near, axis=1)
        engine.tick(target)
        assert np.array_equal(engine.state[0, :N], alone[tick][0, :, :6])
