"""The range of a radio: the distance beyond which packets do not arrive any more, where distances are known."""

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.arrays import BoolArray, FloatArray
from swarmwire.metrics.radio_fit.estimate import Estimate

MIN_PACKETS = 100
MIN_BEYOND = 30  # packets in a row that were all lost farther out, for a range to have been seen
STRAY = 0.01  # share of the packets beyond the range that may arrive nevertheless


@dataclass(frozen=True)
class RangeFit:
    """What distances tell."""

    range_m: Estimate
    reached: bool  # whether packets were sent from farther; else the range is at least this
    beyond: int  # packets that were sent from farther, nearly all lost


def fit_range(distance_m: FloatArray, lost: BoolArray) -> RangeFit | str:
    """The step of delivery over distance (n,), of which NaN are not known; or what it lacks.

    The range is where two shares, one within it and one of at most a hundredth beyond, tell the losses best: maximum
    likelihood. Its error is the usual distance from one packet received out there to the next.
    """
    known = np.isfinite(distance_m)
    order = np.argsort(distance_m[known], kind="stable")
    distance, received = distance_m[known][order], ~lost[known][order]
    if len(distance) < MIN_PACKETS:
        return f"needs {MIN_PACKETS} packets with a distance, got {len(distance)}"
    if not received.any():
        return "needs packets that were received"
    count, total = np.arange(1.0, len(received) + 1.0), np.cumsum(received, dtype=np.float64)
    beyond, received_beyond = len(received) - count, total[-1] - total
    gain = _log_likelihood(total, count) + _log_likelihood_of(received_beyond, beyond, STRAY)
    best = int(np.argmax(np.where(received, gain, -np.inf)))  # a range ends where a packet was received
    reached = int(beyond[best]) >= MIN_BEYOND
    if not reached:
        best = int(np.flatnonzero(received)[-1])
    near = distance[: best + 1][received[: best + 1]][-MIN_BEYOND:]
    error_m = float(near[-1] - near[0]) / max(len(near) - 1, 1)
    return RangeFit(Estimate(float(distance[best]), error_m if reached else float("nan")), reached, int(beyond[best]))


def _log_likelihood(successes: FloatArray, count: FloatArray) -> FloatArray:
    """Of so many successes at the share that tells them best."""
    share = successes / np.maximum(count, 1)
    return _entropy(successes, share) + _entropy(count - successes, 1.0 - share)


def _log_likelihood_of(successes: FloatArray, count: FloatArray, most: float) -> FloatArray:
    """The same at a share that is `most` at most."""
    share = np.minimum(successes / np.maximum(count, 1), most)
    return _entropy(successes, share) + _entropy(count - successes, 1.0 - share)


def _entropy(count: FloatArray, share: FloatArray) -> FloatArray:
    return np.where(count > 0, count * np.log(np.maximum(share, 1e-300)), 0.0)
