"""Which contacts began, pairs that touch now and did not before, and who touches anything. Compiled."""

# pyright: basic, reportUnknownMemberType=false

import numpy as np
from numba import njit

from swarmwire.comms.arrays import AnyArray, FloatArray, IntArray


@njit(cache=True)
def pairs_of(contacts: AnyArray, ids: AnyArray, index: IntArray) -> IntArray:
    """One rising int64 code for each pair of bodies in contact: lower index x bodies + higher index.

    Args:
        contacts: (k, 2) ids of the two bodies, pairs may repeat.
        ids: (bodies,) all ids, rising.
        index: (bodies,) the index of each body; the highest is the static body's.
    """
    codes = np.empty(len(contacts), np.int64)
    for k in range(len(contacts)):
        a, b = index[np.searchsorted(ids, contacts[k, 0])], index[np.searchsorted(ids, contacts[k, 1])]
        codes[k] = min(a, b) * len(ids) + max(a, b)
    codes.sort()
    kept = 0
    for k in range(len(codes)):
        if k == 0 or codes[k] != codes[k - 1]:
            codes[kept] = codes[k]
            kept += 1
    return codes[:kept]


@njit(cache=True)
def count_began(now: IntArray, before: IntArray, bodies: int, onsets: IntArray) -> None:
    """Add the pairs of `now` that are not in `before` to onsets (2,): of two robots, of a robot and something fixed."""
    at = 0
    for code in now:
        while at < len(before) and before[at] < code:
            at += 1
        if at == len(before) or before[at] != code:
            onsets[1 if code % bodies == bodies - 1 else 0] += 1


@njit(cache=True)
def mark(now: IntArray, touched: FloatArray) -> None:
    """Set touched (robots,) to 1 for each robot in the pairs of `now`, else to 0."""
    touched[:] = 0.0
    bodies = len(touched) + 1  # the highest index is the static body's
    for code in now:
        for body in (code // bodies, code % bodies):
            if body < len(touched):
                touched[body] = 1.0
