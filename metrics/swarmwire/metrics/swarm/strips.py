"""The robots alive of an arena in strips along x, sorted by x within each, so that kernels look at near ones only.

Strip s holds the places start[s] to start[s + 1] - 1. On a torus a strip goes on after its last place with its first.
Compiled.
"""

# pyright: basic, reportUnknownMemberType=false

from typing import NamedTuple

import numpy as np

from swarmwire.comms.arrays import FloatArray, IntArray
from swarmwire.comms.kernels import kernel
from swarmwire.comms.truth import Static

SLACK = 1.0 + 1e-9  # two robots at just the height may be rounded apart
MIN_AROUND = 3  # strips around a torus, or a strip's neighbours above and below would be one


class Strips(NamedTuple):
    """Room for the strips of one arena at a time."""

    start: IntArray  # (robots + 2,)
    robot: IntArray  # (robots,) its index, at each place
    strip: IntArray  # (robots,) that the place is in
    x: FloatArray  # (robots,) m
    y: FloatArray  # (robots,) m


def room_for(static: Static) -> Strips:
    """Strips to be filled by `fill`."""
    n = static.robots
    places = np.zeros(n, np.int64), np.zeros(n, np.int64), np.zeros(n), np.zeros(n)
    return Strips(np.zeros(n + 2, np.int64), *places)


def first_order(static: Static) -> IntArray:
    """An order of each arena's robots, (arenas, robots), for `sort_by_x` to start from."""
    return np.tile(np.arange(static.robots), (static.arenas, 1))


@kernel()
def sort_by_x(order, pose):
    """Sort indices by x, equal ones by index; by insertion: what is nearly in order costs next to nothing."""
    for k in range(1, len(order)):
        moved, place = order[k], k
        x = pose[moved, 0]
        while place > 0:
            before = order[place - 1]
            if pose[before, 0] < x or (pose[before, 0] == x and before < moved):
                break
            order[place] = before
            place -= 1
        order[place] = moved


@kernel()
def fill(strips, order, pose, alive, height_m, most, side_y_m):
    """Sort the robots alive of an arena into strips: returns how many, the y of the lowest side, and the height, in m.

    Each is at least `height_m` high, so that what is nearer along y lies in the same strip or in a neighbouring one;
    there are `most` at most. `order` is sorted by x in place; `side_y_m` is that of a torus, else 0.
    """
    sort_by_x(order, pose)
    low_m, high_m, n = np.inf, -np.inf, 0
    for i in range(len(alive)):
        if alive[i]:
            low_m, high_m, n = min(low_m, pose[i, 1]), max(high_m, pose[i, 1]), n + 1
    if side_y_m > 0.0:
        low_m, high_m = -0.5 * side_y_m, 0.5 * side_y_m
    count, span_m = max(min(most, n), 1), high_m - low_m if n else 0.0
    if span_m < count * height_m * SLACK:
        count = max(int(span_m / (height_m * SLACK)), 1)
    if side_y_m > 0.0 and count < MIN_AROUND:
        count = 1
    per_m = count / span_m if span_m > 0.0 else 0.0
    start = strips.start
    start[: count + 2] = 0
    for i in range(len(alive)):
        if alive[i]:
            start[_strip_of(pose[i, 1], low_m, per_m, count) + 2] += 1
    for s in range(2, count + 2):
        start[s] += start[s - 1]
    for i in order:
        if alive[i]:
            s = _strip_of(pose[i, 1], low_m, per_m, count)
            place = start[s + 1]
            start[s + 1] += 1
            strips.robot[place], strips.strip[place] = i, s
            strips.x[place], strips.y[place] = pose[i, 0], pose[i, 1]
    return count, low_m, span_m / count


@kernel()
def _strip_of(y, low_m, per_m, count):
    return min(max(int((y - low_m) * per_m), 0), count - 1)


@kernel()
def place_at(low, size, v):
    """The v-th place of the strip that begins at `low`; on a torus -1 is its last, and `size` its first again."""
    return low + (v + size if v < 0 else v - size if v >= size else v)


@kernel()
def along_m(strips, a, low, size, v, side_x_m):
    """How far along x the v-th place of a strip is from place a, a turn of the torus on or back as v has it."""
    turn_m = -side_x_m if v < 0 else side_x_m if v >= size else 0.0
    return strips.x[place_at(low, size, v)] - strips.x[a] + turn_m
