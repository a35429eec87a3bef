"""Scaling of a swarm's work, or of its time for a task, with the number of robots."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.errors import BadInput
from swarmwire.metrics.statistics.bootstrap import draw_counts, percentile_interval
from swarmwire.metrics.statistics.sample import LEVEL, Interval, Sample
from swarmwire.metrics.statistics.survival import common_horizon, kaplan_meier, resampled_restricted_means


@dataclass(frozen=True)
class Scaling:
    """Scaling relative to the smallest swarm, of N0 robots; arrays have the response's shape, NaN where it is NaN or 0.

    With N0 = 1 the efficiency is P(N) / (N P(1)), or T(1) / (N T(N)), and the serial fraction that of Karp and Flatt
    (Comm. ACM 33, 1990), which Harwell and Gini apply to swarms (arXiv 1907.03880).
    """

    robots: FloatArray  #: (sizes,) N
    reference: float  #: N0
    speed_up: FloatArray  #: X = P(N) / P(N0), or T(N0) / T(N)
    efficiency: FloatArray  #: E = X N0 / N: 1 if each robot does as much as a robot of the smallest swarm
    serial_fraction: FloatArray  #: e = (1/X - 1/s) / (1 - 1/s), s = N / N0: 0 if E is 1, 1 if more robots gain nothing


def scaling(robots: FloatArray, response: FloatArray, *, is_time: bool) -> Scaling:
    """Return the scaling of a response (…, sizes) over numbers of robots (sizes,): work done, or the time of a task.

    Leading axes may be resamples. BadInput unless there are at least two sizes, positive and distinct.
    """
    if len(robots) < 2 or len(np.unique(robots)) < len(robots) or robots.min() <= 0.0:
        raise BadInput("", "robots", f"expected at least two sizes, positive and each once, got {robots.tolist()}")
    smallest = int(np.argmin(robots))
    nonzero = np.where(response != 0.0, response, np.nan)
    speed_up = nonzero / nonzero[..., smallest : smallest + 1]
    if is_time:
        speed_up = 1.0 / speed_up
    factor = robots / robots[smallest]
    divisor = np.where(factor > 1.0, 1.0 - 1.0 / factor, np.nan)  # the smallest swarm has no serial fraction
    serial = (1.0 / speed_up - 1.0 / factor) / divisor
    return Scaling(robots, float(robots[smallest]), speed_up, speed_up / factor, serial)


@dataclass(frozen=True)
class ScaledTimes:
    """Scaling of mean times, restricted to a time that all sizes share."""

    mean: FloatArray  #: (sizes,) mean of min(time, horizon), by Kaplan and Meier's estimate
    horizon: float  #: time up to which every run of every size was observed
    scaling: Scaling
    intervals: dict[str, list[Interval]]  #: speed_up, efficiency, serial_fraction: bootstrap intervals for each size


def scaling_of_times(robots: FloatArray, samples: Sequence[Sample], level: float = LEVEL) -> ScaledTimes:
    """Return the scaling of times, with a nonempty sample for each of `robots` (sizes,).

    Intervals resample seeds, for all sizes together. Raises the errors of `scaling`.
    """
    horizon = common_horizon(samples)
    means = np.array([kaplan_meier(sample).restricted_mean(horizon) for sample in samples])
    seeds = np.unique(np.concatenate([sample.seed for sample in samples]))
    counts = draw_counts(len(seeds))
    resampled = [
        resampled_restricted_means(sample, counts[:, np.searchsorted(seeds, sample.seed)], horizon)
        for sample in samples
    ]
    resampled_scaling = scaling(robots, np.stack(resampled, axis=1), is_time=True)
    intervals = {
        name: [percentile_interval(column, len(seeds), level) for column in getattr(resampled_scaling, name).T]
        for name in ("speed_up", "efficiency", "serial_fraction")
    }
    return ScaledTimes(means, horizon, scaling(robots, means, is_time=True), intervals)
