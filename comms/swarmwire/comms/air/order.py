"""The order in which robots get what they heard."""

# pyright: basic, reportUnknownMemberType=false

import numpy as np
from numba import njit

from swarmwire.comms.arrays import IntArray

MANY = 40  # for sorting by insertion


@njit(cache=True)
def by_receiver(
    index: IntArray, receiver: IntArray, heard_at_ns: IntArray, sender: IntArray, rows: int
) -> IntArray:
    """The rows of `index` (k,) by (receiver, heard_at, sender), ties as they stand, (k,); robots are rows."""
    # Counting sorts by robot leave only the packets of one receiver to compare.
    order, _ = _counting_sort(index, sender, rows)
    order, start = _counting_sort(order, receiver, rows)
    for row in range(rows):
        own = order[start[row] : start[row + 1]]
        if len(own) > MANY:
            own[:] = own[np.argsort(heard_at_ns[own], kind="mergesort")]
        else:
            _insertion_sort(own, heard_at_ns)
    return order


@njit(cache=True)
def _insertion_sort(order, at_ns):
    """Sort a few indices by time, in place; ties stay as they stand."""
    for k in range(1, len(order)):
        moved, place = order[k], k
        while place > 0 and at_ns[order[place - 1]] > at_ns[moved]:
            order[place] = order[place - 1]
            place -= 1
        order[place] = moved


@njit(cache=True)
def _counting_sort(order, row_of, rows):
    start = np.zeros(rows + 1, np.int64)
    for i in order:
        start[row_of[i] + 1] += 1
    for row in range(rows):
        start[row + 1] += start[row]
    filled = start[:-1].copy()
    out = np.empty_like(order)
    for i in order:
        out[filled[row_of[i]]] = i
        filled[row_of[i]] += 1
    return out, start
