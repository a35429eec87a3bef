"""Geometry: angles, cells and neighbours, obstacles and lines of sight."""

import math
from collections.abc import Callable
from math import cos, inf, pi, sin

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.base.angles import wrap_angle, wrap_angles, wrap_by_atan2, wrap_by_modulo
from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.geometry.floor import Floor, Patch, packed_image
from swarmwire.comms.base.geometry.ground import ground_of, shade_at, shades_over
from swarmwire.comms.base.geometry.obstacle_index import obstacles_near, obstacles_within, ray_to_obstacle
from swarmwire.comms.base.geometry.obstacles import obstacle_arrays, ray_to_circle, ray_to_polygon
from swarmwire.comms.base.geometry.robot_index import (
    MAX_CELLS_PER_SIDE,
    cells_around,
    column_of,
    grid_over,
    row_of,
    rows_in_order,
    run_near,
    runs_near,
    sort,
)
from swarmwire.comms.base.geometry.shapes import Obstacle
from swarmwire.comms.base.kernels import njit
from tests.support.comms.lines import indexed, is_blocked_on_floor

SIDES = st.floats(0.1, 50.0)
SIZE_M = (4.0, 2.0)
DISC = Patch("disc", 1.0, 0.0, 0.2, radius_m=0.5)
TRIANGLE = Patch("polygon", 1.0, 0.0, 0.4, points_m=((-0.2, -0.2), (0.2, -0.2), (0.0, 0.3)))
GREY = np.array([[0, 51, 102, 153], [255, 204, 153, 102]], np.uint8)  # each a square metre
FAR_M = 20.0
Depth = Callable[[FloatArray, FloatArray], FloatArray]
ARENAS = (
    (Obstacle("cylinder", 0.0, 0.0, radius_m=0.5), Obstacle("box", 2.0, 0.0, math.pi / 4, size_m=(1.0, 1.0))),
    (),
    (Obstacle("box", 0.0, 1.0, size_m=(4.0, 0.2)),),
)
OBSTACLE_ARENA_M = (6.0, 4.0)
compiled = njit()(wrap_angle)
ANGLES = st.floats(-50.0, 50.0) | st.integers(-9, 9).map(lambda half_turns: half_turns * math.pi)


@given(st.integers(0, 2**32 - 1), SIDES, SIDES, st.floats(0.01, 60.0), st.sampled_from(["open", "torus", "clamped"]))
def test_cells_around_a_robot_list_all_within_reach_once(
    seed: int, width_m: float, height_m: float, reach_m: float, kind: str
) -> None:
    random = np.random.default_rng(seed)
    x, y = (random.uniform(-2.0, 2.0, 60) * side for side in (width_m, height_m))
    grid = grid_over((width_m, height_m), reach_m, 3, 180, kind == "clamped")
    sort(grid, np.tile(np.column_stack([x, y]), (3, 1, 1)), np.ones(3, np.bool_))
    apart_x, apart_y = x[:, None] - x, y[:, None] - y
    if kind == "torus":
        apart_x, apart_y = (d - side * np.rint(d / side) for d, side in ((apart_x, width_m), (apart_y, height_m)))
    near = np.hypot(apart_x, apart_y) <= reach_m
    runs, cells = np.empty((6, 2), np.int64), np.empty(9, np.int64)
    for robot in range(60):
        arena, count = robot % 3, runs_near(runs, grid, robot % 3, x[robot], y[robot])
        listed = np.concatenate([grid.item[first:stop] for first, stop in runs[:count]])
        assert len(listed) == len(set(listed.tolist()))
        assert set(np.flatnonzero(near[robot]).tolist()) <= set(listed.tolist())
        if kind != "clamped":
            cell = cells[: cells_around(cells, grid, arena, x[robot], y[robot])]
            assert len(cell) == len(set(cell.tolist()))
            in_cells = np.concatenate([grid.item[grid.start[c] : grid.start[c + 1]] for c in cell])
            assert sorted(in_cells.tolist()) == sorted(listed.tolist())
        else:
            rows = [range(*run_near(grid, arena, x[robot], y[robot], offset)) for offset in (-1, 0, 1)]
            assert sorted(grid.item[[k for row in rows for k in row]].tolist()) == sorted(listed.tolist())


