"""Straight lines in space, and the upright bodies that they pass through. Compiled."""

# pyright: basic, reportUnknownMemberType=false

from typing import NamedTuple

import numpy as np

from swarmwire.comms.kernels import borrowing

NEVER = (np.inf, -np.inf)
END = 1.0 - 1e-6  # a LED on the skin of a body is not hidden by what it sits on


class SightLine(NamedTuple):
    """A line from an eye to what it looks at, in m; a share t of the way is at x + t dx and so on."""

    x: float
    y: float
    z: float
    dx: float
    dy: float
    dz: float


@borrowing()
def through_disc(line, cx, cy, radius):
    """Between which shares of the way, prolonged, the line is above or below a disc; inf, -inf if it misses it."""
    ox, oy = cx - line.x, cy - line.y
    length2 = line.dx * line.dx + line.dy * line.dy
    apart2 = ox * ox + oy * oy - radius * radius
    if length2 == 0.0:
        return (-np.inf, np.inf) if apart2 < 0.0 else NEVER
    along = ox * line.dx + oy * line.dy
    root2 = along * along - length2 * apart2
    if root2 <= 0.0:
        return NEVER
    root = np.sqrt(root2)
    return (along - root) / length2, (along + root) / length2


@borrowing()
def through_polygon(line, things, k):
    """As `through_disc`, for polygon k."""
    enter, leave = -np.inf, np.inf
    for i in range(things.side_start[k], things.side_start[k + 1]):
        nx, ny = things.side[i, 2], things.side[i, 3]
        outside = nx * line.x + ny * line.y - things.side[i, 4]
        speed = nx * line.dx + ny * line.dy
        if speed == 0.0:
            if outside >= 0.0:
                return NEVER
        elif speed < 0.0:
            enter = max(enter, -outside / speed)
        else:
            leave = min(leave, -outside / speed)
    return enter, leave


@borrowing()
def is_cut(line, enter, leave, bottom_m, top_m):
    """Whether the line, before it arrives, passes between two heights while it is between these shares of the way."""
    first, last = max(enter, 0.0), min(leave, END)
    if first >= last:
        return False
    one, other = line.z + first * line.dz, line.z + last * line.dz
    return min(one, other) < top_m and max(one, other) > bottom_m
