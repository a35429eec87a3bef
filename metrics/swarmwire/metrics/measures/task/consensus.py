"""Consensus: disagreement of the robots' numbers, and the bias of their mean from the mean of the first numbers."""

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.base.arrays import AnyArray, FloatArray
from swarmwire.comms.base.kernels import njit
from swarmwire.comms.observe.truth import Static
from swarmwire.metrics.measures.metric import Measure, Metric, TickView


@dataclass(frozen=True)
class ConsensusError(Metric):
    """Root mean square deviation of the robots' values from their mean: sqrt(mean of (x_i - mean of x)^2).

    x_i is the number that robot i noted last (`note(value=…)`); robots that are dead or have noted none do not count. 0
    in agreement on any value; n times its square is the squared norm of the disagreement vector. In the unit of the
    values, 0 or more; NaN while no robot alive has noted a value.

    Source: R. Olfati-Saber, R. M. Murray, Consensus problems in networks of agents with switching topology and
    time-delays, IEEE Transactions on Automatic Control 49 (9), 2004.
    """

    name = "consensus_error"
    help = "root mean square deviation from their mean of the values that robots alive noted last, in the values' unit"
    needs = ()
    bounds = (0.0, None)

    def begin(self, static: Static) -> Measure:
        """Return a measure without memory."""
        return _error


def _error(view: TickView) -> FloatArray | float:
    value = view.truth.value
    return np.nan if value is None else _spread(value.reshape(view.alive.shape), view.alive)


@njit()
def _spread(value: AnyArray, alive: AnyArray):
    spread = np.full(len(value), np.nan)
    for arena in range(len(value)):
        noted: FloatArray = value[arena][alive[arena] & ~np.isnan(value[arena])]
        if len(noted):
            spread[arena] = np.sqrt(np.mean((noted - np.mean(noted)) ** 2))
    return spread


@dataclass(frozen=True)
class ConsensusBias(Metric):
    """Mean of the robots' values - mean of the first values: 0 if a consensus on the average keeps the average.

    A value is the number that a robot alive noted last (`note(value=…)`); first values count from the tick of the note,
    also after the robot's death. One-way losses move a consensus away from the average, since one robot changes its
    value without the other. In the unit of the values; NaN while no robot alive has noted a value.

    Source: the invariant of balanced graphs, R. Olfati-Saber, R. M. Murray, Consensus problems in networks of agents
    with switching topology and time-delays, IEEE Transactions on Automatic Control 49 (9), 2004.
    """

    name = "consensus_bias"
    help = "mean of the values that robots alive noted last - mean of those noted first, in the values' unit"
    needs = ()
    bounds = (-np.inf, None)

    def begin(self, static: Static) -> Measure:
        """Return a measure that keeps the first number of each robot."""
        first: FloatArray = np.full((static.arenas, static.robots), np.nan)

        def measure(view: TickView) -> FloatArray | float:
            if view.truth.value is None:
                return np.nan
            value = view.truth.value.reshape(first.shape)
            np.copyto(first, value, where=np.isnan(first))
            return _mean(np.where(view.alive, value, np.nan)) - _mean(first)

        return measure


def _mean(values: FloatArray) -> FloatArray:
    """Return the mean of the numbers of each arena, (arenas,), without NaN; `values` is (arenas, robots)."""
    is_number = ~np.isnan(values)
    count = np.count_nonzero(is_number, axis=1)
    return np.sum(values, axis=1, where=is_number) / np.where(count > 0, count, np.nan)
