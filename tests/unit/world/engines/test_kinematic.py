"""Bodies without contacts go exactly where told, wrap on a torus, slide along what holds them back, and fly over."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.geometry.obstacles import obstacle_arrays
from swarmwire.comms.truth import Obstacle
from swarmwire.world.engines.engine import EngineConfig, Motors
from swarmwire.world.engines.kinematic import KinematicEngine

RADIUS_M, TICK_S = 0.05, 0.1
BOX = Obstacle("box", 1.0, 0.0, 0.3, size_m=(0.02, 1.0), height_m=0.5)
DISC = Obstacle("cylinder", 1.0, 0.0, radius_m=0.2, height_m=0.5)
TRIANGLE = Obstacle("polygon", 1.0, 0.0, 0.4, points_m=((-0.3, -0.2), (0.3, -0.2), (0.0, 0.4)), height_m=0.5)


def engine(
    pose: Any, obstacles: tuple[Obstacle, ...] = (), boundary: Any = "walls", bottom_m: Any = 0.0
) -> KinematicEngine:
    """Discs of RADIUS_M, 0.1 m high, at pose (n, 3) or (arenas, n, 3) in a square of 4 m."""
    at = np.array(pose, np.float64)
    at = at if at.ndim == 3 else at[None]
    n, standing = at.shape[1], (obstacles,) * len(at)
    bottom = np.broadcast_to(np.asarray(bottom_m, np.float64), n).copy()
    motors = Motors(*(np.full(n, value) for value in (0.06, 1.0, 1.0, 1.0, 1.0)))
    of = np.full(n, RADIUS_M), bottom, bottom + 0.1, motors
    return KinematicEngine(EngineConfig((4.0, 4.0), boundary, standing, obstacle_arrays(standing), *of, TICK_S, 5), at)


def target(*rows: tuple[float, float, float]) -> FloatArray:
    """Forward m/s, left turn rad/s, to the left m/s, of each robot of one arena."""
    return np.array([rows], np.float64)


@given(
    forward=st.floats(-1, 1),
    turn=st.floats(-5, 5),
    left=st.floats(-1, 1),
    heading=st.floats(-3, 3),
)
def test_a_robot_runs_the_exact_arc_at_once(forward: float, turn: float, left: float, heading: float) -> None:
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


def test_on_a_torus_positions_wrap_and_velocities_go_on() -> None:
    moved = engine([[1.9, -1.9, -np.pi / 4]], boundary="torus")
    for _ in range(20):
        assert not moved.tick(target((1.0, 0.0, 0.0))).any()
        assert np.abs(moved.state[0, 0, :2]).max() <= 2.0
        assert moved.state[0, 0, 3:5] == pytest.approx([np.sqrt(0.5), -np.sqrt(0.5)])
    way = 2.0 * np.sqrt(0.5)
    assert moved.state[0, 0, :2] == pytest.approx([1.9 + way - 4.0, -1.9 - way + 4.0])


def clear_m(obstacle: Obstacle, xy: FloatArray) -> float:
    """How far a point is from an obstacle's rim, by brute force over points of the rim."""
    if obstacle.shape == "cylinder":
        return float(np.hypot(*(xy - [obstacle.x_m, obstacle.y_m]))) - obstacle.radius_m
    corners = obstacle.corners_m
    share = np.linspace(0.0, 1.0, 2001)[:, None]
    rim = np.concatenate([a + share * (b - a) for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)])
    return float(np.hypot(*(rim - xy).T).min())


@pytest.mark.parametrize("obstacle", [BOX, DISC, TRIANGLE])
@pytest.mark.parametrize("heading", [0.0, 0.1, -0.15])
def test_an_obstacle_holds_a_fast_robot_back_and_it_slides_along(obstacle: Obstacle, heading: float) -> None:
    moved = engine([[0.0, 0.01, heading]], (obstacle,), "open")
    began, nearest = np.zeros(2, np.int64), np.inf
    for _ in range(12):
        began += moved.tick(target((3.0, 0.0, 0.0)))[0]
        nearest = min(nearest, clear_m(obstacle, moved.state[0, 0, :2]) - RADIUS_M)
        assert np.hypot(*moved.state[0, 0, 3:5]) <= 3.0 + 1e-9
    assert nearest == pytest.approx(0.0, abs=1e-6)
    assert began.tolist() == [0, 1]


