"""Consensus bias: how far what robots come to agree on is from the mean of what they began with."""

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.truth import Static
from swarmwire.metrics.metric import Measure, Metric
from swarmwire.metrics.moment import Moment


@dataclass(frozen=True)
class ConsensusBias(Metric):
    """Mean of the robots' values - mean of the first values: 0 if a consensus on the average keeps the average.

    A robot's value is the number that it told last (`note(value=…)`), of robots alive; its first one counts from when
    it was told, and whatever becomes of the robot. One-way losses carry a consensus away from the average, since what
    one robot gives the other does not take. In the unit of the values; NaN while no robot alive has told one.

    Source: what is preserved on balanced graphs, R. Olfati-Saber, R. M. Murray, Consensus problems in networks of
    agents with switching topology and time-delays, IEEE Transactions on Automatic Control 49 (9), 2004.
    """

    name = "consensus_bias"
    help = "mean of the values that robots alive told last - mean of those told first, in the values' unit"
    bounds = (-np.inf, None)

    def begin(self, static: Static) -> Measure:
        """A fresh measure, which keeps what each robot told first."""
        first: FloatArray = np.full((static.arenas, static.robots), np.nan)

        def measure(moment: Moment) -> FloatArray | float:
            if moment.truth.value is None:
                return np.nan
            value = moment.truth.value.reshape(first.shape)
            np.copyto(first, value, where=np.isnan(first))
            return _mean(np.where(moment.alive, value, np.nan)) - _mean(first)

        return measure


def _mean(values: FloatArray) -> FloatArray:
    """Of each arena (arenas, robots) the mean of the numbers that are there, (arenas,); NaN if there is none."""
    there = ~np.isnan(values)
    count = np.count_nonzero(there, axis=1)
    return np.sum(values, axis=1, where=there) / np.where(count > 0, count, np.nan)
