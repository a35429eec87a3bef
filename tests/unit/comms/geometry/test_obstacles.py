"""Rays, lines of sight and the index of obstacles: against fine searches, and by brute force."""

import math
from collections.abc import Callable
from math import cos, inf, pi, sin

import numpy as np
import pytest

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.geometry.obstacle_index import obstacles_near, obstacles_within, ray_to_obstacle
from swarmwire.comms.geometry.obstacles import is_blocked, obstacle_arrays, ray_to_circle, ray_to_polygon
from swarmwire.comms.truth import Obstacle

FAR_M = 20.0
Depth = Callable[[FloatArray, FloatArray], FloatArray]


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


def test_rays_end_where_they_first_meet_a_circle() -> None:
    random = np.random.default_rng(1)
    tx_status = set[str]()
    for px, py, angle, cx, cy, radius in random.uniform([-3, -3, -4, -3, -3, 0.1], [3, 3, 4, 3, 3, 2], (300, 6)):
        distance = ray_to_circle(px, py, math.cos(angle), math.sin(angle), cx, cy, radius)
        check_ray(distance, circle_depth(cx, cy, radius), px, py, angle)
        tx_status.add("inside" if distance == 0.0 else "miss" if math.isinf(distance) else "hit")
    assert tx_status == {"inside", "miss", "hit"}


def test_rays_end_where_they_first_meet_a_box() -> None:
    random = np.random.default_rng(2)
    tx_status = set[str]()
    for px, py, angle, *rest in random.uniform([-3, -3, -4, -3, -3, 0.1, 0.1, -4], [3, 3, 4, 3, 3, 2, 2, 4], (300, 8)):
        cx, cy, half_length, half_width, heading = rest
        box = np.array([cx, cy, half_length, half_width, math.cos(heading), math.sin(heading)])
        obstacle = Obstacle("box", cx, cy, heading, size_m=(2 * half_length, 2 * half_width))
        distance = ray_to(obstacle, px, py, math.cos(angle), math.sin(angle))
        check_ray(distance, box_depth(box), px, py, angle)
        tx_status.add("inside" if distance == 0.0 else "miss" if math.isinf(distance) else "hit")
    assert tx_status == {"inside", "miss", "hit"}


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
def test_rays_along_the_sides_of_a_box(x: float, y: float, dx: float, dy: float, expected: float) -> None:
    assert ray_to(Obstacle("box", 0.0, 0.0, size_m=(2.0, 1.0)), x, y, dx, dy) == expected


@pytest.mark.parametrize(
    ("x", "y", "expected"), [(-3.0, 0.0, 2.0), (3.0, 0.0, math.inf), (0.5, 0.0, 0.0), (-3.0, 1.1, math.inf)]
)
def test_rays_ahead_at_a_circle(x: float, y: float, expected: float) -> None:
    assert ray_to_circle(x, y, 1.0, 0.0, 0.0, 0.0, 1.0) == expected


ARENAS = (
    (Obstacle("cylinder", 0.0, 0.0, radius_m=0.5), Obstacle("box", 2.0, 0.0, math.pi / 4, size_m=(1.0, 1.0))),
    (),
    (Obstacle("box", 0.0, 1.0, size_m=(4.0, 0.2)),),
)


@pytest.mark.parametrize(
    ("arena", "line", "blocked"),
    [
        (0, (-1.0, 0.0, 1.0, 0.0), True),
        (0, (-1.0, 0.0, -0.6, 0.0), False),  # ends before the cylinder
        (0, (-1.0, 0.6, 1.0, 0.6), False),
        (0, (2.65, -1.0, 2.65, 1.0), True),  # the corner of the turned box
        (0, (2.75, -1.0, 2.75, 1.0), False),
        (1, (-1.0, 0.0, 1.0, 0.0), False),
        (2, (-1.0, 0.0, 1.0, 0.0), False),
        (2, (0.0, 0.0, 0.0, 2.0), True),
        (2, (1.0, 0.5, 1.0, 0.5), False),  # no line at all
    ],
)
def test_an_obstacle_blocks_lines_of_its_own_arena_only(
    arena: int, line: tuple[float, float, float, float], blocked: bool
) -> None:
    x0, y0, x1, y1 = line
    obstacles = obstacle_arrays(ARENAS)
    assert is_blocked(obstacles, arena, x0, y0, x1, y1) is blocked
    assert is_blocked(obstacles, arena, x1, y1, x0, y0) is blocked


