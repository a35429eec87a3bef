"""Pairs of robots alive that are near each other, from strips of the arenas along x, each sorted by x. Compiled.

Strip s has the slots start[s] to start[s + 1] - 1. On a torus a strip continues after its last slot with its first.
"""

# pyright: basic, reportUnknownMemberType=false

from typing import NamedTuple

import numpy as np

from swarmwire.comms.base.arrays import FloatArray, IntArray
from swarmwire.comms.base.geometry.obstacles import to_nearest
from swarmwire.comms.base.kernels import kernel, njit
from swarmwire.comms.observe.truth import Static
from swarmwire.metrics.measures.metric import TickView
from swarmwire.metrics.measures.torus import sides_m

SLACK = 1.0 + 1e-9  # strips are this much higher, against rounding
MIN_TORUS_STRIPS = 3  # fewer strips would make a strip's neighbours above and below the same


def radii_m(static: Static) -> FloatArray:
    """Return the radius of each robot of an arena, (robots,)."""
    return np.concatenate([np.full(group.stop - group.start, group.body.radius_m) for group in static.groups])


class Strips(NamedTuple):
    """Arrays for the strips of one arena at a time; slots are sorted by strip and x."""

    start: IntArray  # (robots + 2,) first slot of each strip
    robot: IntArray  # (robots,) index of the robot in each slot
    strip: IntArray  # (robots,) strip of each slot
    x: FloatArray  # (robots,) m
    y: FloatArray  # (robots,) m


class Reach(NamedTuple):
    """Distances below which robots are near: of i and j, reach_m[i] + reach_m[j]."""

    reach_m: FloatArray  # (robots,)
    largest_m: float
    wrap_m: tuple[float, float]  # sides of a torus, else 0


class Range(NamedTuple):
    """A range of a strip's slots, counted from `low`; on a torus below 0 and above `size`, too."""

    low: int  # first slot of the strip
    size: int  # slots of the strip
    first: int
    end: int
    max_m: float  # upper bound along x


def allocate_strips(static: Static) -> Strips:
    """Return arrays for `fill`."""
    n = static.robots
    return Strips(np.zeros(n + 2, np.int64), np.zeros(n, np.int64), np.zeros(n, np.int64), np.zeros(n), np.zeros(n))


def initial_order(static: Static) -> IntArray:
    """Return an order of each arena's robots, (arenas, robots), as the initial one for `sort_by_x`."""
    return np.tile(np.arange(static.robots), (static.arenas, 1))


@kernel()
def sort_by_x(order, pose):
    """Sort indices by x, then by index; insertion sort, since the order of the last tick is nearly right."""
    for k in range(1, len(order)):
        moved, slot = order[k], k
        x = pose[moved, 0]
        while slot > 0:
            before = order[slot - 1]
            if pose[before, 0] < x or (pose[before, 0] == x and before < moved):
                break
            order[slot] = before
            slot -= 1
        order[slot] = moved


@kernel()
def fill(strips, order, pose, alive, height_m, max_strips, side_y_m):
    """Sort the robots alive of an arena into strips; return their number, the lowest y, and their height in m.

    Each strip is at least `height_m` high, so that robots within `height_m` along y are in the same strip or in
    neighbouring ones; there are `max_strips` at most. `order` is sorted by x in place; `side_y_m` is the side of a
    torus, else 0.
    """
    sort_by_x(order, pose)
    low_m, high_m, n = np.inf, -np.inf, 0
    for i in range(len(alive)):
        if alive[i]:
            low_m, high_m, n = min(low_m, pose[i, 1]), max(high_m, pose[i, 1]), n + 1
    if side_y_m > 0.0:
        low_m, high_m = -0.5 * side_y_m, 0.5 * side_y_m
    count, span_m = max(min(max_strips, n), 1), high_m - low_m if n else 0.0
    if span_m < count * height_m * SLACK:
        count = max(int(span_m / (height_m * SLACK)), 1)
    if side_y_m > 0.0 and count < MIN_TORUS_STRIPS:
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
            slot = start[s + 1]
            start[s + 1] += 1
            strips.robot[slot], strips.strip[slot] = i, s
            strips.x[slot], strips.y[slot] = pose[i, 0], pose[i, 1]
    return count, low_m, span_m / count


@kernel()
def _strip_of(y, low_m, per_m, count):
    return min(max(int((y - low_m) * per_m), 0), count - 1)


@kernel()
def wrapped_slot(low, size, v):
    """Return the v-th slot of the strip that begins at `low`; on a torus -1 is its last, and `size` its first again."""
    return low + (v + size if v < 0 else v - size if v >= size else v)


