"""The likelihood of losses under a link that changes between a good and a bad state in continuous time.

The chain of Gilbert and Elliott as the emulator has it (comms/radio/stages/burst_loss.py). The state is hidden, so that
the likelihood of a sequence is a product of 2 x 2 matrices, one a packet: diag(what each state says of the packet)
times the transition since the one before. The product is taken in pairs, and pairs of pairs, so that arrays do the
work. Its entries are four columns: from good to good, from bad to good, from good to bad, from bad to bad.
"""

import math

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.radio.config.impairments import Bursts
from swarmwire.metrics.radio_fit.loss_sequences import LossSequences


def log_likelihood(sequences: LossSequences, bursts: Bursts) -> float:
    """The logarithm of the probability of these losses, all links together, each from its long-run state."""
    steps, total = _steps(sequences, bursts), 0.0
    while len(steps[0]) > 1:
        even = len(steps[0]) // 2 * 2
        pairs = _after([column[:even:2] for column in steps], [column[1:even:2] for column in steps])
        steps = [np.append(pair, column[even:]) for pair, column in zip(pairs, steps, strict=True)]
        largest = np.max(steps, axis=0)
        if not (largest > 0.0).all():
            return -math.inf
        total += float(np.log(largest).sum())
        steps = [column / largest for column in steps]
    gg, bg, gb, bb = (float(column[0]) for column in steps)
    whole = (gg + gb) * (1.0 - bursts.bad_share) + (bg + bb) * bursts.bad_share
    return total + math.log(whole) if whole > 0.0 else -math.inf


def _steps(sequences: LossSequences, bursts: Bursts) -> list[FloatArray]:
    """Each packet's matrix. A link's first packet comes from the long run, whatever was before."""
    share = bursts.bad_share
    kept = np.exp(-sequences.since_s * (1.0 / bursts.bad_s + 1.0 / bursts.good_s))  # 0 for inf
    bad_from_good, bad_from_bad = share * (1.0 - kept), share + (1.0 - share) * kept
    if_good = np.where(sequences.lost, bursts.loss_good, 1.0 - bursts.loss_good)
    if_bad = np.where(sequences.lost, bursts.loss_bad, 1.0 - bursts.loss_bad)
    return [
        if_good * (1.0 - bad_from_good),
        if_good * (1.0 - bad_from_bad),
        if_bad * bad_from_good,
        if_bad * bad_from_bad,
    ]


def _after(first: list[FloatArray], then: list[FloatArray]) -> list[FloatArray]:
    """The products of matrices: `then` after `first`."""
    gg, bg, gb, bb = first
    to_gg, to_bg, to_gb, to_bb = then
    return [to_gg * gg + to_bg * gb, to_gg * bg + to_bg * bb, to_gb * gg + to_bb * gb, to_gb * bg + to_bb * bb]