@given(st.integers(0, 2**32 - 1), st.lists(st.booleans(), min_size=1, max_size=4), st.integers(0, 20), st.booleans())
def test_grid_sorts_robots_of_running_arenas_by_cell(
    seed: int, are_running: list[bool], robots: int, clamps: bool
) -> None:
    arenas, running = len(are_running), np.array(are_running)
    state = np.random.default_rng(seed).uniform(-3.0, 3.0, (arenas, robots, 6))
    grid = grid_over((4.0, 3.0), 0.7, arenas, arenas * robots, clamps)
    for _ in range(2):  # sorting again starts afresh
        sort(grid, state, running)
    listed = {
        (a, j, i): grid.item[grid.start[c] : grid.start[c + 1]].tolist()
        for c, (a, j, i) in enumerate(np.ndindex(arenas, grid.ny, grid.nx))
    }
    expected = {key: list[int]() for key in listed}
    for a in np.flatnonzero(running):
        for robot in range(robots):
            expected[a, row_of(grid, state[a, robot, 1]), column_of(grid, state[a, robot, 0])].append(robot)
    assert listed == expected
    rows = [a * robots + robot for (a, _, _), items in expected.items() for robot in items]
    assert rows_in_order(grid, arenas, robots).tolist() == rows


@pytest.mark.parametrize("clamps", [False, True])
@pytest.mark.parametrize("reach_m", [1e-6, 1e6])
def test_grid_has_between_one_and_the_maximum_of_cells_per_side(reach_m: float, clamps: bool) -> None:
    grid = grid_over((100.0, 50.0), reach_m, 1, 1, clamps)
    assert 1 <= min(grid.nx, grid.ny) <= max(grid.nx, grid.ny) <= MAX_CELLS_PER_SIDE


@pytest.mark.parametrize("clamps", [False, True])
@pytest.mark.parametrize("reach_m", [0.5, 0.3, 1.0])
def test_grid_finds_neighbours_on_cell_borders(reach_m: float, clamps: bool) -> None:
    x = np.repeat(np.arange(-8, 9) * reach_m / 2, 17)
    y = np.tile(np.arange(-8, 9) * reach_m / 2, 17)
    grid = grid_over((4.0, 4.0), reach_m, 1, 289, clamps)
    sort(grid, np.column_stack([x, y])[None], np.ones(1, np.bool_))
    near = np.hypot(x[:, None] - x, y[:, None] - y) <= reach_m * (1.0 - 1e-12)
    runs = np.empty((6, 2), np.int64)
    for k in range(289):
        listed = {i for first, stop in runs[: runs_near(runs, grid, 0, x[k], y[k])] for i in grid.item[first:stop]}
        assert set(np.flatnonzero(near[k])) <= listed


def test_floor_shade_is_that_of_the_last_patch_rim_included():
    ground = ground_of(Floor(0.9, (DISC, TRIANGLE)), SIZE_M, "walls")
    at = {(1.0, 0.0): 0.4, (1.0, 0.3): 0.4, (1.2, -0.2): 0.4, (1.15, 0.2): 0.2, (1.5, 0.0): 0.2, (1.6, 0.0): 0.9}
    assert {point: shade_at(ground, *point) for point in at} == at
    assert shade_at(ground_of(Floor(0.9, (TRIANGLE, DISC)), SIZE_M, "walls"), 1.0, 0.0) == 0.2
    assert shade_at(ground_of(None, SIZE_M, "walls"), 0.3, 0.4) == 1.0


