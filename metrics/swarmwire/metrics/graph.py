"""Undirected graphs over robots, given by their edges: components and neighbours. Compiled."""

# pyright: basic, reportUnknownMemberType=false

import numpy as np

from swarmwire.comms.arrays import BoolArray, IntArray
from swarmwire.comms.kernels import njit


@njit()
def components_of(edges: IntArray, alive: BoolArray) -> tuple[IntArray, IntArray]:
    """How many components each arena has that hold a robot alive, and the most of them that one holds, (arenas,) each.

    Union-find over the `edges` (e, 2) between robot rows; `alive` is (arenas, robots).
    """
    arenas, robots = alive.shape
    parent, size = np.arange(arenas * robots), np.zeros(arenas * robots, np.int64)
    for e in range(len(edges)):
        a, b = _root(parent, edges[e, 0]), _root(parent, edges[e, 1])
        parent[max(a, b)] = min(a, b)
    pieces, largest = np.zeros(arenas, np.int64), np.zeros(arenas, np.int64)
    for arena in range(arenas):
        for i in range(robots):
            if alive[arena, i]:
                root = _root(parent, arena * robots + i)
                pieces[arena] += size[root] == 0
                size[root] += 1
                largest[arena] = max(largest[arena], size[root])
    return pieces, largest


@njit()
def _root(parent, row):
    while parent[row] != row:
        parent[row] = parent[parent[row]]  # halves the way for those to come
        row = parent[row]
    return row


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
