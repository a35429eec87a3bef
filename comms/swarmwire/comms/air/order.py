"""The order in which robots get what they heard."""

# pyright: basic, reportUnknownMemberType=false

import numpy as np
from numba import njit

from swarmwire.comms.arrays import IntArray

MANY = 40  # for sorting by insertion


@njit(cache=True)
def by_receiver(index: IntArray, receiver: IntArray, heard_at_ns: IntArray, sender: IntArray, rows: int) -> IntArray:
    """The rows of `index` (k,) by (receiver, heard_at, sender), ties as they stand, (k,); robots are rows."""
    # Counting sorts by robot leave only the packets of one receiver to compare.
    order = index
    for k in range(1, len(index)):
        if sender[index[k]] < sender[index[k - 1]]:  # seldom: packets of a tick stand by sender
            order, _ = _counting_sort(index, sender, rows)
            break
    order, start = _counting_sort(order, receiver, rows)
    at_ns = heard_at_ns[order]
    for row in range(rows):
        first, stop = start[row], start[row + 1]
        if stop - first > MANY:
            order[first:stop] = order[first:stop][np.argsort(at_ns[first:stop], kind="mergesort")]
            continue
        for k in range(first + 1, stop):
            moved, moved_ns, place = order[k], at_ns[k], k
            while place > first and at_ns[place - 1] > moved_ns:
                order[place], at_ns[place] = order[place - 1], at_ns[place - 1]
                place -= 1
            order[place], at_ns[place] = moved, moved_ns
    return order


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
