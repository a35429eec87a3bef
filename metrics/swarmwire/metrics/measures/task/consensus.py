"""Consensus: how far robots are from agreeing on a number, and from the mean of their first numbers."""

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
    values, 0 or more; NaN while no robot alive has noted one.

    Source: R. Olfati-Saber, R. M. Murray, Consensus problems in networks of agents with switching topology and
    time-delays, IEEE Transactions on Automatic Control 49 (9), 2004.
    """

    name = "consensus_error"
    help = "root mean square deviation from their mean of the values that robots alive noted last, in the values' unit"
    needs = ()
    bounds = (0.0, None)

    def begin(self, static: Static) -> Measure:
        """A fresh measure; nothing is remembered."""
        return _error


def _error(view: TickView) -> FloatArray | float:
    value = view.truth.value
    return np.nan if value is None else _spread(value.reshape(view.alive.shape), view.alive)


@njit()
def _spread(value: AnyArray, alive: AnyArray):
    found = np.full(len(value), np.nan)
    for arena in range(len(value)):
        told: FloatArray = value[arena][alive[arena] & ~np.isnan(value[arena])]
        if len(told):
            found[arena] = np.sqrt(np.mean((told - np.mean(told)) ** 2))
    return found


@dataclass(frozen=True)
class ConsensusBias(Metric):
    """Mean of the robots' values - mean of the first values: 0 if a consensus on the average keeps the average.

    A robot's value is the number that it noted last (`note(value=…)`), of robots alive; its first one counts from when
    it was noted, and also when the robot dies. One-way losses carry a consensus away from the average, since what
    one robot gives the other does not take. In the unit of the values; NaN while no robot alive has noted one.

    Source: what is preserved on balanced graphs, R. Olfati-Saber, R. M. Murray, Consensus problems in networks of
    agents with switching topology and time-delays, IEEE Transactions on Automatic Control 49 (9), 2004.
    """

    name = "consensus_bias"
    help = "mean of the values that robots alive noted last - mean of those noted first, in the values' unit"
    needs = ()
    bounds = (-np.inf, None)

    def begin(self, static: Static) -> Measure:
        """A fresh measure, which keeps the first number of each robot."""
        first: FloatArray = np.full((static.arenas, static.robots), np.nan)

        def measure(view: TickView) -> FloatArray | float:
            if view.truth.value is None:
                return np.nan
            value = view.truth.value.reshape(first.shape)
            np.copyto(first, value, where=np.isnan(first))
            return _mean(np.where(view.alive, value, np.nan)) - _mean(first)

        return measure


def _mean(values: FloatArray) -> FloatArray:
    """Of each arena (arenas, robots) the mean of the numbers that are there, (arenas,); NaN if there is none."""
    there = ~np.isnan(values)
    count = np.count_nonzero(there, axis=1)
    return np.sum(values, axis=1, where=there) / np.where(count > 0, count, np.nan)