def test_floor_image_is_stretched_over_the_arena():
    ground = ground_of(Floor(0.5, (), packed_image(GREY)), SIZE_M, "walls")
    x, y = np.arange(-1.5, 2.0), (0.5, -0.5)
    assert [[shade_at(ground, at, up) for at in x] for up in y] == pytest.approx(GREY / 255.0)
    assert shades_over(ground, x, np.array(y)) == pytest.approx(GREY / 255.0)
    corners = [shade_at(ground, at, up) for at, up in ((-2.0, 1.0), (2.0, 1.0), (-2.0, -1.0), (2.0, -1.0))]
    assert corners == pytest.approx([0.0, 0.6, 1.0, 0.4])
    assert [shade_at(ground, 2.01, 0.0), shade_at(ground, 0.0, -1.01)] == [0.5, 0.5]
    assert shade_at(ground_of(Floor(0.5, (DISC,), packed_image(GREY)), SIZE_M, "walls"), 1.1, 0.1) == 0.2


def test_floor_wraps_on_a_torus():
    disc = Patch("disc", 1.9, 0.9, 0.2, radius_m=0.3)
    wrapped, cut = (ground_of(Floor(1.0, (disc,)), SIZE_M, boundary) for boundary in ("torus", "open"))
    for x, y in ((-1.9, 0.9), (1.9, -0.9), (-1.95, -0.95), (2.05, 1.05)):
        assert shade_at(wrapped, x, y) == 0.2
    assert [shade_at(cut, -1.9, 0.9), shade_at(cut, 2.05, 1.05)] == [1.0, 0.2]
    picture = ground_of(Floor(1.0, (), packed_image(GREY)), SIZE_M, "torus")
    for x, y in ((-1.5, 0.5), (0.5, -0.5)):
        assert {shade_at(picture, x + 4.0 * i, y + 2.0 * j) for i in (-1, 0, 1) for j in (-1, 0, 1)} == {
            shade_at(picture, x, y)
        }


def circle_depth(cx: float, cy: float, radius: float) -> Depth:
    """How far outside the circle points are, in m; negative inside."""
    return lambda x, y: np.hypot(x - cx, y - cy) - radius


def box_depth(box: FloatArray) -> Depth:
    """How far outside the box points are along its worse axis, in m; negative inside."""
    c, s = box[4], box[5]

    def depth(x: FloatArray, y: FloatArray) -> FloatArray:
        ox, oy = x - box[0], y - box[1]
        return np.maximum(np.abs(c * ox + s * oy) - box[2], np.abs(c * oy - s * ox) - box[3])

    return depth


def ray_to(obstacle: Obstacle, px: float, py: float, dx: float, dy: float) -> float:
    return ray_to_polygon(px, py, dx, dy, obstacle_arrays(((obstacle,),)), 0)


def check_ray(distance: float, depth: Depth, px: float, py: float, angle: float) -> None:
    """`distance` is that of the first point of the ray in the obstacle, by a fine search along the ray."""
    if distance == 0.0:
        assert depth(np.array(px), np.array(py)) <= 1e-12
        return
    dx, dy = math.cos(angle), math.sin(angle)
    along = np.linspace(0.0, min(distance, FAR_M), 4001)[:-1]
    assert np.all(depth(px + along * dx, py + along * dy) > -1e-9)
    if math.isfinite(distance):
        assert abs(depth(np.array(px + distance * dx), np.array(py + distance * dy))) < 1e-9


def check_rays(seed: int, least: list[float], most: list[float], scene: Callable[..., tuple[float, Depth]]) -> None:
    """Rays px, py, angle at shapes drawn between `least` and `most`: `scene` returns a ray's end and the depth."""
    random, kinds = np.random.default_rng(seed), set[str]()
    for px, py, angle, *shape in random.uniform([-3, -3, -4, *least], [3, 3, 4, *most], (300, 3 + len(least))):
        distance, depth = scene(random, px, py, math.cos(angle), math.sin(angle), *shape)
        check_ray(distance, depth, px, py, angle)
        kinds.add("inside" if distance == 0.0 else "miss" if math.isinf(distance) else "hit")
    assert kinds == {"inside", "miss", "hit"}


