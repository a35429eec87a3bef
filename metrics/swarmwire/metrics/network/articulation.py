"""Articulation: how many robots the radio graph hangs on."""

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.truth import Static
from swarmwire.metrics.metric import Measure
from swarmwire.metrics.moment import Moment
from swarmwire.metrics.sampled import Sampled


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
        from networkx import Graph, articulation_points

        def measure(moment: Moment) -> FloatArray | float:
            edges = moment.truth.edges
            if edges is None:
                return np.nan
            # No edge joins two arenas, so all can be searched as one graph.
            graph = Graph(edges.tolist())
            points = np.fromiter(articulation_points(graph), np.int64)
            count = np.bincount(points // static.robots, minlength=static.arenas)
            return np.where(moment.robots_alive > 0, count, np.nan)

        return measure