@kernel()
def along_m(strips, a, low, size, v, side_x_m):
    """Return the difference along x from slot a to the v-th slot of a strip, a side less or more beyond its ends."""
    turn_m = -side_x_m if v < 0 else side_x_m if v >= size else 0.0
    return strips.x[wrapped_slot(low, size, v)] - strips.x[a] + turn_m


class NearPairs:
    """Finds the pairs i, j of robots alive whose centres are nearer than reach_m[i] + reach_m[j].

    On a torus the distance is the shortest one. The memory of the previous tick only makes it quick.
    """

    def __init__(self, static: Static, reach_m: FloatArray) -> None:
        """Take each robot's share `reach_m` (robots,) of the distance below which it is near another."""
        self._reach = Reach(reach_m, float(reach_m.max()), sides_m(static))
        self._key = "near pairs", reach_m.tobytes()
        self._order, self._strips = initial_order(static), allocate_strips(static)

    def find(self, view: TickView) -> IntArray:
        """Return the pairs, (k, 2) robot rows, each once; computed once per tick for all metrics of the same reach."""
        return view.once(self._key, lambda: self._compute(view))

    def _compute(self, view: TickView) -> IntArray:
        return _near_pairs(view.pose, view.alive, self._reach, self._order, self._strips)


@njit()
def _near_pairs(pose, alive, reach, order, strips):
    """Return the pairs of each robot with near ones after it in its strip, and with near ones in the next strip."""
    arenas, robots = alive.shape
    pairs, k = np.empty((4 * arenas * robots, 2), np.int64), 0
    farthest_m, wrap_m = reach.largest_m, reach.wrap_m
    half_m = 0.5 * wrap_m[0] if wrap_m[0] > 0.0 else np.inf
    start = strips.start
    for arena in range(arenas):
        count, _, _ = fill(strips, order[arena], pose[arena], alive[arena], 2.0 * farthest_m, robots, wrap_m[1])
        first_row = arena * robots
        for s in range(count):
            low, size = start[s], start[s + 1] - start[s]
            above = s + 1 if s + 1 < count or wrap_m[1] == 0.0 else 0
            size_above = start[above + 1] - start[above] if above < count and count > 1 else 0
            first = -size_above if wrap_m[0] > 0.0 else 0
            for a in range(low, low + size):
                pairs = _enlarge(pairs, k + size + size_above)
                v = a - low
                # Slots of the strip beyond half a torus are nearer from the other side.
                slots = Range(low, size, v + 1, v + size if wrap_m[0] > 0.0 else size, half_m)
                k = _add_near(strips, a, slots, reach, first_row, pairs, k)
                while (
                    first < size_above
                    and along_m(strips, a, start[above], size_above, first, wrap_m[0]) <= -2.0 * farthest_m
                ):
                    first += 1
                end = first + size_above if wrap_m[0] > 0.0 else size_above
                k = _add_near(
                    strips, a, Range(start[above], size_above, first, end, np.inf), reach, first_row, pairs, k
                )
    return pairs[:k]


@njit()
def _enlarge(pairs, length):
    """Return the pairs with at least this length."""
    return pairs if length <= len(pairs) else np.concatenate((pairs, np.empty((length, 2), np.int64)))


@kernel()
def _add_near(strips, a, slots, reach, first_row, pairs, k):
    """Write the pairs of slot a with the near ones of these slots after the first k `pairs`; return their number.

    `first_row` is the row of the arena's first robot.
    """
    low, size, first, last, max_m = slots
    i, x, y = strips.robot[a], strips.x[a], strips.y[a]
    wrap_m, reach_m = reach.wrap_m, reach.reach_m[i]
    for turn in range(-1, 2):  # the previous, present and next turn of the torus
        begin, end, turn_m = max(first, turn * size), min(last, (turn + 1) * size), turn * wrap_m[0]
        for b in range(low + begin - turn * size, low + end - turn * size):
            along, across = strips.x[b] - x + turn_m, strips.y[b] - y
            if along >= reach_m + reach.largest_m or along > max_m or (along == max_m and turn > 0):
                break
            if wrap_m[0] > 0.0:
                along, across = along + to_nearest(along, wrap_m[0]), across + to_nearest(across, wrap_m[1])
            near_m = reach_m + reach.reach_m[strips.robot[b]]
            pairs[k, 0], pairs[k, 1] = first_row + i, first_row + strips.robot[b]
            k += along * along + across * across < near_m * near_m
    return k
