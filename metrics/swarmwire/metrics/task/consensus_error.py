"""Consensus error: how far robots are from agreeing on a number."""

# pyright: basic, reportUnknownMemberType=false

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.kernels import njit
from swarmwire.comms.truth import Static
from swarmwire.metrics.metric import Measure, Metric
from swarmwire.metrics.moment import Moment


@dataclass(frozen=True)
class ConsensusError(Metric):
    """Root mean square deviation of the robots' values from their mean: sqrt(mean of (x_i - mean of x)^2).

    x_i is the number that robot i told last (`note(value=…)`); who is dead or has told none does not count. 0 in
    agreement, whatever on; n times its square is the squared norm of the disagreement vector. In the unit of the
    values, 0 or more; NaN while no robot alive has told one.

    Source: R. Olfati-Saber, R. M. Murray, Consensus problems in networks of agents with switching topology and
    time-delays, IEEE Transactions on Automatic Control 49 (9), 2004.
    """

    name = "consensus_error"
    help = "root mean square deviation from their mean of the values that robots alive told, in the values' unit"
    bounds = (0.0, None)

    def begin(self, static: Static) -> Measure:
        """A fresh measure; nothing is remembered."""
        return _error


def _error(moment: Moment) -> FloatArray | float:
    value = moment.truth.value
    return np.nan if value is None else _spread(value.reshape(moment.alive.shape), moment.alive)


@njit()
def _spread(value, alive):
    found = np.full(len(value), np.nan)
    for arena in range(len(value)):
        told = value[arena][alive[arena] & ~np.isnan(value[arena])]
        if len(told):
            found[arena] = np.sqrt(np.mean((told - np.mean(told)) ** 2))
    return found
