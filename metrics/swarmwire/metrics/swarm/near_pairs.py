"""Pairs of robots alive that are near each other, in every arena. Compiled."""

# pyright: basic, reportUnknownMemberType=false

import numpy as np

from swarmwire.comms.arrays import FloatArray, IntArray
from swarmwire.comms.geometry.obstacles import to_nearest
from swarmwire.comms.kernels import kernel, njit
from swarmwire.comms.truth import Static
from swarmwire.metrics.moment import Moment
from swarmwire.metrics.swarm.strips import along_m, fill, first_order, room_for
from swarmwire.metrics.torus import sides_m


class NearPairs:
    """Finds the pairs i, j of robots alive whose centres are nearer than reach_m[i] + reach_m[j].

    On a torus the distance is the shortest one. What it remembers of the tick before only makes it quick.
    """

    def __init__(self, static: Static, reach_m: FloatArray) -> None:
        """`reach_m` (robots,) is each robot's share of the distance below which it is near another."""
        self._reach_m, self._wrap_m = reach_m, sides_m(static)
        self._key = "near pairs", reach_m.tobytes()
        self._order, self._strips = first_order(static), room_for(static)

    def of(self, moment: Moment) -> IntArray:
        """The pairs, (k, 2) robot rows, each once; found once a tick for all metrics of the same reach."""
        return moment.once(self._key, lambda: self._found(moment))

    def _found(self, moment: Moment) -> IntArray:
        return _near_pairs(moment.pose, moment.alive, self._reach_m, self._order, self._strips, self._wrap_m)


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
