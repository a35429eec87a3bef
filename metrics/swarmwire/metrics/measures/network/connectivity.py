"""Connectivity of the radio graph: its components, and how many edges or robots hold it together."""

# pyright: basic, reportUnknownMemberType=false

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.base.arrays import BoolArray, FloatArray, IntArray
from swarmwire.comms.base.kernels import njit
from swarmwire.comms.observe.truth import Static
from swarmwire.metrics.measures.metric import Measure, Metric, Sampled, TickView, neighbours_of

MAX_DENSE = 100  # robots of which all eigenvalues are found as quickly as the one wanted of a sparse matrix
SHIFT = 1e-3  # below all eigenvalues, so that the shifted matrix can be inverted
DIGITS = 9
NONE = -1


@dataclass(frozen=True)
class ComponentCount(Metric):
    """Connected components of the radio graph over the robots alive: 1 when everyone can reach everyone over hops.

    From 1 to the number of robots alive, 0 if none is; NaN without a radio. What an edge is, `Truth.edges` says.
    """

    name = "components"
    help = "connected components of the radio graph over robots alive"
    standard = True
    needs = ("graph",)
    bounds = (0.0, None)

    def begin(self, static: Static) -> Measure:
        """A fresh measure; nothing is remembered."""
        return lambda view: np.nan if view.components is None else view.components.pieces.astype(np.float64)


@dataclass(frozen=True)
class LargestComponent(Metric):
    """Robots in the radio graph's largest component / robots alive: 1 when the swarm is in one piece.

    At least 1 / robots alive; NaN without a radio, or if no robot is alive.
    """

    name = "largest_component"
    help = "share of the robots alive that are in the radio graph's largest component"
    standard = True
    needs = ("graph",)
    bounds = (0.0, 1.0)

    def begin(self, static: Static) -> Measure:
        """A fresh measure; nothing is remembered."""
        return lambda view: np.nan if view.components is None else view.components.largest / view.per_robot_alive


@dataclass(frozen=True)
class AlgebraicConnectivity(Sampled):
    """Second smallest eigenvalue of the Laplacian L = D - A of the radio graph over the robots alive.

    D holds the robots' degrees, A is 1 where `Truth.edges` joins two robots. It is not divided by the number of robots
    N, as some do: 0 while the graph is in pieces, N if everyone is joined to everyone, and in a consensus over the
    graph, x' = -L x, the rate in 1/s at which disagreement dies out. From 0 to the robots alive, without unit; NaN
    without a radio, or if fewer than two robots are alive. Rounded to 1e-9, since the last bits depend on how many
    threads the solver has.

    Sources: M. Fiedler, Algebraic connectivity of graphs, Czechoslovak Mathematical Journal 23 (98), 1973; R.
    Olfati-Saber, R. M. Murray, Consensus problems in networks of agents with switching topology and time-delays, IEEE
    Transactions on Automatic Control 49 (9), 2004.
    """

    name = "algebraic_connectivity"
    help = (
        "second smallest eigenvalue of the radio graph's Laplacian over robots alive, not divided by their number: "
        "0 in pieces"
    )
    needs = ("graph",)
    bounds = (0.0, None)

    def sample(self, static: Static) -> Measure:
        """A fresh measure; nothing is remembered."""
        return _connectivity


def _connectivity(view: TickView) -> FloatArray | float:
    edges, found = view.truth.edges, view.components
    if edges is None or found is None:
        return np.nan
    value: FloatArray = np.where(view.robots_alive > 1, 0.0, np.nan)
    whole = np.flatnonzero((view.robots_alive > 1) & (found.pieces == 1))
    robots = view.static.robots
    edges = edges[view.truth.alive[edges].all(axis=1)]
    edges = edges[np.argsort(edges[:, 0], kind="stable")]
    starts = np.searchsorted(edges[:, 0], whole * robots).tolist()
    ends = np.searchsorted(edges[:, 0], (whole + 1) * robots).tolist()
    for arena, start, end in zip(whole.tolist(), starts, ends, strict=True):
        place = np.cumsum(view.alive[arena]) - 1  # of each robot among those alive
        value[arena] = second_eigenvalue(place[edges[start:end] - arena * robots], int(view.robots_alive[arena]))
    return value


def second_eigenvalue(edges: IntArray, nodes: int, most_dense: int = MAX_DENSE) -> float:
    """The second smallest eigenvalue of the Laplacian of a connected graph of two nodes or more; `edges` (e, 2).

    Of a graph of more than `most_dense` nodes it is found by shift and invert (ARPACK, SuperLU).
    """
    if nodes <= most_dense:
        found = np.linalg.eigvalsh(_dense(edges, nodes))[1]
    else:
        from scipy.sparse import csc_array
        from scipy.sparse.linalg import eigsh

        a, b, every = edges[:, 0], edges[:, 1], np.arange(nodes)
        degree = np.bincount(edges.ravel(), minlength=nodes).astype(np.float64)
        weights = np.concatenate([np.full(2 * len(edges), -1.0), degree])
        places = np.concatenate([a, b, every]), np.concatenate([b, a, every])
        laplacian = csc_array((weights, places), shape=(nodes, nodes))
        # ARPACK's own start would be drawn anew each time; this one shares no symmetry with a graph.
        start = 0.5 + np.cos(every)
        found = np.max(eigsh(laplacian, k=2, sigma=-SHIFT, v0=start, return_eigenvectors=False))
    return max(round(float(found), DIGITS), 0.0)


@njit()
def _dense(edges, nodes):
    laplacian = np.zeros((nodes, nodes))
    for e in range(len(edges)):
        a, b = edges[e, 0], edges[e, 1]
        laplacian[a, b] -= 1.0
        laplacian[b, a] -= 1.0
        laplacian[a, a] += 1.0
        laplacian[b, b] += 1.0
    return laplacian


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
    needs = ("graph",)
    bounds = (0.0, None)

    def sample(self, static: Static) -> Measure:
        """A fresh measure; nothing is remembered."""
        return _articulation


def _articulation(view: TickView) -> FloatArray | float:
    edges = view.truth.edges
    if edges is None:
        return np.nan
    # No edge joins two arenas, so all can be searched as one graph.
    cuts = cut_vertices(edges, view.alive.size).reshape(view.alive.shape)
    return np.where(view.robots_alive > 0, np.count_nonzero(cuts, axis=1), np.nan)


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
