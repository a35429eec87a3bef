"""Onsets of contacts: pairs that touch now and did not before, and the robots that touch anything. Compiled."""

# pyright: basic, reportUnknownMemberType=false

import numpy as np

from swarmwire.comms.base.arrays import AnyArray, FloatArray, IntArray
from swarmwire.comms.base.kernels import njit


@njit()
def pairs_of(contacts: AnyArray, ids: AnyArray, index: IntArray) -> IntArray:
    """One rising int64 code for each pair of bodies in contact, as `count_began` has them, of one arena.

    Args:
        contacts: (k, 2) ids of the two bodies, pairs may repeat.
        ids: (all bodies,) all ids, rising.
        index: (all bodies,) the index of each body: of a robot its own, of all that is not a robot the one after.
    """
    codes, bodies = np.empty(len(contacts), np.int64), index.max() + 1
    for k in range(len(contacts)):
        a, b = index[np.searchsorted(ids, contacts[k, 0])], index[np.searchsorted(ids, contacts[k, 1])]
        codes[k] = min(a, b) * bodies + max(a, b)
    codes.sort()
    kept, two_obstacles = 0, bodies * bodies - 1
    for k in range(len(codes)):
        if codes[k] != two_obstacles and (k == 0 or codes[k] != codes[k - 1]):
            codes[kept] = codes[k]
            kept += 1
    return codes[:kept]


@njit()
def count_began(now: IntArray, before: IntArray, bodies: int, onsets: IntArray) -> None:
    """Add the pairs of `now` that are not in `before` to onsets (arenas, 2): two robots, a robot and something fixed.

    Args:
        now: rising codes, (arena x bodies + lower index) x bodies + higher index.
        before: likewise.
        bodies: of an arena, robots and one that stands for all that is fixed, the last.
        onsets: added to.
    """
    at = 0
    for code in now:
        while at < len(before) and before[at] < code:
            at += 1
        if at == len(before) or before[at] != code:
            onsets[code // (bodies * bodies), 1 if code % bodies == bodies - 1 else 0] += 1


@njit()
def mark(now: IntArray, touched: FloatArray) -> None:
    """Set touched (arenas, robots) to 1 for each robot in the pairs of `now`, codes as above, else to 0."""
    touched[:] = 0.0
    bodies = touched.shape[1] + 1
    for code in now:
        arena, pair = code // (bodies * bodies), code % (bodies * bodies)
        touched[arena, pair // bodies] = 1.0
        if pair % bodies < bodies - 1:
            touched[arena, pair % bodies] = 1.0
