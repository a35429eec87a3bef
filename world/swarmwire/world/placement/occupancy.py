"""Obstacles from the scenario's tables."""

# pyright: basic, reportUnknownMemberType=false

from collections.abc import Sequence
from math import inf
from typing import NamedTuple

import numpy as np
from numba import njit

from swarmwire.comms.arrays import FloatArray, IntArray
from swarmwire.comms.geometry.obstacles import obstacle_arrays, sides_of
from swarmwire.comms.geometry.robot_index import MAX_CELLS_PER_SIDE, cell_of
from swarmwire.comms.truth import Group, Light, Obstacle
from swarmwire.world.placement.maps import Layout
from swarmwire.world.scenario.tables import ArenaTable, CylinderTable, ObstacleTable, PolygonTable


def obstacle_at(table: ObstacleTable, x_m: float, y_m: float, heading_rad: float) -> Obstacle:
    """The obstacle that a table describes, put at a place in the arena."""
    height_m = inf if table.height_m is None else table.height_m
    if isinstance(table, CylinderTable):
        return Obstacle("cylinder", x_m, y_m, radius_m=table.radius_m, height_m=height_m, mass_kg=table.mass_kg)
    size_m, points = ((0.0, 0.0), table.points) if isinstance(table, PolygonTable) else (table.size_m, ())
    return Obstacle(
        table.shape, x_m, y_m, heading_rad, size_m=size_m, points_m=points, height_m=height_m, mass_kg=table.mass_kg
    )


def heading_of(table: ObstacleTable) -> float | None:
    """The heading that a table asks for, if any; a cylinder has none."""
    return None if isinstance(table, CylinderTable) else table.heading_rad


def extent(obstacle: Obstacle) -> tuple[FloatArray, FloatArray]:
    """The least and the greatest x, y of an obstacle, (2,) each, in m, arena frame."""
    if obstacle.shape == "cylinder":
        centre = np.array([obstacle.x_m, obstacle.y_m])
        return centre - obstacle.radius_m, centre + obstacle.radius_m
    corners = obstacle.corners_m
    return corners.min(axis=0), corners.max(axis=0)


# --- What stands in an arena so far, and whether a disc or a polygon is clear of it. Compiled.


GAP_M = 1e-3  # least free space between two things at the start
ROUNDING_M = 1e-9


class Occupancy(NamedTuple):
    """What stands in an arena so far. Robots are found by cell: head[cell], then follow[robot], until -1."""

    half_x_m: float  # of the arena
    half_y_m: float
    wraps: bool  # on a torus, where distances are the shortest
    circle: FloatArray  # (circles, 4) x, y, radius and height of round obstacles
    around: FloatArray  # (polygons, 4) x, y, radius of a circle around each, and its height
    side_start: IntArray  # (polygons + 1,) polygon k has the sides side_start[k] to side_start[k + 1] - 1
    side: FloatArray  # (sides, 5) as `sides_of` has them
    cell_m: float
    head: IntArray  # (ny, nx) last robot put into a cell
    follow: IntArray  # (robots,) the robot put there before
    robot: FloatArray  # (robots, 5) x, y, radius, height of its lower and of its upper side


class Disc(NamedTuple):
    """What finds a place: a disc, how far it is to keep from others, and the heights at which it could touch them."""

    radius_m: float
    gap_m: float
    bottom_m: float
    top_m: float


@njit(cache=True)
def on_torus(at_m, half_m):
    """The place on a torus as a coordinate from -half_m to half_m."""
    return at_m - 2.0 * half_m * np.floor((at_m + half_m) / (2.0 * half_m))


