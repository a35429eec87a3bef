"""Who is joined to whom in a graph that is given by its edges. Compiled."""

# pyright: basic, reportUnknownMemberType=false

import numpy as np

from swarmwire.comms.arrays import IntArray
from swarmwire.comms.kernels import njit


@njit()
def neighbours_of(edges: IntArray, nodes: int) -> tuple[IntArray, IntArray]:
    """`start` (nodes + 1,) and `other` (2 e,): node i is joined by an edge (e, 2) to other[start[i] : start[i + 1]]."""
    start, other = np.zeros(nodes + 1, np.int64), np.empty(2 * len(edges), np.int64)
    for e in range(len(edges)):
        for end in range(2):
            start[edges[e, end] + 1] += 1
    start = np.cumsum(start)
    at = start[:-1].copy()
    for e in range(len(edges)):
        for end in range(2):
            node = edges[e, end]
            other[at[node]] = edges[e, 1 - end]
            at[node] += 1
    return start, other
