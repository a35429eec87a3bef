"""The kinematic engine."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.base.arrays import FloatArray, IntArray
from swarmwire.comms.base.geometry.obstacles import Obstacles, obstacle_arrays
from swarmwire.comms.base.geometry.shapes import Obstacle
from swarmwire.world.engines.discs.engine import DiscsEngine
from swarmwire.world.engines.engine import Engine, EngineConfig, EngineMotors
from swarmwire.world.engines.kinematic import KinematicEngine
from tests.support.world.engines.conformance import EVERY, FLOOR, Make, R, build_engine, packed, targets
from tests.support.world.scenes import rim

RADIUS_M, TICK_S = 0.05, 0.1
BOX = Obstacle("box", 1.0, 0.0, 0.3, size_m=(0.02, 1.0), height_m=0.5)
DISC = Obstacle("cylinder", 1.0, 0.0, radius_m=0.2, height_m=0.5)
TRIANGLE = Obstacle("polygon", 1.0, 0.0, 0.4, points_m=((-0.3, -0.2), (0.3, -0.2), (0.0, 0.4)), height_m=0.5)
SIDE_M, N = 2.4, 30
OBSTACLES = (
    Obstacle("cylinder", 0.2, 0.1, radius_m=0.05),
    Obstacle("box", -0.6, 0.4, 0.3, size_m=(0.05, 0.3)),
    Obstacle("polygon", 0.5, -0.6, 1.0, points_m=((-0.05, -0.05), (0.05, -0.05), (0.0, 0.08))),
)
SIZE_M, STEP_S, ROBOTS = (4.0, 3.0), 0.1, 30
BASE_M = 0.14


def engine(
    pose: Any, obstacles: tuple[Obstacle, ...] = (), boundary: Any = "walls", bottom_m: Any = 0.0
) -> KinematicEngine:
    """Discs of RADIUS_M, 0.1 m high, at pose (n, 3) or (arenas, n, 3) in a square of 4 m."""
    at = np.array(pose, np.float64)
    at = at if at.ndim == 3 else at[None]
    n, standing = at.shape[1], (obstacles,) * len(at)
    bottom = np.broadcast_to(np.asarray(bottom_m, np.float64), n).copy()
    motors = EngineMotors(*(np.full(n, value) for value in (0.06, 1.0, 1.0, 1.0, 1.0)))
    shapes = np.full(n, RADIUS_M), bottom, bottom + 0.1, motors
    config = EngineConfig(
        (4.0, 4.0), boundary, standing, obstacle_arrays(standing), *shapes, TICK_S, 5, np.zeros(len(at[0]), np.bool_)
    )
    return KinematicEngine(config, at)


def target(*rows: tuple[float, float, float]) -> FloatArray:
    """Forward m/s, left turn rad/s, to the left m/s, of each robot of one arena."""
    return np.array([rows], np.float64)


@given(forward=st.floats(-1, 1), turn=st.floats(-5, 5), left=st.floats(-1, 1), heading=st.floats(-3, 3))
def test_kinematic_robot_moves_along_the_exact_arc(forward: float, turn: float, left: float, heading: float) -> None:
    moved = engine([[0.0, 0.0, heading]], boundary="open")
    onsets = moved.tick(target((forward, turn, left)))
    t = np.linspace(0.0, TICK_S, 2001)
    middle = heading + turn * 0.5 * (t[1:] + t[:-1])
    dt = TICK_S / 2000
    x = np.sum(forward * np.cos(middle) - left * np.sin(middle)) * dt
    y = np.sum(forward * np.sin(middle) + left * np.cos(middle)) * dt
    end = heading + turn * TICK_S
    assert moved.state[0, 0, :3] == pytest.approx((x, y, end), abs=1e-8)
    velocity = forward * np.cos(end) - left * np.sin(end), forward * np.sin(end) + left * np.cos(end), turn
    assert moved.state[0, 0, 3:] == pytest.approx(velocity, abs=1e-12)
    wheels = TICK_S * (forward - 0.03 * turn), TICK_S * (forward + 0.03 * turn)
    assert moved.travel_m[0, 0] == pytest.approx(wheels, abs=1e-12)
    assert not onsets.any()


def test_torus_wraps_positions_and_keeps_velocities() -> None:
    moved = engine([[1.9, -1.9, -np.pi / 4]], boundary="torus")
    for _ in range(20):
        assert not moved.tick(target((1.0, 0.0, 0.0))).any()
        assert np.abs(moved.state[0, 0, :2]).max() <= 2.0
        assert moved.state[0, 0, 3:5] == pytest.approx([np.sqrt(0.5), -np.sqrt(0.5)])
    way = 2.0 * np.sqrt(0.5)
    assert moved.state[0, 0, :2] == pytest.approx([1.9 + way - 4.0, -1.9 - way + 4.0])


def distance_m(obstacle: Obstacle, xy: FloatArray) -> float:
    """Distance of a point from the rim of an obstacle, by brute force; of a cylinder exactly."""
    if obstacle.shape == "cylinder":
        return float(np.hypot(*(xy - [obstacle.x_m, obstacle.y_m]))) - obstacle.radius_m
    return float(np.hypot(*(rim(obstacle) - xy).T).min())


@pytest.mark.parametrize("obstacle", [BOX, DISC, TRIANGLE])
@pytest.mark.parametrize("heading", [0.0, 0.1, -0.15])
def test_obstacle_stops_a_fast_robot_and_lets_it_slide_along(obstacle: Obstacle, heading: float) -> None:
    moved = engine([[0.0, 0.01, heading]], (obstacle,), "open")
    began, nearest = np.zeros(2, np.int64), np.inf
    for _ in range(12):
        began += moved.tick(target((3.0, 0.0, 0.0)))[0]
        nearest = min(nearest, distance_m(obstacle, moved.state[0, 0, :2]) - RADIUS_M)
        assert np.hypot(*moved.state[0, 0, 3:5]) <= 3.0 + 1e-9
    assert nearest == pytest.approx(0.0, abs=1e-6)
    assert began.tolist() == [0, 1]


def test_kinematic_robot_that_drives_into_a_corner_stays_in_it() -> None:
    moved = engine([[1.5, 1.2, 0.7]])
    onsets = sum(moved.tick(target((1.0, 0.0, 0.0))) for _ in range(20))
    assert moved.state[0, 0, :2] == pytest.approx([2.0 - RADIUS_M] * 2)
    assert moved.state[0, 0, 3:5] == pytest.approx([0.0, 0.0], abs=1e-12)
    assert np.array_equal(onsets, [[0, 1]])
    assert moved.travel_m[0, 0].max() < 1.0


def test_narrow_wedge_is_not_driven_into() -> None:
    wedge = (Obstacle("box", 1.0, 0.3, 0.4, size_m=(1.2, 0.1)), Obstacle("box", 1.0, -0.3, -0.4, size_m=(1.2, 0.1)))
    sides = tuple(Obstacle(o.shape, o.x_m, -o.y_m, o.heading_rad, size_m=o.size_m) for o in wedge)
    moved = engine([[0.0, 0.0, 0.0]], sides)
    for _ in range(60):
        moved.tick(target((0.5, 0.0, 0.0)))
        assert min(distance_m(o, moved.state[0, 0, :2]) for o in sides) >= RADIUS_M - 1e-6


@pytest.mark.parametrize(("bottom_m", "passes"), [(0.0, False), (0.49, False), (0.5, True), (2.0, True)])
def test_obstacle_is_passed_over_at_its_top_or_above(bottom_m: float, passes: bool) -> None:
    moved = engine([[0.0, 0.0, 0.0]], (BOX, DISC), bottom_m=bottom_m)
    onsets = sum(moved.tick(target((1.0, 0.0, 0.0))) for _ in range(15))
    assert (moved.state[0, 0, 0] == pytest.approx(1.5)) == passes
    assert np.array_equal(onsets, [[0, 0 if passes else 1]])


def test_obstacle_on_a_torus_stops_robots_across_the_border() -> None:
    post = (Obstacle("cylinder", -1.9, 0.0, radius_m=0.1), Obstacle("box", -1.9, 1.0, size_m=(0.2, 0.2)))
    moved = engine([[1.5, 0.0, 0.0], [1.5, 1.0, 0.0]], post, "torus")
    onsets = sum(moved.tick(target((1.0, 0.0, 0.0), (1.0, 0.0, 0.0))) for _ in range(10))
    assert moved.state[0, :, 0] == pytest.approx(2.0 - RADIUS_M)
    assert np.array_equal(onsets, [[0, 2]])


def test_robots_at_different_heights_do_not_overlap() -> None:
    moved = engine([[-0.5, 0.0, 0.0], [0.5, 0.0, np.pi]], bottom_m=[0.0, 0.1])
    assert not sum(moved.tick(target((1.0, 0.0, 0.0), (1.0, 0.0, 0.0))) for _ in range(10)).any()


@pytest.mark.parametrize("boundary", ["open", "torus", "walls"])
@pytest.mark.parametrize("n", [2, 5, 90])
def test_overlaps_equal_a_brute_force_search(boundary: str, n: int) -> None:
    rng = np.random.default_rng(n)
    pose = rng.uniform(-1.95, 1.95, (3, n, 3))
    if n < 90:  # near the corners, for overlaps, also across the border
        pose[:, :, :2] = np.sign(pose[:, :, :2]) * 1.93
    moved = engine(pose, boundary=boundary)
    before: set[tuple[int, int, int]] = set()
    for _ in range(30):
        onsets = moved.tick(
            np.concatenate([rng.uniform(-1, 1, (3, n, 1)), rng.uniform(-3, 3, (3, n, 1)), np.zeros((3, n, 1))], 2)
        )
        apart = moved.state[:, :, None, :2] - moved.state[:, None, :, :2]
        if boundary == "torus":
            apart -= 4.0 * np.round(apart / 4.0)
        near = np.argwhere(np.hypot(apart[..., 0], apart[..., 1]) < 2.0 * RADIUS_M)
        now = {(int(a), int(i), int(j)) for a, i, j in near if i < j}
        began = [sum(pair[0] == arena for pair in now - before) for arena in range(3)]
        assert onsets[:, 0].tolist() == began
        touching = {(a, i) for a, *pair in now for i in pair}
        if boundary != "walls":
            assert {(int(a), int(i)) for a, i in np.argwhere(moved.touched)} == touching
        before = now


def poses_off_obstacles(pose: FloatArray) -> FloatArray:
    """The poses that overlap no obstacle."""
    return pose[[all(np.hypot(x - o.x_m, y - o.y_m) > 0.17 + R for o in OBSTACLES) for x, y, _ in pose]]


def wander(engine: Engine, ticks: int, seed: int) -> tuple[list[FloatArray], IntArray]:
    """Let the robots of all arenas wander by the same draws; the states after each tick, and the new contacts."""
    rng = np.random.default_rng(seed)
    arenas, n = engine.touched.shape
    states: list[FloatArray] = []
    onsets = np.zeros((arenas, 2), np.int64)
    for _ in range(ticks):
        target = targets(engine, rng.uniform(0.0, 0.3, n), rng.normal(0.0, 1.0, n), rng.choice([0.0, 0.1], n))
        onsets += engine.tick(target)
        states.append(np.concatenate([engine.state, engine.travel_m, engine.touched[:, :, None]], axis=2))
    return states, onsets


@pytest.mark.parametrize("make", EVERY)
def test_arena_moves_bit_for_bit_equal_alone_and_among_others(make: Make) -> None:
    poses = [poses_off_obstacles(packed(40, SIDE_M, R, seed)) for seed in range(3)]
    n = min(len(pose) for pose in poses)
    poses = [pose[:n] for pose in poses]
    poses[0][:, :2] *= 0.999  # no two arenas alike
    together, onsets = wander(build_engine(make, poses, (SIDE_M, SIDE_M), obstacles=OBSTACLES), 60, 1)
    assert (onsets > 0).all()
    for arena, pose in enumerate(poses):
        alone, onsets_alone = wander(build_engine(make, pose, (SIDE_M, SIDE_M), obstacles=OBSTACLES), 60, 1)
        assert np.array_equal(np.array(together)[:, arena], np.array(alone)[:, 0])
        assert np.array_equal(onsets[arena], onsets_alone[0])


@pytest.mark.parametrize("make", EVERY)
def test_arena_that_leaves_stands_still_and_others_are_unchanged(make: Make) -> None:
    poses = [poses_off_obstacles(packed(40, SIDE_M, R, seed)) for seed in range(3)]
    n = min(len(pose) for pose in poses)
    engine = build_engine(make, [pose[:n] for pose in poses], (SIDE_M, SIDE_M), obstacles=OBSTACLES)
    ends: list[FloatArray] = []
    for over in (1, 0):
        together, _ = wander(engine, 10, over)
        ends.append(together[-1][over, :, :-1])
        engine.leave(np.arange(3) == over)
    together, onsets = wander(engine, 30, 2)
    assert not onsets[:2].any()
    for over, end in zip((1, 0), ends, strict=True):
        assert np.array_equal(together[-1][over, :, :-1], end)
    other = build_engine(make, poses[2][:n], (SIDE_M, SIDE_M), obstacles=OBSTACLES)
    alone = [wander(other, ticks, seed) for ticks, seed in ((10, 1), (10, 0), (30, 2))]
    assert np.array_equal(np.array(together)[:, 2], np.array(alone[-1][0])[:, 0])
    assert onsets[2].tolist() == alone[-1][1][0].tolist()


@pytest.mark.parametrize("make", FLOOR)
def test_crowd_moves_equally_when_turned_or_shifted(make: Make) -> None:
    """Within rounding, which grows with each contact: therefore only 1.5 s."""
    pose = packed(N, 1.5, R, 2)
    states, onsets = wander(build_engine(make, pose, boundary="open"), 15, 3)
    assert onsets[0, 0] > 10
    for turn, shift in ((0.7, (0.0, 0.0)), (np.pi / 2, (0.0, 0.0)), (0.0, (0.31, -0.27)), (2.0, (-0.2, 0.5))):
        rotate = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
        moved = np.column_stack([pose[:, :2] @ rotate.T + shift, pose[:, 2] + turn])
        states_after, began = wander(build_engine(make, moved, boundary="open"), 15, 3)
        assert np.array_equal(began, onsets)
        assert states_after[-1][0, :, :2] == pytest.approx(states[-1][0, :, :2] @ rotate.T + shift, abs=1e-6)
        assert states_after[-1][0, :, 2] == pytest.approx(states[-1][0, :, 2] + turn, abs=1e-5)


def test_distant_faster_robots_change_no_bit() -> None:
    """Only in the engine of discs; pymunk's order of contacts depends on all robots."""
    pose = packed(N, 1.5, R, 2)
    alone, _ = wander(build_engine(DiscsEngine, pose, (40.0, 40.0)), 60, 4)
    far = packed(20, 1.2, R, 5) + np.array([15.0, 15.0, 0.0])
    engine = build_engine(DiscsEngine, np.concatenate([pose, far]), (40.0, 40.0))
    rng = np.random.default_rng(4)
    for tick in range(60):
        target = targets(engine, 3.0, 0.5)
        near = [rng.uniform(0.0, 0.3, N), rng.normal(0.0, 1.0, N), rng.choice([0.0, 0.1], N)]
        target[0, :N] = np.stack(near, axis=1)
        engine.tick(target)
        assert np.array_equal(engine.state[0, :N], alone[tick][0, :, :6])