@njit(cache=True)
def _distance(x, y, sides):
    """Distance in m of a point from a convex polygon, 0 within."""
    within, least2 = True, np.inf
    for i in range(len(sides)):
        ax, ay = sides[i, 0], sides[i, 1]
        bx, by = sides[(i + 1) % len(sides), 0] - ax, sides[(i + 1) % len(sides), 1] - ay
        within = within and sides[i, 2] * x + sides[i, 3] * y <= sides[i, 4]
        share = min(max(((x - ax) * bx + (y - ay) * by) / (bx * bx + by * by), 0.0), 1.0)
        dx, dy = x - ax - share * bx, y - ay - share * by
        least2 = min(least2, dx * dx + dy * dy)
    return 0.0 if within else np.sqrt(least2)


@njit(cache=True)
def disc_clear_of_obstacles(taken, x, y, disc):
    """Whether a disc at x, y lies within the arena, or on the torus, and keeps clear of all obstacles."""
    if taken.wraps:
        for across in (-1, 0, 1):
            for up in (-1, 0, 1):
                if not _disc_clear_here(taken, x + 2 * across * taken.half_x_m, y + 2 * up * taken.half_y_m, disc):
                    return False
        return True
    return within_arena(taken, x, y, disc.radius_m) and _disc_clear_here(taken, x, y, disc)


@njit(cache=True)
def within_arena(taken, x, y, radius_m):
    """Whether a disc at x, y is clear of where the walls are, or would be."""
    reach = radius_m + GAP_M
    return abs(x) + reach <= taken.half_x_m and abs(y) + reach <= taken.half_y_m


@njit(cache=True)
def _disc_clear_here(taken, x, y, disc):
    reach = disc.radius_m + disc.gap_m
    for i in range(len(taken.circle)):
        dx, dy, apart = x - taken.circle[i, 0], y - taken.circle[i, 1], reach + taken.circle[i, 2]
        if dx * dx + dy * dy < apart * apart and taken.circle[i, 3] > disc.bottom_m:
            return False
    for k in range(len(taken.around)):
        dx, dy, near = x - taken.around[k, 0], y - taken.around[k, 1], reach + taken.around[k, 2] + ROUNDING_M
        if dx * dx + dy * dy > near * near or taken.around[k, 3] <= disc.bottom_m:
            continue
        if _distance(x, y, taken.side[taken.side_start[k] : taken.side_start[k + 1]]) < reach:
            return False
    return True


@njit(cache=True)
def disc_clear_of_robots(taken, x, y, disc):
    """Whether a disc at x, y keeps clear of all robots whose height it shares."""
    ny, nx = taken.head.shape
    column = cell_of(x, -taken.half_x_m, taken.cell_m, nx)
    row = cell_of(y, -taken.half_y_m, taken.cell_m, ny)
    # On a torus the last cell may be cut, so that two cells hold what one would.
    cells = 2 if taken.wraps else 1
    for j in range(row - cells, row + cells + 1):
        for i in range(column - cells, column + cells + 1):
            if not taken.wraps and not (0 <= j < ny and 0 <= i < nx):
                continue
            other = taken.head[j % ny, i % nx]
            while other >= 0:
                if _too_near(taken, x, y, disc, taken.robot[other]):
                    return False
                other = taken.follow[other]
    return True


@njit(cache=True)
def _too_near(taken, x, y, disc, other):
    dx, dy = x - other[0], y - other[1]
    if taken.wraps:
        dx, dy = on_torus(dx, taken.half_x_m), on_torus(dy, taken.half_y_m)
    apart = disc.radius_m + other[2] + disc.gap_m
    return dx * dx + dy * dy < apart * apart and other[4] > disc.bottom_m and disc.top_m > other[3]


@njit(cache=True)
def _parted(a, b, gap_m):
    """Whether a side of polygon a has all of b beyond it, with a gap (half of the separating axis theorem)."""
    for i in range(len(a)):
        least = np.inf
        for j in range(len(b)):
            least = min(least, a[i, 2] * b[j, 0] + a[i, 3] * b[j, 1])
        if least - a[i, 4] >= gap_m:
            return True
    return False


