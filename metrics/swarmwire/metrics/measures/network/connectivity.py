"""Connectivity of the radio graph: components, algebraic connectivity and articulation points."""

# pyright: basic, reportUnknownMemberType=false

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.base.arrays import BoolArray, FloatArray, IntArray
from swarmwire.comms.base.kernels import njit
from swarmwire.comms.observe.truth import Static
from swarmwire.metrics.measures.metric import Measure, Metric, Sampled, TickView, neighbours_of

MAX_DENSE = 100  # up to this many robots a dense solver is as quick as a sparse one
SHIFT = 1e-3  # -SHIFT is below all eigenvalues, so the shifted matrix can be inverted
DIGITS = 9
NO_NODE = -1


@dataclass(frozen=True)
class ComponentCount(Metric):
    """Connected components of the radio graph over the robots alive: 1 if all robots reach each other over hops.

    From 1 to the number of robots alive, 0 if none is; NaN without a radio. `Truth.edges` defines the edges.
    """

    name = "components"
    help = "connected components of the radio graph over robots alive"
    standard = True
    needs = ("graph",)
    bounds = (0.0, None)

    def begin(self, static: Static) -> Measure:
        """Return a measure without memory."""
        return lambda view: np.nan if view.components is None else view.components.number.astype(np.float64)


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
        """Return a measure without memory."""
        return lambda view: np.nan if view.components is None else view.components.largest / view.per_robot_alive


@dataclass(frozen=True)
class AlgebraicConnectivity(Sampled):
    """Second smallest eigenvalue of the Laplacian L = D - A of the radio graph over the robots alive.

    D has the robots' degrees, A is 1 for two robots that `Truth.edges` joins. The value is not divided by the number of
    robots N: it is 0 while the graph is disconnected, N for a complete graph, and in a consensus over the graph,
    x' = -L x, the rate in 1/s at which disagreement decays. From 0 to the robots alive, without unit; NaN without a
    radio, or if fewer than two robots are alive. Rounded to 1e-9, since the last bits depend on the solver's threads.

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
        """Return a measure without memory."""
        return _connectivity


def _connectivity(view: TickView) -> FloatArray | float:
    edges, components = view.truth.edges, view.components
    if edges is None or components is None:
        return np.nan
    value: FloatArray = np.where(view.robots_alive > 1, 0.0, np.nan)
    connected = np.flatnonzero((view.robots_alive > 1) & (components.number == 1))
    robots = view.static.robots
    edges = edges[view.truth.alive[edges].all(axis=1)]
    edges = edges[np.argsort(edges[:, 0], kind="stable")]
    starts = np.searchsorted(edges[:, 0], connected * robots).tolist()
    ends = np.searchsorted(edges[:, 0], (connected + 1) * robots).tolist()
    for arena, start, end in zip(connected.tolist(), starts, ends, strict=True):
        index = np.cumsum(view.alive[arena]) - 1  # index of each robot among the robots alive
        value[arena] = second_eigenvalue(index[edges[start:end] - arena * robots], int(view.robots_alive[arena]))
    return value


def second_eigenvalue(edges: IntArray, nodes: int, max_dense: int = MAX_DENSE) -> float:
    """Return the second smallest eigenvalue of the Laplacian of a connected graph, two nodes or more; `edges` (e, 2).

    Graphs of more than `max_dense` nodes are solved by shift and invert (ARPACK, SuperLU).
    """
    if nodes <= max_dense:
        eigenvalue = np.linalg.eigvalsh(_dense(edges, nodes))[1]
    else:
        from scipy.sparse import csc_array
        from scipy.sparse.linalg import eigsh

        a, b, index = edges[:, 0], edges[:, 1], np.arange(nodes)
        degree = np.bincount(edges.ravel(), minlength=nodes).astype(np.float64)
        weights = np.concatenate([np.full(2 * len(edges), -1.0), degree])
        positions = np.concatenate([a, b, index]), np.concatenate([b, a, index])
        laplacian = csc_array((weights, positions), shape=(nodes, nodes))
        # ARPACK's default start is random; this one is fixed, and shares no symmetry with a graph.
        start = 0.5 + np.cos(index)
        eigenvalue = np.max(eigsh(laplacian, k=2, sigma=-SHIFT, v0=start, return_eigenvectors=False))
    return max(round(float(eigenvalue), DIGITS), 0.0)


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
    """Robots alive whose loss would split their component of the radio graph: articulation points (cut vertices).

    0 if no loss of a single robot splits the graph; at most the robots alive - 2, reached by a path. `Truth.edges`
    defines the edges. NaN without a radio, or if no robot is alive.

    Source: J. Hopcroft, R. Tarjan, Algorithm 447: efficient algorithms for graph manipulation, Communications of the
    ACM 16 (6), 1973.
    """

    name = "articulation"
    help = "robots alive whose loss would split their component of the radio graph"
    needs = ("graph",)
    bounds = (0.0, None)

    def sample(self, static: Static) -> Measure:
        """Return a measure without memory."""
        return _articulation


def _articulation(view: TickView) -> FloatArray | float:
    edges = view.truth.edges
    if edges is None:
        return np.nan
    # No edge joins two arenas, so all arenas are searched as one graph.
    cuts = cut_vertices(edges, view.alive.size).reshape(view.alive.shape)
    return np.where(view.robots_alive > 0, np.count_nonzero(cuts, axis=1), np.nan)


@njit()
def cut_vertices(edges: IntArray, nodes: int) -> BoolArray:
    """Return True for the nodes (nodes,) whose removal splits their component of the graph with `edges` (e, 2)."""
    start, neighbour = neighbours_of(edges, nodes)
    following = start[:-1].copy()  # index of each node's next neighbour to visit
    parent = np.full(nodes, NO_NODE)  # parent in the tree of the depth-first search
    order = np.zeros(nodes, np.int64)  # number of the visit, from 1; 0: not visited
    lowest = np.zeros(nodes, np.int64)  # lowest order that the node's branch reaches
    cuts, visits = np.zeros(nodes, np.bool_), 0
    for root in range(nodes):
        if order[root]:
            continue
        visits += 1
        order[root], lowest[root], node, branches = visits, visits, root, 0
        while node != NO_NODE:
            if following[node] < start[node + 1]:
                other = neighbour[following[node]]
                following[node] += 1
                if order[other]:
                    lowest[node] = min(lowest[node], order[other])
                else:
                    visits += 1
                    order[other], lowest[other], parent[other] = visits, visits, node
                    branches += node == root
                    node = other
            else:
                up = parent[node]
                if up != NO_NODE:
                    lowest[up] = min(lowest[up], lowest[node])
                    if up != root and lowest[node] >= order[up]:
                        cuts[up] = True
                node = up
        cuts[root] = branches > 1
    return cuts