def test_ray_ends_at_the_first_point_of_a_circle() -> None:
    check_rays(1, [-3, -3, 0.1], [3, 3, 2], lambda _, *line: (ray_to_circle(*line), circle_depth(*line[4:])))


def test_ray_ends_at_the_first_point_of_a_box() -> None:
    def scene(_, px, py, dx, dy, cx, cy, half_length, half_width, heading):
        box = np.array([cx, cy, half_length, half_width, math.cos(heading), math.sin(heading)])
        obstacle = Obstacle("box", cx, cy, heading, size_m=(2 * half_length, 2 * half_width))
        return ray_to(obstacle, px, py, dx, dy), box_depth(box)

    check_rays(2, [-3, -3, 0.1, 0.1, -4], [3, 3, 2, 2, 4], scene)


@pytest.mark.parametrize(
    ("x", "y", "dx", "dy", "expected"),
    [
        (-3.0, 0.0, 1.0, 0.0, 2.0),
        (-3.0, 0.4, 1.0, 0.0, 2.0),
        (-3.0, 0.6, 1.0, 0.0, math.inf),  # beside it, parallel to a side
        (-3.0, 0.0, -1.0, 0.0, math.inf),  # behind
        (0.0, 3.0, 0.0, -1.0, 2.5),
        (0.9, 0.4, 1.0, 0.0, 0.0),  # from inside
    ],
)
def test_ray_along_the_sides_of_a_box(x: float, y: float, dx: float, dy: float, expected: float) -> None:
    assert ray_to(Obstacle("box", 0.0, 0.0, size_m=(2.0, 1.0)), x, y, dx, dy) == expected


def test_line_of_sight_is_equal_in_both_directions() -> None:
    obstacles = indexed(ARENAS, OBSTACLE_ARENA_M)
    for x0, y0, x1, y1 in np.random.default_rng(3).uniform(-3.0, 3.0, (500, 4)):
        assert is_blocked_on_floor(obstacles, 0, x0, y0, x1, y1) == is_blocked_on_floor(obstacles, 0, x1, y1, x0, y0)


def test_obstacle_arrays_are_grouped_by_arena_with_heights_that_default_to_infinity() -> None:
    obstacles = obstacle_arrays(ARENAS)
    assert obstacles.circle_start.tolist() == [0, 1, 1, 1]
    assert obstacles.polygon_start.tolist() == [0, 1, 1, 2]
    assert obstacles.circle.shape == (1, 3)
    assert obstacle_arrays(((), ())).polygon.shape == (0, 3)
    assert obstacles.side_start.tolist() == [0, 4, 8]
    low, high = Obstacle("cylinder", 0.0, 0.0, radius_m=0.1, height_m=0.2), Obstacle("cylinder", 1.0, 0.0, radius_m=0.1)
    box = Obstacle("box", 0.0, 1.0, size_m=(1.0, 1.0), height_m=0.5)
    arrays = obstacle_arrays(((box, low), (high, box)))
    assert arrays.circle_top_m.tolist() == [0.2, math.inf]
    assert arrays.polygon_top_m.tolist() == [0.5, 0.5]


def test_ray_ends_at_the_first_point_of_a_polygon() -> None:
    def scene(random, px, py, dx, dy, x, y, heading):
        corner_angles = np.sort(random.uniform(0.0, 2.0 * np.pi, random.integers(3, 9)))  # corners on a circle: convex
        points = tuple((1.5 * math.cos(a), 1.5 * math.sin(a)) for a in corner_angles)
        obstacle = Obstacle("polygon", x, y, heading, points_m=points)
        return ray_to(obstacle, px, py, dx, dy), polygon_depth(obstacle)

    check_rays(4, [-3, -3, -4], [3, 3, 4], scene)