@njit(cache=True)
def polygon_clear_of_obstacles(taken, corners, gap_m):
    """Whether a convex polygon, corners (k, 2) counter-clockwise, lies within the arena, clear of all obstacles."""
    for i in range(len(corners)):
        if abs(corners[i, 0]) + GAP_M > taken.half_x_m or abs(corners[i, 1]) + GAP_M > taken.half_y_m:
            return False
    if not taken.wraps:
        return _polygon_clear_here(taken, sides_of(corners), gap_m)
    for across in (-1, 0, 1):
        for up in (-1, 0, 1):
            there = corners + np.array([2 * across * taken.half_x_m, 2 * up * taken.half_y_m])
            if not _polygon_clear_here(taken, sides_of(there), gap_m):
                return False
    return True


@njit(cache=True)
def _polygon_clear_here(taken, sides, gap_m):
    for i in range(len(taken.circle)):
        if _distance(taken.circle[i, 0], taken.circle[i, 1], sides) < taken.circle[i, 2] + gap_m:
            return False
    for k in range(len(taken.around)):
        other = taken.side[taken.side_start[k] : taken.side_start[k + 1]]
        if not (_parted(sides, other, gap_m) or _parted(other, sides, gap_m)):
            return False
    return True


# --- The obstacles that stand in an arena so far, for whatever is to find a place among them.


class PlacementRules:
    """The obstacles of one arena as arrays with room for all that will stand there; those of the map are the first."""

    def __init__(self, arena: ArenaTable, layout: Layout) -> None:
        self._size_m, self._wraps = layout.size_m, arena.boundary == "torus"
        boxes = obstacle_arrays((layout.boxes,))
        count = sum(table.count for table in arena.obstacles)
        sides = sum(_sides(table) * table.count for table in arena.obstacles)
        self._circle = np.empty((count, 4))
        self._around = np.concatenate([_with_top(boxes.polygon, boxes.polygon_top_m), np.empty((count, 4))])
        self._side = np.concatenate([boxes.side, np.empty((sides, 5))])
        self._side_start = np.concatenate([boxes.side_start, np.zeros(count, np.int64)])
        self._circles, self._polygons = 0, len(boxes.polygon)

    def add(self, obstacle: Obstacle) -> Obstacle:
        """Note an obstacle."""
        shape = obstacle_arrays(((obstacle,),))
        if len(shape.circle):
            self._circle[self._circles] = _with_top(shape.circle, shape.circle_top_m)[0]
            self._circles += 1
        else:
            first = self._side_start[self._polygons]
            self._side[first : first + len(shape.side)] = shape.side
            self._around[self._polygons] = _with_top(shape.polygon, shape.polygon_top_m)[0]
            self._polygons += 1
            self._side_start[self._polygons] = first + len(shape.side)
        return obstacle

    def taken(self, groups: Sequence[Group] = (), gap_m: float = 0.0, lights: Sequence[Light] = ()) -> Occupancy:
        """What kernels look at, with room to note the robots of these groups, which keep at most `gap_m` apart.

        `lights` are points to keep away from, too.
        """
        width, height = self._size_m
        widest = max((group.body.radius_m for group in groups), default=max(width, height))
        cell_m = max(2.0 * widest + gap_m, max(width, height) / MAX_CELLS_PER_SIDE)
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
            around=self._around[: self._polygons],
            side_start=side_start,
            side=self._side[: side_start[-1]],
            cell_m=cell_m,
            head=np.full((int(np.ceil(height / cell_m)), int(np.ceil(width / cell_m))), -1, np.int64),
            follow=np.full(robots, -1, np.int64),
            robot=np.zeros((robots, 5)),
        )


def _with_top(shape: FloatArray, top_m: FloatArray) -> FloatArray:
    return np.concatenate([shape, top_m[:, None]], axis=1)


def _sides(table: ObstacleTable) -> int:
    return 0 if isinstance(table, CylinderTable) else len(obstacle_at(table, 0.0, 0.0, 0.0).corners_m)
