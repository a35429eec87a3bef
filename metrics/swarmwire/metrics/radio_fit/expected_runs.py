"""How long runs of lost packets are under bursts, for packets that come at even intervals."""

import math

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.radio.config.impairments import Bursts


def expected_runs(bursts: Bursts, interval_s: float, longest: int) -> FloatArray:
    """The shares (longest,) of runs of 1, 2, … packets; those of longer runs are missing from their sum of 1."""
    share = bursts.bad_share
    kept = math.exp(-interval_s * (1.0 / bursts.bad_s + 1.0 / bursts.good_s))
    long_run = np.array([1.0 - share, share])
    step = (1.0 - kept) * long_run[:, None] + kept * np.eye(2)  # to good and bad, from good and bad
    loss = np.array([bursts.loss_good, bursts.loss_bad])
    state = loss * (step @ ((1.0 - loss) * long_run))  # received, then lost
    state = state / state.sum()
    shares = np.empty(longest)
    for i in range(longest):
        shares[i] = ((1.0 - loss) * (step @ state)).sum()
        state = loss * (step @ state)
    return shares
