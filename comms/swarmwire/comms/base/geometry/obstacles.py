"""Obstacles as arrays, and ray intersections. Compiled; for the world's sensors and the medium's line of sight.

There are circles and convex polygons only: a box is a polygon with four sides.
"""

from typing import Any, NamedTuple

import numpy as np

from swarmwire.comms.base import math as portable
from swarmwire.comms.base.arrays import AnyArray, FloatArray, IntArray
from swarmwire.comms.base.geometry.shapes import Obstacle
from swarmwire.comms.base.kernels import njit


class Obstacles(NamedTuple):
    """The obstacles of every arena: those of arena a are rows start[a] to start[a + 1] - 1 of each kind."""

    circle_start: IntArray  #: (arenas + 1,)
    circle: FloatArray  #: (circles, 3) x, y, radius in m
    polygon_start: IntArray  #: (arenas + 1,)
    polygon: FloatArray  #: (polygons, 3) x, y, radius in m of a circle around it
    side_start: IntArray  #: (polygons + 1,) polygon k has the sides side_start[k] to side_start[k + 1] - 1
    side: FloatArray  #: (sides, 5) of `sides_of`
    circle_top_m: FloatArray  #: (circles,) height of the top; inf: above everything
    polygon_top_m: FloatArray  #: (polygons,) likewise


@njit()
def sides_of(corners: AnyArray):
    """Return the sides of a convex polygon with these corners (k, 2), counter-clockwise, as rows (k, 5).

    Each is the corner x, y where it starts, its outward unit normal, and the normal's product with the corner: points
    of the polygon have no greater product with any side's normal.
    """
    sides = np.empty((len(corners), 5))
    for i in range(len(corners)):
        # Number by number: assigning rows takes two seconds longer to compile.
        next_x, next_y = corners[(i + 1) % len(corners)]
        x, y = corners[i]
        along, up = next_x - x, next_y - y
        length = np.sqrt(along * along + up * up)
        nx, ny = up / length, -along / length
        sides[i, 0], sides[i, 1], sides[i, 2], sides[i, 3], sides[i, 4] = x, y, nx, ny, nx * x + ny * y
    return sides


def obstacle_arrays(arenas: tuple[tuple[Obstacle, ...], ...]) -> Obstacles:
    """Return the obstacles of each arena as arrays."""
    circles, polygons, sides = list[Any](), list[Any](), list[FloatArray]()
    tops: dict[bool, list[float]] = {True: [], False: []}  # heights of cylinders; of all other obstacles
    circle_start, polygon_start, side_start = [0], [0], [0]
    for obstacles in arenas:
        for o in obstacles:
            tops[o.shape == "cylinder"].append(o.height_m)
            if o.shape == "cylinder":
                circles.append((o.x_m, o.y_m, o.radius_m))
                continue
            corners = o.corners_m
            centre = portable.ordered_sum(corners.T) / len(corners)
            spokes_m: FloatArray = corners - centre
            polygons.append((*centre, portable.hypot(spokes_m[:, 0], spokes_m[:, 1]).max()))
            sides.append(sides_of(corners))
            side_start.append(side_start[-1] + len(corners))
        circle_start.append(len(circles))
        polygon_start.append(len(polygons))
    return Obstacles(
        np.array(circle_start, np.int64),
        np.array(circles, np.float64).reshape(-1, 3),
        np.array(polygon_start, np.int64),
        np.array(polygons, np.float64).reshape(-1, 3),
        np.array(side_start, np.int64),
        np.concatenate([np.empty((0, 5)), *sides]),
        np.array(tops[True], np.float64),
        np.array(tops[False], np.float64),
    )


@njit()
def ray_to_circle(px: float, py: float, dx: float, dy: float, cx: float, cy: float, radius: float):
    """Return the distance along the unit ray (dx, dy) from (px, py) to a circle; 0 from inside, inf if it misses."""
    ox, oy = cx - px, cy - py
    along = ox * dx + oy * dy
    apart2 = ox * ox + oy * oy - radius * radius
    if apart2 <= 0.0:
        return 0.0
    root2 = along * along - apart2
    if along < 0.0 or root2 < 0.0:
        return np.inf
    return along - np.sqrt(root2)


@njit()
def ray_to_polygon(px: float, py: float, dx: float, dy: float, obstacles: Any, k: int):
    """Return the distance to polygon k, like `ray_to_circle`: each side clips the ray (Cyrus and Beck, 1978)."""
    enter, leave = 0.0, np.inf
    for i in range(obstacles.side_start[k], obstacles.side_start[k + 1]):
        nx, ny = obstacles.side[i, 2], obstacles.side[i, 3]
        outside = nx * px + ny * py - obstacles.side[i, 4]
        speed = nx * dx + ny * dy
        if abs(speed) < 1e-12:
            if outside > 0.0:
                return np.inf
        elif speed < 0.0:
            enter = max(enter, -outside / speed)
        else:
            leave = min(leave, -outside / speed)
    return enter if enter <= leave else np.inf


@njit()
def to_nearest(away_m: float, side_m: float):
    """Return the number to add to a difference of coordinates on a torus for the shortest one; 0 if `side_m` is 0.

    A side of 0 stands for an axis along which an arena does not wrap around.
    """
    return -side_m * np.floor(away_m / side_m + 0.5) if side_m > 0.0 else 0.0
