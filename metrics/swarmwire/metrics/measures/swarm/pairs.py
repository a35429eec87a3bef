"""Robots alive that are near each other: arenas cut into strips along x, each sorted by x. Compiled.

Strip s holds the places start[s] to start[s + 1] - 1. On a torus a strip continues after its last place with its first.
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

SLACK = 1.0 + 1e-9  # two robots at just the height may be rounded apart
MIN_AROUND = 3  # strips around a torus, or a strip's neighbours above and below would be one


def radii_m(static: Static) -> FloatArray:
    """Of each robot index within an arena, (robots,)."""
    return np.concatenate([np.full(group.stop - group.start, group.body.radius_m) for group in static.groups])


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


class NearPairs:
    """Finds the pairs i, j of robots alive whose centres are nearer than reach_m[i] + reach_m[j].

    On a torus the distance is the shortest one. What it remembers of the tick before only makes it quick.
    """

    def __init__(self, static: Static, reach_m: FloatArray) -> None:
        """`reach_m` (robots,) is each robot's share of the distance below which it is near another."""
        self._reach_m, self._wrap_m = reach_m, sides_m(static)
        self._key = "near pairs", reach_m.tobytes()
        self._order, self._strips = first_order(static), room_for(static)

    def find(self, view: TickView) -> IntArray:
        """Return the pairs, (k, 2) robot rows, each once; computed once per tick for all metrics of the same reach."""
        return view.once(self._key, lambda: self._compute(view))

    def _compute(self, view: TickView) -> IntArray:
        return _near_pairs(view.pose, view.alive, self._reach_m, self._order, self._strips, self._wrap_m)


@njit()
def _near_pairs(pose, alive, reach_m, order, strips, wrap_m):
    """Each robot with those after it in its strip, and with those of the next strip: others have it after them."""
    arenas, robots = alive.shape
    pairs, k = np.empty((4 * arenas * robots, 2), np.int64), 0
    farthest_m, half_m = reach_m.max(), 0.5 * wrap_m[0] if wrap_m[0] > 0.0 else np.inf
    start = strips.start
    for arena in range(arenas):
        count, _, _ = fill(strips, order[arena], pose[arena], alive[arena], 2.0 * farthest_m, robots, wrap_m[1])
        for s in range(count):
            low, own = start[s], start[s + 1] - start[s]
            above = s + 1 if s + 1 < count or wrap_m[1] == 0.0 else 0
            other = start[above + 1] - start[above] if above < count and count > 1 else 0
            first = -other if wrap_m[0] > 0.0 else 0
            for a in range(low, low + own):
                pairs = _with_room(pairs, k + own + other)
                reach = reach_m[strips.robot[a]]
                far_m, rows, place = reach + farthest_m, arena * robots, a - low
                last = place + own if wrap_m[0] > 0.0 else own
                k = _scan(strips, a, low, own, place + 1, last, far_m, half_m, reach_m, wrap_m, rows, pairs, k)
                while first < other and along_m(strips, a, start[above], other, first, wrap_m[0]) <= -2.0 * farthest_m:
                    first += 1
                last = first + other if wrap_m[0] > 0.0 else other
                k = _scan(strips, a, start[above], other, first, last, far_m, np.inf, reach_m, wrap_m, rows, pairs, k)
    return pairs[:k]


@njit()
def _with_room(pairs, most):
    """The same, longer if it may have to hold more than it can."""
    return pairs if most <= len(pairs) else np.concatenate((pairs, np.empty((most, 2), np.int64)))


@kernel()
def _scan(strips, a, low, size, first, last, far_m, half_m, reach_m, wrap_m, rows, pairs, k):
    """Put place a with those of a strip's places first to last - 1 that are near it behind the first k `pairs`.

    Ends at `far_m` along x; and at `half_m` of a torus, beyond which places of the same strip are nearer from behind.
    Returns how many pairs there are then.
    """
    i, x, y = strips.robot[a], strips.x[a], strips.y[a]
    reach, torus = reach_m[i], wrap_m[0] > 0.0
    for turn in range(-1, 2):  # a time around the torus before, this one, and the next
        begin, end, turn_m = max(first, turn * size), min(last, (turn + 1) * size), turn * wrap_m[0]
        for b in range(low + begin - turn * size, low + end - turn * size):
            along, across = strips.x[b] - x + turn_m, strips.y[b] - y
            if along >= far_m or along > half_m or (along == half_m and turn > 0):
                break
            if torus:
                along, across = along + to_nearest(along, wrap_m[0]), across + to_nearest(across, wrap_m[1])
            near = reach + reach_m[strips.robot[b]]
            pairs[k, 0], pairs[k, 1] = rows + i, rows + strips.robot[b]
            k += along * along + across * across < near * near
    return k