def polygon_depth(obstacle: Obstacle) -> Depth:
    """How far outside the polygon points are, along the normal of their worst side, in m; negative inside."""
    corners = obstacle.corners_m
    along = np.roll(corners, -1, axis=0) - corners
    along /= np.hypot(*along.T)[:, None]

    def depth(x: FloatArray, y: FloatArray) -> FloatArray:
        ox, oy = x[..., None] - corners[:, 0], y[..., None] - corners[:, 1]
        return (ox * along[:, 1] - oy * along[:, 0]).max(-1)

    return depth


def test_box_equals_the_polygon_of_its_corners() -> None:
    box = Obstacle("box", 0.3, -0.2, 0.7, size_m=(1.0, 0.4))
    polygon = Obstacle("polygon", 0.3, -0.2, 0.7, points_m=((-0.5, -0.2), (0.5, -0.2), (0.5, 0.2), (-0.5, 0.2)))
    assert np.array_equal(box.corners_m, polygon.corners_m)
    for first, other in zip(obstacle_arrays(((box,),)), obstacle_arrays(((polygon,),)), strict=True):
        assert np.array_equal(first, other)
    assert Obstacle("cylinder", 0.0, 0.0, radius_m=1.0).corners_m.shape == (0, 2)


def obstacles(seed: int, count: int) -> tuple[Obstacle, ...]:
    """Cylinders, boxes, long walls and triangles, some reaching out of the arena."""
    random = np.random.default_rng(seed)
    shapes = list[Obstacle]()
    for k in range(count):
        (x, y), turn = (random.uniform(-0.5, 0.5, 2) * OBSTACLE_ARENA_M).tolist(), float(random.uniform(-pi, pi))
        points = tuple((0.3 * cos(a), 0.3 * sin(a)) for a in (0.1, 2.0, 4.0))
        shapes.append(
            (
                Obstacle("cylinder", x, y, radius_m=float(random.uniform(0.02, 0.4)), height_m=0.1),
                Obstacle("box", x, y, turn, size_m=(0.3, 0.2)),
                Obstacle("box", x, y, turn, size_m=(3.0, 0.05), height_m=0.2),
                Obstacle("polygon", x, y, turn, points_m=points),
            )[k % 4]
        )
    return tuple(shapes)


def distance(obstacle: Obstacle, x: float, y: float) -> float:
    """From a place to an obstacle, 0 from within."""
    if obstacle.shape == "cylinder":
        return max(np.hypot(x - obstacle.x_m, y - obstacle.y_m) - obstacle.radius_m, 0.0)
    corners = obstacle.corners_m
    ahead = np.roll(corners, -1, axis=0) - corners
    to = np.array([x, y]) - corners
    if np.all(ahead[:, 0] * to[:, 1] >= ahead[:, 1] * to[:, 0]):
        return 0.0
    share = np.clip((to * ahead).sum(axis=1) / (ahead**2).sum(axis=1), 0.0, 1.0)
    return float(np.hypot(*(to - share[:, None] * ahead).T).min())


def centre_of(obstacle: Obstacle) -> tuple[float, float]:
    """Its centre as the arrays have it."""
    x, y = (obstacle.x_m, obstacle.y_m) if obstacle.shape == "cylinder" else obstacle.corners_m.mean(axis=0).tolist()
    return round(x, 9), round(y, 9)


@pytest.mark.parametrize("reach_m", [0.0, 0.15, 1.0, 9.0])
@pytest.mark.parametrize("torus", [False, True])
def test_obstacles_within_reach_are_found_across_torus_edges(reach_m: float, torus: bool) -> None:
    arenas = obstacles(1, 24), (), obstacles(2, 8)
    things = obstacles_within(obstacle_arrays(arenas), OBSTACLE_ARENA_M, reach_m, torus)
    rows, random = np.empty(len(things.shape), np.int64), np.random.default_rng(3)
    turns = (-1, 0, 1) if torus else (0,)
    shifts = [(i * OBSTACLE_ARENA_M[0], j * OBSTACLE_ARENA_M[1]) for i in turns for j in turns]
    spread = 0.5 if torus else 0.8  # in the open, robots leave the arena
    for x, y in (random.uniform(-spread, spread, (8 if torus else 60, 2)) * OBSTACLE_ARENA_M).tolist():
        for arena, arena_obstacles in enumerate(arenas):
            count = obstacles_near(rows, things, arena, x, y, reach_m, 0.0)
            listed = {(round(a, 9), round(b, 9)) for a, b in things.shape[rows[:count], :2].tolist()}
            assert len(listed) == count
            for obstacle in arena_obstacles:
                for dx, dy in shifts:
                    at = centre_of(obstacle)
                    if distance(obstacle, x - dx, y - dy) < reach_m:
                        assert (round(at[0] + dx, 9), round(at[1] + dy, 9)) in listed


