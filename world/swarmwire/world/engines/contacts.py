"""Onsets of contacts: pairs that touch in this tick and not in the last, and robots that touch anything. Compiled."""

# pyright: basic, reportUnknownMemberType=false

import numpy as np

from swarmwire.comms.base.arrays import AnyArray, FloatArray, IntArray
from swarmwire.comms.base.kernels import njit


@njit()
def pairs_of(contacts: AnyArray, ids: AnyArray, index: IntArray) -> IntArray:
    """Return a rising int64 code for each pair of bodies in contact in one arena; see `count_began` for the codes.

    Args:
        contacts: (k, 2) ids of the two bodies; pairs may repeat.
        ids: (bodies,) all ids, rising.
        index: (bodies,) the index of each robot in the arena; the number of robots for all other bodies.
    """
    codes, bodies = np.empty(len(contacts), np.int64), index.max() + 1
    for k in range(len(contacts)):
        a, b = index[np.searchsorted(ids, contacts[k, 0])], index[np.searchsorted(ids, contacts[k, 1])]
        codes[k] = min(a, b) * bodies + max(a, b)
    codes.sort()
    count, two_obstacles = 0, bodies * bodies - 1
    for k in range(len(codes)):
        if codes[k] != two_obstacles and (k == 0 or codes[k] != codes[k - 1]):
            codes[count] = codes[k]
            count += 1
    return codes[:count]


@njit()
def count_began(now: IntArray, before: IntArray, bodies: int, onsets: IntArray) -> None:
    """Add the pairs of `now` that are not in `before` to onsets (arenas, 2): two robots, a robot and something fixed.

    Args:
        now: rising codes, (arena x bodies + lower index) x bodies + higher index.
        before: likewise.
        bodies: number of robots of an arena, plus one for everything fixed, whose index is the last.
        onsets: added to.
    """
    k = 0
    for code in now:
        while k < len(before) and before[k] < code:
            k += 1
        if k == len(before) or before[k] != code:
            onsets[code // (bodies * bodies), 1 if code % bodies == bodies - 1 else 0] += 1


@njit()
def mark(now: IntArray, touched: FloatArray) -> None:
    """Set touched (arenas, robots) to 1 for each robot in the pairs `now` (codes of `count_began`), else to 0."""
    touched[:] = 0.0
    bodies = touched.shape[1] + 1
    for code in now:
        arena, pair = code // (bodies * bodies), code % (bodies * bodies)
        touched[arena, pair // bodies] = 1.0
        if pair % bodies < bodies - 1:
            touched[arena, pair % bodies] = 1.0
