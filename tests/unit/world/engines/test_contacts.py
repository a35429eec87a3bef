"""Contacts in both engines: robots do not overlap, and push one another."""

import numpy as np
import pytest

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.geometry.shapes import Obstacle
from swarmwire.world.engines.discs.engine import DiscsEngine
from tests.support.world.engines.conformance import (
    FLOOR,
    TICK_S,
    Make,
    R,
    build_engine,
    overlap_m,
    packed,
    targets,
    towards,
)

pytestmark = pytest.mark.parametrize("make", FLOOR)
SPEED_MPS = 0.3
RESTING = 0.02 * R
OBSTACLES = {
    "cylinder": Obstacle("cylinder", 0.0, 0.0, radius_m=0.3),
    "box": Obstacle("box", 0.0, 0.0, 0.0, size_m=(0.6, 1.0)),
    "polygon": Obstacle("polygon", 0.0, 0.0, points_m=((-0.3, -0.4), (0.2, -0.4), (0.2, 0.4), (-0.3, 0.4))),
    "corner": Obstacle("box", -0.3 + np.hypot(0.3, 0.3), 0.0, np.pi / 4, size_m=(0.6, 0.6)),
}


def transient_m(closing_mps: float, steps: int) -> float:
    """Largest overlap within a tick: a little more than the distance closed in a step."""
    return 1.2 * closing_mps * TICK_S / steps


@pytest.mark.parametrize("steps", [1, 2, 3, 5, 10, 20])
@pytest.mark.parametrize("gap_m", [0.1, 0.107, 0.1113])
@pytest.mark.parametrize("aside_m", [0.0, 0.05])
def test_robots_that_meet_head_on_stop_each_other(make: Make, steps: int, gap_m: float, aside_m: float) -> None:
    x = R + 0.5 * gap_m
    engine = build_engine(make, [[-x, 0.5 * aside_m, 0.0], [x, -0.5 * aside_m, np.pi]], steps=steps)
    deepest, onsets = [overlap_m(engine, R)], np.zeros((1, 2), np.int64)
    for _ in range(30):
        onsets += engine.tick(targets(engine, SPEED_MPS))
        deepest.append(overlap_m(engine, R))
    if steps > 1:
        assert onsets.tolist() == [[1, 0]]
    assert max(deepest) <= transient_m(2 * SPEED_MPS, steps)
    if aside_m == 0.0 and steps > 1:
        assert deepest[-1] >= -0.01 * R
        assert max(deepest[-15:]) <= RESTING


@pytest.mark.parametrize("radii_m", [(0.03, 0.15), (0.15, 0.03)])
def test_robots_of_unequal_mass_do_not_press_into_each_other(make: Make, radii_m: tuple[float, float]) -> None:
    radius, mass = np.array(radii_m), 1e3 * np.array(radii_m) ** 2
    pose = [[-radius[0] - 0.05, 0.001, 0.0], [radius[1] + 0.05, 0.0, np.pi]]
    engine = build_engine(make, pose, radius_m=radius, mass_kg=mass, max_force_n=4.0 * mass)
    for _ in range(15):
        engine.tick(targets(engine, 0.1))
        assert overlap_m(engine, radius) <= transient_m(0.2, 5)
    for _ in range(30):
        engine.tick(targets(engine, [0.1, 0.0]))
    assert overlap_m(engine, radius) <= 0.02 * min(radii_m)


@pytest.mark.parametrize("heading", [0.0, 0.3, np.pi / 4, 1.0, np.pi / 2])
def test_robot_that_drives_into_a_corner_stays_there(make: Make, heading: float) -> None:
    size_m = (2.0, 3.0)
    engine = build_engine(make, [[0.8, 1.3, heading]], size_m)
    deepest: list[float] = []
    for _ in range(60):
        engine.tick(targets(engine, SPEED_MPS))
        deepest.append(overlap_m(engine, R, size_m))
    assert max(deepest) <= transient_m(SPEED_MPS, 5)
    assert max(deepest[-20:]) <= RESTING


@pytest.mark.parametrize("shape", OBSTACLES)
def test_obstacles_hold_robots_back(make: Make, shape: str) -> None:
    engine = build_engine(make, [[-0.6, 0.0, 0.0]], obstacles=[OBSTACLES[shape]])
    onsets = sum(engine.tick(targets(engine, SPEED_MPS)) for _ in range(20))
    assert np.array_equal(onsets, [[0, 1]])
    assert engine.touched.tolist() == [[1.0]]
    assert engine.state[0, 0, :2] == pytest.approx([-0.3 - R, 0.0], abs=0.02 * R)


@pytest.mark.parametrize("speed_mps", [0.1, 0.3])
def test_packed_crowd_overlaps_hardly_and_stays_inside(make: Make, speed_mps: float) -> None:
    """Two thirds drive straight ahead, the others wander; robots cover 60 % of the area."""
    n = 120
    side_m = float(np.sqrt(n * np.pi * R**2 / 0.6))
    engine = build_engine(make, packed(n, side_m, R, 5), (side_m, side_m))
    rng = np.random.default_rng(6)
    turn = np.zeros(n)
    for tick in range(80):
        if tick % 10 == 0:
            turn[::3] = rng.uniform(-2.0, 2.0, len(turn[::3]))
        engine.tick(targets(engine, speed_mps, turn))
        assert overlap_m(engine, R, (side_m, side_m)) <= transient_m(2 * speed_mps, 5)
    for _ in range(60):
        engine.tick(targets(engine, speed_mps))
    assert overlap_m(engine, R, (side_m, side_m)) <= transient_m(2 * speed_mps, 5)
    for _ in range(40):
        engine.tick(targets(engine))
    assert overlap_m(engine, R, (side_m, side_m)) <= RESTING