def test_a_line_is_blocked_from_both_ends_alike() -> None:
    obstacles = obstacle_arrays(ARENAS)
    for x0, y0, x1, y1 in np.random.default_rng(3).uniform(-3.0, 3.0, (500, 4)):
        assert is_blocked(obstacles, 0, x0, y0, x1, y1) == is_blocked(obstacles, 0, x1, y1, x0, y0)


def test_obstacles_of_each_arena_stand_together() -> None:
    obstacles = obstacle_arrays(ARENAS)
    assert obstacles.circle_start.tolist() == [0, 1, 1, 1]
    assert obstacles.polygon_start.tolist() == [0, 1, 1, 2]
    assert obstacles.circle.shape == (1, 3)
    assert obstacle_arrays(((), ())).polygon.shape == (0, 3)
    assert obstacles.side_start.tolist() == [0, 4, 8]


def test_rays_end_where_they_first_meet_a_polygon() -> None:
    random = np.random.default_rng(4)
    tx_status = set[str]()
    for px, py, angle, x, y, heading in random.uniform([-3, -3, -4, -3, -3, -4], [3, 3, 4, 3, 3, 4], (300, 6)):
        around = np.sort(random.uniform(0.0, 2.0 * np.pi, random.integers(3, 9)))  # corners on a circle: convex
        points = tuple((1.5 * math.cos(a), 1.5 * math.sin(a)) for a in around)
        obstacle = Obstacle("polygon", x, y, heading, points_m=points)
        distance = ray_to(obstacle, px, py, math.cos(angle), math.sin(angle))
        check_ray(distance, polygon_depth(obstacle), px, py, angle)
        tx_status.add("inside" if distance == 0.0 else "miss" if math.isinf(distance) else "hit")
    assert tx_status == {"inside", "miss", "hit"}


def polygon_depth(obstacle: Obstacle) -> Depth:
    """How far outside the polygon points are, along the normal of their worst side, in m; negative inside."""
    corners = obstacle.corners_m
    along = np.roll(corners, -1, axis=0) - corners
    along /= np.hypot(*along.T)[:, None]

    def depth(x: FloatArray, y: FloatArray) -> FloatArray:
        ox, oy = x[..., None] - corners[:, 0], y[..., None] - corners[:, 1]
        return (ox * along[:, 1] - oy * along[:, 0]).max(-1)

    return depth


def test_a_box_is_a_polygon_with_its_corners() -> None:
    box = Obstacle("box", 0.3, -0.2, 0.7, size_m=(1.0, 0.4))
    polygon = Obstacle("polygon", 0.3, -0.2, 0.7, points_m=((-0.5, -0.2), (0.5, -0.2), (0.5, 0.2), (-0.5, 0.2)))
    assert np.array_equal(box.corners_m, polygon.corners_m)
    for one, other in zip(obstacle_arrays(((box,),)), obstacle_arrays(((polygon,),)), strict=True):
        assert np.array_equal(one, other)


def test_a_polygon_blocks_the_line_through_it() -> None:
    triangle = Obstacle("polygon", 0.0, 0.0, points_m=((0.0, 0.0), (1.0, 0.0), (0.0, 1.0)))
    obstacles = obstacle_arrays(((triangle,),))
    assert is_blocked(obstacles, 0, 0.6, 0.6, 0.2, 0.2)
    assert not is_blocked(obstacles, 0, 0.6, 0.6, 1.0, 0.1)
    assert not is_blocked(obstacles, 0, -0.1, -1.0, -0.1, 2.0)
    assert Obstacle("cylinder", 0.0, 0.0, radius_m=1.0).corners_m.shape == (0, 2)


def test_heights_stand_with_their_shapes_and_are_endless_if_left_out() -> None:
    low, high = Obstacle("cylinder", 0.0, 0.0, radius_m=0.1, height_m=0.2), Obstacle("cylinder", 1.0, 0.0, radius_m=0.1)
    box = Obstacle("box", 0.0, 1.0, size_m=(1.0, 1.0), height_m=0.5)
    arrays = obstacle_arrays(((box, low), (high, box)))
    assert arrays.circle_top_m.tolist() == [0.2, math.inf]
    assert arrays.polygon_top_m.tolist() == [0.5, 0.5]


SIZE_M = (6.0, 4.0)


