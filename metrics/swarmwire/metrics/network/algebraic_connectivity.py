"""Algebraic connectivity: how hard it is to cut the radio graph in two."""

# pyright: basic, reportUnknownMemberType=false

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.arrays import FloatArray, IntArray
from swarmwire.comms.kernels import njit
from swarmwire.comms.truth import Static
from swarmwire.metrics.metric import Measure
from swarmwire.metrics.moment import Moment
from swarmwire.metrics.sampled import Sampled

MAX_DENSE = 100  # robots of which all eigenvalues are found as quickly as the one wanted of a sparse matrix
SHIFT = 1e-3  # below all eigenvalues, so that the shifted matrix can be inverted
DIGITS = 9


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
    bounds = (0.0, None)

    def sample(self, static: Static) -> Measure:
        """A fresh measure; nothing is remembered."""
        return _connectivity


def _connectivity(moment: Moment) -> FloatArray | float:
    edges, found = moment.truth.edges, moment.components
    if edges is None or found is None:
        return np.nan
    value: FloatArray = np.where(moment.robots_alive > 1, 0.0, np.nan)
    whole = np.flatnonzero((moment.robots_alive > 1) & (found.pieces == 1))
    robots = moment.static.robots
    edges = edges[moment.truth.alive[edges].all(axis=1)]
    edges = edges[np.argsort(edges[:, 0], kind="stable")]
    starts = np.searchsorted(edges[:, 0], whole * robots).tolist()
    ends = np.searchsorted(edges[:, 0], (whole + 1) * robots).tolist()
    for arena, start, end in zip(whole.tolist(), starts, ends, strict=True):
        place = np.cumsum(moment.alive[arena]) - 1  # of each robot among those alive
        value[arena] = second_eigenvalue(place[edges[start:end] - arena * robots], int(moment.robots_alive[arena]))
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