def engine_with(
    pose: FloatArray, standing: tuple[tuple[Obstacle, ...], ...], arrays: Obstacles, boundary: Any
) -> KinematicEngine:
    """Discs of several sizes, every third of them above low obstacles."""
    n = pose.shape[1]
    radius_m, bottom_m = np.resize([0.02, 0.1, 0.05, 0.04], n), np.resize([0.0, 0.0, 0.2], n)
    motors = EngineMotors(*(np.full(n, value) for value in (0.06, 1.0, 1.0, 1.0, 1.0)))
    shapes = radius_m, bottom_m, bottom_m + 0.1, motors
    return KinematicEngine(
        EngineConfig(SIZE_M, boundary, standing, arrays, *shapes, STEP_S, 5, np.zeros(n, np.bool_)), pose
    )


def crowded(rng: np.random.Generator, count: int) -> tuple[Obstacle, ...]:
    """Small and large cylinders and boxes, some low, some across the border."""
    obstacles: list[Obstacle] = []
    for i in range(count):
        x, y, heading, long, wide = (
            rng.uniform(-0.5, 0.5, 5) * [*SIZE_M, 6.0, 1.0, 0.2] + [0, 0, 0, 0.52, 0.12]
        ).tolist()
        height_m = 0.1 if i % 4 == 0 else 1.0
        if i % 2:
            obstacles.append(Obstacle("cylinder", x, y, radius_m=wide, height_m=height_m))
        else:
            obstacles.append(Obstacle("box", x, y, heading, size_m=(long, wide), height_m=height_m))
    return tuple(obstacles)


