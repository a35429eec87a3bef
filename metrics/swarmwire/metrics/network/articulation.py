"""Articulation: how many robots the radio graph hangs on."""

# pyright: basic, reportUnknownMemberType=false

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.arrays import BoolArray, FloatArray, IntArray
from swarmwire.comms.kernels import njit
from swarmwire.comms.truth import Static
from swarmwire.metrics.metric import Measure
from swarmwire.metrics.moment import Moment
from swarmwire.metrics.neighbours import neighbours_of
from swarmwire.metrics.sampled import Sampled

NONE = -1


@dataclass(frozen=True)
class Articulation(Sampled):
    """Robots alive whose loss would split their component of the radio graph: its articulation points, cut vertices.

    0 if the graph stands the loss of any one robot; at most the robots alive - 2, as in a path. What an edge is,
    `Truth.edges` says. NaN without a radio, or if no robot is alive.

    Source: J. Hopcroft, R. Tarjan, Algorithm 447: efficient algorithms for graph manipulation, Communications of the
    ACM 16 (6), 1973.
    """

    name = "articulation"
    help = "robots alive whose loss would split their component of the radio graph"
    bounds = (0.0, None)

    def sample(self, static: Static) -> Measure:
        """A fresh measure; nothing is remembered."""
        return _articulation


def _articulation(moment: Moment) -> FloatArray | float:
    edges = moment.truth.edges
    if edges is None:
        return np.nan
    # No edge joins two arenas, so all can be searched as one graph.
    cuts = cut_vertices(edges, moment.alive.size).reshape(moment.alive.shape)
    return np.where(moment.robots_alive > 0, np.count_nonzero(cuts, axis=1), np.nan)


@njit()
def cut_vertices(edges: IntArray, nodes: int) -> BoolArray:
    """Which nodes (nodes,) of the graph with these edges (e, 2) split their component if they are taken out."""
    start, to = neighbours_of(edges, nodes)
    at = start[:-1].copy()  # the next neighbour to look at
    above = np.full(nodes, NONE)  # in the tree of a search in depth
    order = np.zeros(nodes, np.int64)  # when found
    lowest = np.zeros(nodes, np.int64)  # the first that its branch reaches
    cuts, found = np.zeros(nodes, np.bool_), 0
    for root in range(nodes):
        if order[root]:
            continue
        found += 1
        order[root], lowest[root], node, branches = found, found, root, 0
        while node != NONE:
            if at[node] < start[node + 1]:
                other = to[at[node]]
                at[node] += 1
                if order[other]:
                    lowest[node] = min(lowest[node], order[other])
                else:
                    found += 1
                    order[other], lowest[other], above[other] = found, found, node
                    branches += node == root
                    node = other
            else:
                up = above[node]
                if up != NONE:
                    lowest[up] = min(lowest[up], lowest[node])
                    if up != root and lowest[node] >= order[up]:
                        cuts[up] = True
                node = up
        cuts[root] = branches > 1
    return cuts