def test_crowd_that_presses_into_a_corner_stays_inside(make: Make) -> None:
    side_m, n = 3.0, 60
    engine = build_engine(make, packed(n, side_m, R, 7), (side_m, side_m))
    for _ in range(120):
        engine.tick(targets(engine, 0.2, towards(engine, 1.5, 1.5)))
        assert overlap_m(engine, R, (side_m, side_m)) <= transient_m(0.4, 5)
    if make is DiscsEngine:  # pymunk leaves 3 % while all press
        assert overlap_m(engine, R, (side_m, side_m)) <= RESTING
    for _ in range(20):
        engine.tick(targets(engine))
    assert overlap_m(engine, R, (side_m, side_m)) <= RESTING


@pytest.mark.parametrize("steps", [1, 2, 5])
def test_fast_robot_does_not_jump_over_a_thin_wall(make: Make, steps: int) -> None:
    """A wall of thin boxes side by side; a robot closes less than its width in a step."""
    boxes = [Obstacle("box", 0.0, y, 0.0, size_m=(0.01, 0.25)) for y in np.arange(-1.875, 2.0, 0.25)]
    engine = build_engine(make, [[-0.4, 0.1, 0.0], [-0.9, -0.6, 0.3]], obstacles=boxes, steps=steps)
    for _ in range(40):
        engine.tick(targets(engine, 0.3))
        assert engine.state[0, :, 0].max() < -R + transient_m(0.3, steps)


def pushed(make: Make, aside_m: float, braked: bool, mirror: tuple[int, int], swapped: bool) -> FloatArray:
    """Positions of a robot and of the robot that it pushes, mirrored and swapped back, (ticks, 2, 2)."""
    x, y = mirror
    poses = [[0.0, y * aside_m, 0.0 if x > 0 else np.pi], [x * (2.0 * R + 0.03), 0.0, 0.0]]
    order = [1, 0] if swapped else [0, 1]
    engine = build_engine(make, [poses[i] for i in order])
    engine.braked[0, order.index(1)] = braked
    way: list[FloatArray] = []
    for _ in range(25):
        engine.tick(targets(engine, np.array([0.2, 0.0])[order]))
        way.append(engine.state[0, order, :2] * [x, y])
    return np.array(way)


@pytest.mark.parametrize("braked", [True, False])
@pytest.mark.parametrize("aside_m", [0.0, 0.02, 0.06])
def test_pushing_is_equal_when_mirrored_or_with_robots_swapped(make: Make, aside_m: float, braked: bool) -> None:
    unmirrored = pushed(make, aside_m, braked, (1, 1), False)
    assert unmirrored[-1, 1, 0] > 2.0 * R + 0.05
    for mirror in ((-1, 1), (1, -1), (-1, -1)):
        assert pushed(make, aside_m, braked, mirror, False) == pytest.approx(unmirrored, abs=1e-6)
    assert pushed(make, aside_m, braked, (1, 1), True) == pytest.approx(unmirrored, abs=1e-6)


@pytest.mark.parametrize("heading", [0.0, 0.7, np.pi / 2, 3.0])
def test_equal_robots_head_on_stay_where_they_met(make: Make, heading: float) -> None:
    along = np.array([np.cos(heading), np.sin(heading)])
    poses = [[*(-0.15 * along), heading], [*(0.15 * along), heading + np.pi]]
    engine = build_engine(make, poses)
    for _ in range(60):
        engine.tick(targets(engine, 0.2))
    assert engine.state[0, :, :2].mean(axis=0) == pytest.approx([0.0, 0.0], abs=1e-4)
    assert np.abs(engine.state[0, :, 3:5]).max() < 0.01


def test_stronger_robot_pushes_the_weaker_one_back(make: Make) -> None:
    poses = [[-0.15, 0.0, 0.0], [0.15, 0.0, np.pi]]
    engine = build_engine(make, poses, max_force_n=[3.0, 1.0], steps=50)
    for _ in range(50):
        engine.tick(targets(engine, 0.2))
    assert engine.state[0, :, 0].mean() > 0.2


def test_row_of_robots_in_touch_is_pushed_as_one(make: Make) -> None:
    """Four equal robots in touch, the last drives: all move alike."""
    x = np.arange(4) * 2.0 * R - 1.0
    engine = build_engine(make, np.column_stack([x, np.zeros(4), np.zeros(4)]))
    for _ in range(40):
        engine.tick(targets(engine, [0.2, 0.0, 0.0, 0.0]))
    gained = engine.state[0, :, 0] - x
    assert gained.min() > 0.05
    assert np.ptp(gained) < 0.03 * R


def test_wheels_count_rolling_but_not_slipping(make: Make) -> None:
    """A robot against a wall does not roll; one pushed sideways does neither."""
    engine = build_engine(
        make, [[1.9, 0.0, 0.0], [0.0, 0.0, 0.0], [-2.0 * R - 1e-3, 0.0, 0.0], [0.0, 2 * R + 1e-3, -np.pi / 2]]
    )
    for _ in range(5):
        engine.tick(targets(engine, [0.2, 0.0, 0.0, 0.0]))
    stopped = engine.travel_m[0, 0].copy()
    for _ in range(20):
        engine.tick(targets(engine, [0.2, 0.0, 0.0, 0.2]))
    assert engine.travel_m[0, 0] == pytest.approx(stopped, abs=1e-3)
    assert engine.state[0, 1, 1] < -0.1
    assert np.abs(engine.travel_m[0, 1]).max() < 0.01
