"""Occupancy of an arena during placement: obstacles and robots so far, and clearance tests for new ones. Compiled.

`obstacle_at` builds obstacles from the scenario's tables. `PlacedObstacles` collects the obstacles of one arena, and
makes the `Occupancy` that the clearance tests of discs and polygons use.
"""

# pyright: basic, reportUnknownMemberType=false

from collections.abc import Sequence
from math import inf
from typing import NamedTuple

import numpy as np

from swarmwire.comms.base.arrays import FloatArray, IntArray
from swarmwire.comms.base.geometry.obstacles import obstacle_arrays, sides_of
from swarmwire.comms.base.geometry.robot_index import Grid, cells_around, grid_over
from swarmwire.comms.base.geometry.shapes import Obstacle
from swarmwire.comms.base.kernels import njit
from swarmwire.comms.base.sentinels import NO_ROBOT
from swarmwire.comms.observe.truth import Group, Light
from swarmwire.world.placement.maps import Layout
from swarmwire.world.scenario.arena import ArenaTable, CylinderTable, ObstacleTable, PolygonTable

GAP_M = 1e-3  # least gap between two bodies at the start
ROUNDING_M = 1e-9


def obstacle_at(table: ObstacleTable, x_m: float, y_m: float, heading_rad: float) -> Obstacle:
    """Return the obstacle of a table at a pose in the arena."""
    height_m = inf if table.height_m is None else table.height_m
    if isinstance(table, CylinderTable):
        return Obstacle("cylinder", x_m, y_m, radius_m=table.radius_m, height_m=height_m, mass_kg=table.mass_kg)
    size_m, points = ((0.0, 0.0), table.points) if isinstance(table, PolygonTable) else (table.size_m, ())
    return Obstacle(
        table.shape, x_m, y_m, heading_rad, size_m=size_m, points_m=points, height_m=height_m, mass_kg=table.mass_kg
    )


def heading_of(table: ObstacleTable) -> float | None:
    """Return the heading in a table; None if it is random, and for a cylinder."""
    return None if isinstance(table, CylinderTable) else table.heading_rad


class Occupancy(NamedTuple):
    """The obstacles and robots in an arena so far. Robots by cell: head[cell], then next_robot[robot], until NO_ROBOT.

    The lists are linked, since robots are added one by one.
    """

    half_x_m: float  # half the extents of the arena
    half_y_m: float
    wraps: bool  # on a torus, where distances are the shortest
    circle: FloatArray  # (circles, 4) x, y, radius and height of round obstacles
    polygon: FloatArray  # (polygons, 4) x, y, radius of a circle around each, and its height
    side_start: IntArray  # (polygons + 1,) polygon k has the sides side_start[k] to side_start[k + 1] - 1
    side: FloatArray  # (sides, 5) the columns of `sides_of`
    cells: Grid  # the grid of `head`; its lists are empty
    head: IntArray  # (cells,) the last robot added to a cell
    next_robot: IntArray  # (robots,) the robot added to the same cell before
    robot: FloatArray  # (robots, 5) x, y, radius, height of its lower and of its upper side


class Disc(NamedTuple):
    """A disc to place: its radius, its least gap to others, and the heights at which it could touch them."""

    radius_m: float
    gap_m: float
    bottom_m: float
    top_m: float


@njit()
def on_torus(coordinate_m, half_m):
    """Return a coordinate on a torus, wrapped to -half_m to half_m."""
    return coordinate_m - 2.0 * half_m * np.floor((coordinate_m + half_m) / (2.0 * half_m))


@njit()
def _distance(x, y, sides):
    """Return the distance in m of a point from a convex polygon, 0 within."""
    within, least2 = True, np.inf
    for i in range(len(sides)):
        ax, ay = sides[i, 0], sides[i, 1]
        bx, by = sides[(i + 1) % len(sides), 0] - ax, sides[(i + 1) % len(sides), 1] - ay
        within = within and sides[i, 2] * x + sides[i, 3] * y <= sides[i, 4]
        share = min(max(((x - ax) * bx + (y - ay) * by) / (bx * bx + by * by), 0.0), 1.0)
        dx, dy = x - ax - share * bx, y - ay - share * by
        least2 = min(least2, dx * dx + dy * dy)
    return 0.0 if within else np.sqrt(least2)