def count_equal_holds(
    rng: np.random.Generator, standing: tuple[tuple[Obstacle, ...], ...], boundary: str, ticks: int
) -> int:
    """Robots move bit for bit as with a robot so fast that all obstacles are near; the number of contacts."""
    pose = rng.uniform(-0.5, 0.5, (len(standing), ROBOTS + 1, 3)) * [*SIZE_M, 6.0]
    arrays = obstacle_arrays(standing)
    alone, with_fast = (
        engine_with(obstacles, standing, arrays, boundary) for obstacles in (pose[:, :ROBOTS].copy(), pose)
    )
    held = 0
    for _ in range(ticks):
        target = rng.uniform(-1.0, 1.0, pose.shape) * [1.0, 3.0, 0.3]
        target[:, ROBOTS] = 80.0, 0.0, 0.0  # 8 m in a tick
        alone.tick(target[:, :ROBOTS].copy())
        with_fast.tick(target)
        held += int(alone.touched.sum())
        assert alone.state.tobytes() == with_fast.state[:, :ROBOTS].tobytes()
        assert alone.travel_m.tobytes() == with_fast.travel_m[:, :ROBOTS].tobytes()
    return held


@pytest.mark.parametrize("boundary", ["walls", "torus", "open"])
@pytest.mark.parametrize("count", [3, 40, 120])
def test_obstacle_index_changes_no_bit(boundary: str, count: int) -> None:
    rng = np.random.default_rng(count)
    assert count_equal_holds(rng, tuple(crowded(rng, obstacles) for obstacles in (count, 0, count // 2)), boundary, 40)


def test_robot_pushed_out_of_an_obstacle_into_another_is_pushed_again() -> None:
    posts = tuple(
        Obstacle("cylinder", *at, radius_m=0.02) for at in np.linspace([-1.9, -1.0], [-1.0, 1.0], 120).tolist()
    )
    tower, beyond = Obstacle("cylinder", 1.0, 0.0, radius_m=1.0), Obstacle("cylinder", 2.02, 0.1, radius_m=0.3)
    standing = ((tower, beyond, *posts),)
    towards = np.array([0.97, 0.243]) / np.hypot(0.97, 0.243)
    pose = np.zeros((1, 1, 3))
    pose[0, 0, :2] = [1.0, 0.0] + 0.1 * towards
    moved = engine_with(pose, standing, obstacle_arrays(standing), "walls")
    moved.tick(np.zeros((1, 1, 3)))
    out = [1.0, 0.0] + 1.02 * towards  # rim of the tower
    away = out - [2.02, 0.1]
    assert moved.state[0, 0, :2] == pytest.approx([2.02, 0.1] + 0.32 * away / np.hypot(*away), abs=1e-12)


def test_pushed_obstacle_stops_robots_at_its_new_position() -> None:
    standing = ((Obstacle("cylinder", -1.0, 0.0, radius_m=0.1, mass_kg=1.0),),)
    arrays = obstacle_arrays(standing)
    moved = engine_with(np.zeros((1, 1, 3)), standing, arrays, "walls")
    forward = np.array([[[1.0, 0.0, 0.0]]])
    moved.tick(forward)
    arrays.circle[0, 0] = 1.0
    for _ in range(15):
        moved.tick(forward)
    assert moved.state[0, 0, 0] == pytest.approx(1.0 - 0.1 - 0.02)


@pytest.mark.parametrize("make", EVERY)
@pytest.mark.parametrize("steps", [1, 5, 20])
@given(forward=st.floats(-0.3, 0.3), left=st.floats(-0.3, 0.3), turn=st.floats(-2.0, 2.0), heading=st.floats(-3.1, 3.1))
def test_robot_drives_chords_of_its_arc(
    make: Make, steps: int, forward: float, left: float, turn: float, heading: float
) -> None:
    engine = build_engine(make, [[0.1, -0.2, heading]], steps=steps)
    target = targets(engine, forward, turn, left)
    for _ in range(3):
        engine.tick(target)
    x, y, start = engine.state[0, 0, :3]
    rolled = engine.travel_m[0, 0].copy()
    for _ in range(10):
        engine.tick(target)
    chord = np.sinc(turn / (2.0 * np.pi))
    along, across = start + turn / 2.0, start + turn / 2.0 + np.pi / 2.0
    at_x = x + chord * (forward * np.cos(along) + left * np.cos(across))
    at_y = y + chord * (forward * np.sin(along) + left * np.sin(across))
    # The path of k steps is k chords, each longer than its own by (turn per step)^2 / 24.
    slack = 1e-9 + np.hypot(forward, left) * (turn * 0.1 / steps) ** 2 / 20
    assert engine.state[0, 0, :2] == pytest.approx((at_x, at_y), abs=slack)
    assert engine.state[0, 0, 2] - start == pytest.approx(turn, abs=1e-9)
    wheels = forward - 0.5 * BASE_M * turn, forward + 0.5 * BASE_M * turn
    assert engine.travel_m[0, 0] - rolled == pytest.approx(wheels, abs=1e-9)


@pytest.mark.parametrize("make", FLOOR)
@pytest.mark.parametrize("heading", [0.0, 2.0])
def test_velocity_changes_at_force_over_mass_in_any_direction(make: Make, heading: float) -> None:
    """A switch from driving ahead to driving left: velocity changes by force / mass on the line between both."""
    engine = build_engine(make, [[0.0, 0.0, heading]], max_force_n=1.6, mass_kg=1.6, steps=50)
    for _ in range(4):
        engine.tick(targets(engine, 0.3))
    for tick in range(1, 4):
        engine.tick(targets(engine, 0.0, 0.0, 0.4))
        ahead = np.array([np.cos(heading), np.sin(heading)])
        expected = ahead * (0.3 - 0.06 * tick * 10 / 10) + np.array([-ahead[1], ahead[0]]) * 0.08 * tick
        assert engine.state[0, 0, 3:5] == pytest.approx(expected, abs=1e-6)