def obstacles(seed: int, count: int) -> tuple[Obstacle, ...]:
    """Cylinders, boxes, long walls and triangles, some reaching out of the arena."""
    random = np.random.default_rng(seed)
    made = list[Obstacle]()
    for k in range(count):
        (x, y), turn = (random.uniform(-0.5, 0.5, 2) * SIZE_M).tolist(), float(random.uniform(-pi, pi))
        points = tuple((0.3 * cos(a), 0.3 * sin(a)) for a in (0.1, 2.0, 4.0))
        made.append(
            (
                Obstacle("cylinder", x, y, radius_m=float(random.uniform(0.02, 0.4)), height_m=0.1),
                Obstacle("box", x, y, turn, size_m=(0.3, 0.2)),
                Obstacle("box", x, y, turn, size_m=(3.0, 0.05), height_m=0.2),
                Obstacle("polygon", x, y, turn, points_m=points),
            )[k % 4]
        )
    return tuple(made)


def distance(of: Obstacle, x: float, y: float) -> float:
    """From a place to an obstacle, 0 from within."""
    if of.shape == "cylinder":
        return max(np.hypot(x - of.x_m, y - of.y_m) - of.radius_m, 0.0)
    corners = of.corners_m
    ahead = np.roll(corners, -1, axis=0) - corners
    to = np.array([x, y]) - corners
    if np.all(ahead[:, 0] * to[:, 1] >= ahead[:, 1] * to[:, 0]):
        return 0.0
    share = np.clip((to * ahead).sum(axis=1) / (ahead**2).sum(axis=1), 0.0, 1.0)
    return float(np.hypot(*(to - share[:, None] * ahead).T).min())


def place_of(of: Obstacle) -> tuple[float, float]:
    """Its centre as the arrays have it."""
    x, y = (of.x_m, of.y_m) if of.shape == "cylinder" else of.corners_m.mean(axis=0).tolist()
    return round(x, 9), round(y, 9)


@pytest.mark.parametrize("reach_m", [0.0, 0.15, 1.0, 9.0])
@pytest.mark.parametrize("torus", [False, True])
def test_all_within_reach_are_found_also_across_the_edges_of_a_torus(reach_m: float, torus: bool) -> None:
    arenas = obstacles(1, 24), (), obstacles(2, 8)
    things = obstacles_within(obstacle_arrays(arenas), SIZE_M, reach_m, torus)
    found, random = np.empty(len(things.shape), np.int64), np.random.default_rng(3)
    shifts = [(i * SIZE_M[0], j * SIZE_M[1]) for i in (-1, 0, 1) for j in (-1, 0, 1)] if torus else [(0.0, 0.0)]
    spread = 0.5 if torus else 0.8  # in the open, robots leave the arena
    for x, y in (random.uniform(-spread, spread, (8 if torus else 60, 2)) * SIZE_M).tolist():
        for arena, own in enumerate(arenas):
            count = obstacles_near(found, things, arena, x, y, reach_m, 0.0)
            listed = {(round(a, 9), round(b, 9)) for a, b in things.shape[found[:count], :2].tolist()}
            assert len(listed) == count
            for of in own:
                for dx, dy in shifts:
                    at = place_of(of)
                    if distance(of, x - dx, y - dy) < reach_m:
                        assert (round(at[0] + dx, 9), round(at[1] + dy, 9)) in listed


def test_obstacles_below_are_not_looked_at() -> None:
    things = obstacles_within(obstacle_arrays((obstacles(4, 24),)), SIZE_M, 9.0, False)
    found = np.empty(24, np.int64)
    counts = [obstacles_near(found, things, 0, 0.0, 0.0, 9.0, low_m) for low_m in (0.0, 0.1, 0.15, 0.2, 5.0)]
    assert counts == [24, 18, 18, 12, 12]


def test_rays_meet_what_they_meet_in_the_arrays() -> None:
    arrays = obstacle_arrays((obstacles(5, 12),))
    things, random = obstacles_within(arrays, SIZE_M, 1.0, False), np.random.default_rng(6)
    for x, y, angle in random.uniform(-3, 3, (50, 3)).tolist():
        ray = x, y, cos(angle), sin(angle)
        circles = [ray_to_circle(*ray, *circle) for circle in arrays.circle.tolist()]
        expected = [*circles, *(ray_to_polygon(*ray, arrays, k) for k in range(len(arrays.polygon)))]
        assert [ray_to_obstacle(*ray, things, k) for k in range(12)] == expected
        assert inf in expected


def test_a_robot_in_a_large_map_reads_a_short_list() -> None:
    side = np.arange(-19, 20) * 0.5
    boxes = tuple(Obstacle("box", x, y, size_m=(0.3, 0.3)) for x in side.tolist() for y in side.tolist())
    cells = obstacles_within(obstacle_arrays((boxes,)), (20.0, 20.0), 0.2, False).cells
    assert len(boxes) == 1521
    assert np.diff(cells.start).max() <= 4