def test_obstacles_lower_than_the_ray_are_skipped() -> None:
    things = obstacles_within(obstacle_arrays((obstacles(4, 24),)), OBSTACLE_ARENA_M, 9.0, False)
    rows = np.empty(24, np.int64)
    counts = [obstacles_near(rows, things, 0, 0.0, 0.0, 9.0, low_m) for low_m in (0.0, 0.1, 0.15, 0.2, 5.0)]
    assert counts == [24, 18, 18, 12, 12]


def test_rays_to_indexed_obstacles_equal_rays_to_arrays() -> None:
    arrays = obstacle_arrays((obstacles(5, 12),))
    things, random = obstacles_within(arrays, OBSTACLE_ARENA_M, 1.0, False), np.random.default_rng(6)
    for x, y, angle in random.uniform(-3, 3, (50, 3)).tolist():
        ray = x, y, cos(angle), sin(angle)
        circles = [ray_to_circle(*ray, *circle) for circle in arrays.circle.tolist()]
        expected = [*circles, *(ray_to_polygon(*ray, arrays, k) for k in range(len(arrays.polygon)))]
        assert [ray_to_obstacle(*ray, things, k) for k in range(12)] == expected
        assert inf in expected


def test_obstacle_cells_of_a_large_map_are_short() -> None:
    side = np.arange(-19, 20) * 0.5
    boxes = tuple(Obstacle("box", x, y, size_m=(0.3, 0.3)) for x in side.tolist() for y in side.tolist())
    cells = obstacles_within(obstacle_arrays((boxes,)), (20.0, 20.0), 0.2, False).cells
    assert len(boxes) == 1521
    assert np.diff(cells.start).max() <= 4


@given(ANGLES)
def test_wrap_angle_is_bit_identical_in_python_numpy_and_kernels(angle: float):
    assert wrap_angle(angle) == wrap_angles(np.array([angle]))[0] == compiled(angle)


@given(ANGLES)
def test_wrapped_angle_lies_in_the_interval_and_keeps_its_direction(angle: float):
    wrapped = wrap_angle(angle)
    assert -math.pi < wrapped <= math.pi
    assert abs(math.remainder(wrapped - angle, math.tau)) < 1e-13
    for other in (wrap_by_atan2, wrap_by_modulo):
        assert -math.pi <= other(np.array(angle)) <= math.pi
        assert abs(math.remainder(float(other(np.array(angle))) - wrapped, math.tau)) < 1e-13


@given(st.floats(-3.0 * math.pi, 3.0 * math.pi))
def test_wrap_angle_is_the_exact_remainder_up_to_three_half_turns(angle: float):
    exact = math.remainder(angle, math.tau)
    assert wrap_angle(angle) == (exact if exact > -math.pi else math.pi) or abs(exact) == math.pi


def test_half_turn_wraps_to_plus_pi_or_by_modulo_to_minus_pi_and_nan_to_nan():
    ends = np.array([math.pi, -math.pi])
    assert wrap_angles(ends).tolist() == [math.pi, math.pi]
    assert wrap_by_modulo(ends).tolist() == [-math.pi, -math.pi]
    assert math.isnan(wrap_angle(math.nan))
    assert np.isnan(wrap_angles(np.array([math.nan]))).all()
    assert wrap_angles(np.array([4.0, 7.0])) == pytest.approx([4.0 - math.tau, 7.0 - math.tau])
