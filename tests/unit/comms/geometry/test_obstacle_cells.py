"""The list of a robot's cell holds every obstacle within its reach, and in a large map only a few others."""

from math import cos, inf, pi, sin

import numpy as np
import pytest

from swarmwire.comms.geometry.obstacle_cells import near_things, ray_to_thing, things_within
from swarmwire.comms.geometry.obstacles import obstacle_arrays, ray_to_circle, ray_to_polygon
from swarmwire.comms.truth import Obstacle

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
    things = things_within(obstacle_arrays(arenas), SIZE_M, reach_m, torus)
    found, random = np.empty(len(things.shape), np.int64), np.random.default_rng(3)
    shifts = [(i * SIZE_M[0], j * SIZE_M[1]) for i in (-1, 0, 1) for j in (-1, 0, 1)] if torus else [(0.0, 0.0)]
    spread = 0.5 if torus else 0.8  # in the open, robots leave the arena
    for x, y in (random.uniform(-spread, spread, (60, 2)) * SIZE_M).tolist():
        for arena, own in enumerate(arenas):
            count = near_things(found, things, arena, x, y, reach_m, 0.0)
            listed = {(round(a, 9), round(b, 9)) for a, b in things.shape[found[:count], :2].tolist()}
            assert len(listed) == count
            for of in own:
                for dx, dy in shifts:
                    at = place_of(of)
                    if distance(of, x - dx, y - dy) < reach_m:
                        assert (round(at[0] + dx, 9), round(at[1] + dy, 9)) in listed


def test_obstacles_below_are_not_looked_at() -> None:
    things = things_within(obstacle_arrays((obstacles(4, 24),)), SIZE_M, 9.0, False)
    found = np.empty(24, np.int64)
    counts = [near_things(found, things, 0, 0.0, 0.0, 9.0, low_m) for low_m in (0.0, 0.1, 0.15, 0.2, 5.0)]
    assert counts == [24, 18, 18, 12, 12]


def test_rays_meet_what_they_meet_in_the_arrays() -> None:
    arrays = obstacle_arrays((obstacles(5, 12),))
    things, random = things_within(arrays, SIZE_M, 1.0, False), np.random.default_rng(6)
    for x, y, angle in random.uniform(-3, 3, (50, 3)).tolist():
        ray = x, y, cos(angle), sin(angle)
        circles = [ray_to_circle(*ray, *circle) for circle in arrays.circle.tolist()]
        expected = [*circles, *(ray_to_polygon(*ray, arrays, k) for k in range(len(arrays.polygon)))]
        assert [ray_to_thing(*ray, things, k) for k in range(12)] == expected
        assert inf in expected


def test_a_robot_in_a_large_map_reads_a_short_list() -> None:
    side = np.arange(-19, 20) * 0.5
    boxes = tuple(Obstacle("box", x, y, size_m=(0.3, 0.3)) for x in side.tolist() for y in side.tolist())
    cells = things_within(obstacle_arrays((boxes,)), (20.0, 20.0), 0.2, False).cells
    assert len(boxes) == 1521
    assert np.diff(cells.start).max() <= 4