@njit()
def disc_clear_of_obstacles(occupancy, x, y, disc):
    """Return True if a disc at x, y lies within the arena, or on the torus, and keeps clear of all obstacles."""
    if occupancy.wraps:
        for across in (-1, 0, 1):
            for up in (-1, 0, 1):
                if not _disc_clear_in_plane(
                    occupancy, x + 2 * across * occupancy.half_x_m, y + 2 * up * occupancy.half_y_m, disc
                ):
                    return False
        return True
    return within_arena(occupancy, x, y, disc.radius_m) and _disc_clear_in_plane(occupancy, x, y, disc)


@njit()
def within_arena(occupancy, x, y, radius_m):
    """Return True if a disc at x, y is clear of the walls, or of the border of an arena without walls."""
    reach = radius_m + GAP_M
    return abs(x) + reach <= occupancy.half_x_m and abs(y) + reach <= occupancy.half_y_m


@njit()
def _disc_clear_in_plane(occupancy, x, y, disc):
    reach = disc.radius_m + disc.gap_m
    for i in range(len(occupancy.circle)):
        dx, dy, apart = x - occupancy.circle[i, 0], y - occupancy.circle[i, 1], reach + occupancy.circle[i, 2]
        if dx * dx + dy * dy < apart * apart and occupancy.circle[i, 3] > disc.bottom_m:
            return False
    for k in range(len(occupancy.polygon)):
        dx, dy, reach_m = (
            x - occupancy.polygon[k, 0],
            y - occupancy.polygon[k, 1],
            reach + occupancy.polygon[k, 2] + ROUNDING_M,
        )
        if dx * dx + dy * dy > reach_m * reach_m or occupancy.polygon[k, 3] <= disc.bottom_m:
            continue
        if _distance(x, y, occupancy.side[occupancy.side_start[k] : occupancy.side_start[k + 1]]) < reach:
            return False
    return True


@njit()
def disc_clear_of_robots(occupancy, x, y, disc):
    """Return True if a disc at x, y keeps clear of all robots whose height it shares."""
    cell_buffer = np.empty(9, np.int64)
    for cell in cell_buffer[: cells_around(cell_buffer, occupancy.cells, 0, x, y)]:
        other = occupancy.head[cell]
        while other != NO_ROBOT:
            if _too_near(occupancy, x, y, disc, occupancy.robot[other]):
                return False
            other = occupancy.next_robot[other]
    return True


@njit()
def _too_near(occupancy, x, y, disc, other):
    dx, dy = x - other[0], y - other[1]
    if occupancy.wraps:
        dx, dy = on_torus(dx, occupancy.half_x_m), on_torus(dy, occupancy.half_y_m)
    apart = disc.radius_m + other[2] + disc.gap_m
    return dx * dx + dy * dy < apart * apart and other[4] > disc.bottom_m and disc.top_m > other[3]


@njit()
def _parted(a, b, gap_m):
    """Return True if all of polygon b is beyond a side of a, with a gap (half of the separating axis theorem)."""
    for i in range(len(a)):
        least = np.inf
        for j in range(len(b)):
            least = min(least, a[i, 2] * b[j, 0] + a[i, 3] * b[j, 1])
        if least - a[i, 4] >= gap_m:
            return True
    return False


@njit()
def polygon_clear_of_obstacles(occupancy, corners, gap_m):
    """Return True if a convex polygon, corners (k, 2) counter-clockwise, lies in the arena, clear of all obstacles."""
    for i in range(len(corners)):
        if abs(corners[i, 0]) + GAP_M > occupancy.half_x_m or abs(corners[i, 1]) + GAP_M > occupancy.half_y_m:
            return False
    if not occupancy.wraps:
        return _polygon_clear_in_plane(occupancy, sides_of(corners), gap_m)
    for across in (-1, 0, 1):
        for up in (-1, 0, 1):
            image = corners + np.array([2 * across * occupancy.half_x_m, 2 * up * occupancy.half_y_m])
            if not _polygon_clear_in_plane(occupancy, sides_of(image), gap_m):
                return False
    return True


