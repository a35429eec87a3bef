"""The order in which robots get what they heard.

Rows are indexed by unsigned numbers throughout: of signed ones compiled code asks each time whether they count from
the end, which takes three times as long.
"""

# pyright: basic, reportUnknownMemberType=false

import numpy as np
from numba import njit

from swarmwire.comms.arrays import IntArray


@njit(cache=True)
def by_receiver(index: IntArray, receiver: IntArray, heard_at_ns: IntArray, sender: IntArray, rows: int) -> IntArray:
    """The rows of `index` (k,), at least one, by (receiver, heard_at, sender), ties as they stand, (k,)."""
    order = index.view(np.uint64)
    for k in range(1, len(order)):
        if sender[order[k]] < sender[order[k - 1]]:  # seldom: packets of a tick stand by sender
            order = _counting_sort(order, sender, rows)
            break
    # Roughly by time, then by receiver: next to nothing is left to move.
    order = _counting_sort(order, *_parts_of_time(order, heard_at_ns))
    order = _counting_sort(order, receiver, rows)
    _insertion_sort(order, receiver, heard_at_ns)
    return order.view(np.int64)


@njit(cache=True)
def _counting_sort(order, key, keys):
    """`order` by key[row], 0 to keys - 1, ties as they stand."""
    start = np.zeros(keys + 1, np.int64)
    places = key.view(np.uint64)
    for row in order:
        start[places[row] + np.uint64(1)] += 1
    for place in range(len(start) - 1):
        start[place + 1] += start[place]
    out = np.empty_like(order)
    for row in order:
        place = np.uint64(start[places[row]])
        start[places[row]] += 1  # before `out` is written, or the processor waits to see whether that changed it
        out[place] = row
    return out


@njit(cache=True)
def _parts_of_time(order, at_ns):
    """Into which of equal parts of time each row falls, about as many as rows, and how many parts there are."""
    first_ns = last_ns = at_ns[order[0]]
    for row in order:
        first_ns, last_ns = min(first_ns, at_ns[row]), max(last_ns, at_ns[row])
    shift = 0
    while (last_ns - first_ns) >> shift > len(order):
        shift += 1
    part = np.empty(len(at_ns), np.int64)
    for row in order:
        part[row] = (at_ns[row] - first_ns) >> shift
    return part, ((last_ns - first_ns) >> shift) + 1


@njit(cache=True)
def _insertion_sort(order, receiver, at_ns):
    """Rows that stand by receiver, by time within each; in place, ties as they stand."""
    for k in range(1, len(order)):
        moved, place = order[k], k
        while place > 0 and receiver[order[place - 1]] == receiver[moved] and at_ns[order[place - 1]] > at_ns[moved]:
            order[place] = order[place - 1]
            place -= 1
        order[place] = moved
