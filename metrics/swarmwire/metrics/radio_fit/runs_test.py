"""Whether losses come in runs: the test of Wald and Wolfowitz (Ann. Math. Statist. 11, 1940), link by link."""

import math

import numpy as np

from swarmwire.metrics.radio_fit.loss_sequences import LossSequences


def runs_z(sequences: LossSequences) -> float:
    """Standard normal if the losses of each link come in any order; negative where they come in bursts.

    Given how many packets of a link were lost, so that links may differ in that. NaN if none can tell.
    """
    links = int(sequences.link.max()) + 1
    packets = np.bincount(sequences.link, minlength=links).astype(np.float64)
    lost = np.bincount(sequences.link, sequences.lost, minlength=links)
    changes = np.diff(sequences.lost, prepend=False) | np.isinf(sequences.since_s)
    runs = np.bincount(sequences.link, changes, minlength=links)
    both = 2.0 * lost * (packets - lost)
    tells = both > 0.0
    both, packets, runs = both[tells], packets[tells], runs[tells]
    variance = both * (both - packets) / (packets**2 * np.maximum(packets - 1.0, 1.0))
    total = float(variance.sum())
    return float((runs - both / packets - 1.0).sum()) / math.sqrt(total) if total > 0.0 else math.nan
