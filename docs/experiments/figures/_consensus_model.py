"""What average consensus under independent one-way losses comes to, worked out for a scenario's graph.

One step is x <- W x, W = I + gain (B - diag(B 1)), where B is the adjacency matrix of which each entry is 0 with the
probability of a loss, by itself. So the mean of x goes by the mean of W, I - gain (1 - loss) L with the Laplacian L,
and S = E[x x^T] by S <- E[W] S E[W]^T + D: since rows of W are independent, D is diagonal, with
gain^2 loss (1 - loss) sum over neighbours j of i of E[(x_i - x_j)^2].
"""

import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from swarmwire.comms.base.arrays import FloatArray

LEFT = 0.2  # of the first pattern, after the steps over which decay is measured


class Moments(NamedTuple):
    """After some steps, over all runs."""

    pattern: float  # mean of the share of the first pattern that is left
    error: float  # root mean square of consensus_error
    bias: float  # root mean square of consensus_bias


@dataclass(frozen=True)
class Graph:
    """Who hears whom, and how they begin."""

    adjacency: FloatArray  # (n, n) 0 or 1
    start: FloatArray  # (n,)
    gain: float

    @property
    def laplacian(self) -> FloatArray:
        """(n, n)."""
        return np.diag(self.adjacency.sum(axis=1)) - self.adjacency

    @property
    def slowest(self) -> float:
        """The Laplacian's second eigenvalue, of which the start is an eigenvector."""
        return float(np.linalg.eigvalsh(self.laplacian)[1])

    def decay(self, loss: float) -> float:
        """By what the mean disagreement is multiplied in a step."""
        return 1.0 - self.gain * (1.0 - loss) * self.slowest

    def steps(self, loss: float) -> int:
        """After how many steps the mean disagreement should be a fifth of the first."""
        return max(round(np.log(LEFT) / np.log(self.decay(loss))), 1)

    def after(self, steps: int, loss: float) -> Moments:
        """Exact moments after so many steps."""
        n, received = len(self.start), 1.0 - loss
        mean_step = np.eye(n) - self.gain * received * self.laplacian
        second, degree = np.outer(self.start, self.start), self.adjacency.sum(axis=1)
        for _ in range(steps):
            variances = np.diag(second)
            apart = self.adjacency @ variances + degree * variances - 2.0 * (self.adjacency * second).sum(axis=1)
            scatter = self.gain**2 * loss * received * apart
            second = mean_step @ second @ mean_step.T + np.diag(scatter)
        square_of_mean = second.sum() / n**2
        error = np.sqrt(max(np.trace(second) / n - square_of_mean, 0.0))
        return Moments(self.decay(loss) ** steps, float(error), float(np.sqrt(max(square_of_mean, 0.0))))


def graph_of(scenario: Path, range_m: float | None = None) -> Graph:
    """The graph of a scenario whose robots stand at given poses; with another range of the radio, if told."""
    table = tomllib.loads(scenario.read_text(encoding="utf-8"))
    nodes, reach_m = table["robots"]["nodes"], range_m or table["radio"]["range_m"]
    position_m = np.array(nodes["place"]["poses"], np.float64)[:, :2]
    apart_m = np.linalg.norm(position_m[:, None] - position_m[None, :], axis=2)
    adjacency = ((apart_m <= reach_m) & ~np.eye(len(position_m), dtype=bool)).astype(np.float64)
    return Graph(adjacency, np.array(nodes["params"]["start"], np.float64), nodes["params"]["gain"])