def test_a_robot_that_drives_into_a_corner_stays_in_it() -> None:
    moved = engine([[1.5, 1.2, 0.7]])
    onsets = sum(moved.tick(target((1.0, 0.0, 0.0))) for _ in range(20))
    assert moved.state[0, 0, :2] == pytest.approx([2.0 - RADIUS_M] * 2)
    assert moved.state[0, 0, 3:5] == pytest.approx([0.0, 0.0], abs=1e-12)
    assert np.array_equal(onsets, [[0, 1]])
    assert moved.travel_m[0, 0].max() < 1.0


def test_a_wedge_that_leaves_no_room_is_not_driven_into() -> None:
    wedge = (
        Obstacle("box", 1.0, 0.3, 0.4, size_m=(1.2, 0.1)),
        Obstacle("box", 1.0, -0.3, -0.4, size_m=(1.2, 0.1)),
    )
    sides = tuple(Obstacle(o.shape, o.x_m, -o.y_m, o.heading_rad, size_m=o.size_m) for o in wedge)
    moved = engine([[0.0, 0.0, 0.0]], sides)
    for _ in range(60):
        moved.tick(target((0.5, 0.0, 0.0)))
        assert min(clear_m(o, moved.state[0, 0, :2]) for o in sides) >= RADIUS_M - 1e-6


@pytest.mark.parametrize(("bottom_m", "passes"), [(0.0, False), (0.49, False), (0.5, True), (2.0, True)])
def test_what_flies_at_an_obstacles_top_or_above_passes_over_it(bottom_m: float, passes: bool) -> None:
    moved = engine([[0.0, 0.0, 0.0]], (BOX, DISC), bottom_m=bottom_m)
    onsets = sum(moved.tick(target((1.0, 0.0, 0.0))) for _ in range(15))
    assert (moved.state[0, 0, 0] == pytest.approx(1.5)) == passes
    assert np.array_equal(onsets, [[0, 0 if passes else 1]])


def test_on_a_torus_an_obstacle_holds_back_across_the_border() -> None:
    post = (Obstacle("cylinder", -1.9, 0.0, radius_m=0.1), Obstacle("box", -1.9, 1.0, size_m=(0.2, 0.2)))
    moved = engine([[1.5, 0.0, 0.0], [1.5, 1.0, 0.0]], post, "torus")
    onsets = sum(moved.tick(target((1.0, 0.0, 0.0), (1.0, 0.0, 0.0))) for _ in range(10))
    assert moved.state[0, :, 0] == pytest.approx(2.0 - RADIUS_M)
    assert np.array_equal(onsets, [[0, 2]])


def test_robots_pass_through_one_another_and_each_overlap_counts_once() -> None:
    moved = engine([[-0.5, 0.02, 0.0], [0.5, 0.0, np.pi], [0.0, 1.0, 0.0]])
    for _ in range(2):
        onsets = sum(moved.tick(target((1.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 0.0))) for _ in range(8))
        assert np.array_equal(onsets, [[1, 0]])
        moved.state[0, :2, 2] += np.pi
    assert not moved.touched.any()


def test_robots_above_one_another_do_not_overlap() -> None:
    moved = engine([[-0.5, 0.0, 0.0], [0.5, 0.0, np.pi]], bottom_m=[0.0, 0.1])
    assert not sum(moved.tick(target((1.0, 0.0, 0.0), (1.0, 0.0, 0.0))) for _ in range(10)).any()


@pytest.mark.parametrize("boundary", ["open", "torus", "walls"])
@pytest.mark.parametrize("n", [2, 5, 90])
def test_overlaps_are_those_that_brute_force_finds(boundary: str, n: int) -> None:
    rng = np.random.default_rng(n)
    pose = rng.uniform(-1.95, 1.95, (3, n, 3))
    if n < 90:  # near the corners, so that there is something to find, also across the border
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
