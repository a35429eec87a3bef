"""Obstacles as arrays, and rays against them. Compiled; shared by the world's sensors and the air's line of sight."""

# pyright: basic, reportUnknownMemberType=false

from typing import NamedTuple

import numpy as np
from numba import njit

from swarmwire.comms.arrays import FloatArray, IntArray
from swarmwire.comms.truth import Obstacle


class Obstacles(NamedTuple):
    """The obstacles of every arena: those of arena a are rows start[a] to start[a + 1] - 1 of each kind."""

    circle_start: IntArray  # (arenas + 1,)
    circle: FloatArray  # (circles, 3) x, y, radius in m
    box_start: IntArray  # (arenas + 1,)
    box: FloatArray  # (boxes, 6) x, y, half length, half width in m, cosine and sine of the heading


def obstacle_arrays(arenas: tuple[tuple[Obstacle, ...], ...]) -> Obstacles:
    """The obstacles of each arena as arrays."""
    circles, boxes = [], []
    circle_start, box_start = [0], [0]
    for obstacles in arenas:
        for o in obstacles:
            if o.shape == "cylinder":
                circles.append((o.x_m, o.y_m, o.radius_m))
            else:
                half = 0.5 * o.size_m[0], 0.5 * o.size_m[1]
                boxes.append((o.x_m, o.y_m, *half, np.cos(o.heading_rad), np.sin(o.heading_rad)))
        circle_start.append(len(circles))
        box_start.append(len(boxes))
    return Obstacles(
        np.array(circle_start, np.int64),
        np.array(circles, np.float64).reshape(-1, 3),
        np.array(box_start, np.int64),
        np.array(boxes, np.float64).reshape(-1, 6),
    )


@njit(cache=True)
def ray_to_circle(px, py, dx, dy, cx, cy, radius):
    """Distance along the unit ray (dx, dy) from (px, py) to a circle; 0 from inside, inf if it misses."""
    ox, oy = cx - px, cy - py
    along = ox * dx + oy * dy
    apart2 = ox * ox + oy * oy - radius * radius
    if apart2 <= 0.0:
        return 0.0
    root2 = along * along - apart2
    if along < 0.0 or root2 < 0.0:
        return np.inf
    return along - np.sqrt(root2)


@njit(cache=True)
def ray_to_box(px, py, dx, dy, box):
    """As `ray_to_circle`, to a box (a row of `Obstacles.box`)."""
    c, s = box[4], box[5]
    ox, oy = px - box[0], py - box[1]
    x, y = c * ox + s * oy, c * oy - s * ox
    u, v = c * dx + s * dy, c * dy - s * dx
    enter, leave = 0.0, np.inf
    for at, step, half in ((x, u, box[2]), (y, v, box[3])):
        if abs(step) < 1e-12:
            if abs(at) > half:
                return np.inf
        else:
            near, far = (-half - at) / step, (half - at) / step
            enter, leave = max(enter, min(near, far)), min(leave, max(near, far))
    return enter if enter <= leave else np.inf


@njit(cache=True)
def is_blocked(obstacles, arena, x0, y0, x1, y1):
    """Whether an obstacle of the arena touches the straight line between two points."""
    dx, dy = x1 - x0, y1 - y0
    length = np.sqrt(dx * dx + dy * dy)
    if length == 0.0:
        return False
    dx, dy = dx / length, dy / length
    for i in range(obstacles.circle_start[arena], obstacles.circle_start[arena + 1]):
        circle = obstacles.circle[i]
        if ray_to_circle(x0, y0, dx, dy, circle[0], circle[1], circle[2]) <= length:
            return True
    for i in range(obstacles.box_start[arena], obstacles.box_start[arena + 1]):
        if ray_to_box(x0, y0, dx, dy, obstacles.box[i]) <= length:
            return True
    return False