@njit()
def _polygon_clear_in_plane(occupancy, sides, gap_m):
    for i in range(len(occupancy.circle)):
        if _distance(occupancy.circle[i, 0], occupancy.circle[i, 1], sides) < occupancy.circle[i, 2] + gap_m:
            return False
    for k in range(len(occupancy.polygon)):
        other = occupancy.side[occupancy.side_start[k] : occupancy.side_start[k + 1]]
        if not (_parted(sides, other, gap_m) or _parted(other, sides, gap_m)):
            return False
    return True


class PlacedObstacles:
    """The obstacles of one arena so far, as arrays with room for all; those of map and buildings are first."""

    def __init__(self, arena: ArenaTable, layout: Layout) -> None:
        self._size_m, self._wraps = layout.size_m, arena.boundary == "torus"
        fixed = obstacle_arrays((layout.obstacles,))
        count = sum(table.count for table in arena.obstacles)
        sides = sum(_sides(table) * table.count for table in arena.obstacles)
        self._circle = np.concatenate([_with_top(fixed.circle, fixed.circle_top_m), np.empty((count, 4))])
        self._polygon = np.concatenate([_with_top(fixed.polygon, fixed.polygon_top_m), np.empty((count, 4))])
        self._side = np.concatenate([fixed.side, np.empty((sides, 5))])
        self._side_start = np.concatenate([fixed.side_start, np.zeros(count, np.int64)])
        self._circles, self._polygons = len(fixed.circle), len(fixed.polygon)

    def add(self, obstacle: Obstacle) -> Obstacle:
        """Add an obstacle, and return it."""
        shape = obstacle_arrays(((obstacle,),))
        if len(shape.circle):
            self._circle[self._circles] = _with_top(shape.circle, shape.circle_top_m)[0]
            self._circles += 1
        else:
            first = self._side_start[self._polygons]
            self._side[first : first + len(shape.side)] = shape.side
            self._polygon[self._polygons] = _with_top(shape.polygon, shape.polygon_top_m)[0]
            self._polygons += 1
            self._side_start[self._polygons] = first + len(shape.side)
        return obstacle

    def occupancy(self, groups: Sequence[Group] = (), gap_m: float = 0.0, lights: Sequence[Light] = ()) -> Occupancy:
        """Return the occupancy for kernels, with room for robots of these groups, whose least gap is at most `gap_m`.

        `lights` are points that count as obstacles.
        """
        width, height = self._size_m
        max_radius_m = max((group.body.radius_m for group in groups), default=max(width, height))
        cells = grid_over(self._size_m, 2.0 * max_radius_m + gap_m, 1, 0)
        robots = groups[-1].stop if groups else 0
        circle, side_start = self._circle[: self._circles], self._side_start[: self._polygons + 1]
        if lights:
            points = np.array([(light.x_m, light.y_m, 0.0, np.inf) for light in lights])
            circle = np.concatenate([circle, points])
        return Occupancy(
            half_x_m=0.5 * width,
            half_y_m=0.5 * height,
            wraps=self._wraps,
            circle=circle,
            polygon=self._polygon[: self._polygons],
            side_start=side_start,
            side=self._side[: side_start[-1]],
            cells=cells,
            head=np.full(cells.ny * cells.nx, NO_ROBOT, np.int64),
            next_robot=np.full(robots, NO_ROBOT, np.int64),
            robot=np.zeros((robots, 5)),
        )


def _with_top(shape: FloatArray, top_m: FloatArray) -> FloatArray:
    return np.concatenate([shape, top_m[:, None]], axis=1)


def _sides(table: ObstacleTable) -> int:
    return 0 if isinstance(table, CylinderTable) else len(obstacle_at(table, 0.0, 0.0, 0.0).corners_m)
