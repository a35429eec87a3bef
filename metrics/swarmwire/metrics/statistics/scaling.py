"""How the work of a swarm, or its time for a task, changes with the number of robots."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.errors import BadInput
from swarmwire.metrics.statistics.bootstrap import drawn, percentile_interval
from swarmwire.metrics.statistics.sample import LEVEL, Interval, Sample
from swarmwire.metrics.statistics.survival import common_horizon, kaplan_meier, resampled_restricted_means


@dataclass(frozen=True)
class Scaling:
    """Relative to the smallest swarm, of N0 robots; each array is of the response's shape, NaN where that is NaN or 0.

    With N0 = 1 these are P(N) / (N P(1)), or T(1) / (N T(N)), and the fraction of Karp and Flatt (Comm. ACM 33, 1990),
    as used of swarms by Harwell and Gini (arXiv 1907.03880).
    """

    robots: FloatArray  # (sizes,) N
    reference: float  # N0
    speed_up: FloatArray  # X = P(N) / P(N0), or T(N0) / T(N)
    efficiency: FloatArray  # E = X N0 / N: 1 if each robot does as much as one of the smallest swarm
    serial_fraction: FloatArray  # e = (1/X - 1/s) / (1 - 1/s), s = N / N0: 0 if E is 1, 1 if more robots gain nothing


def scaling(robots: FloatArray, response: FloatArray, *, is_time: bool) -> Scaling:
    """The scaling of a response (…, sizes) over numbers of robots (sizes,): work done, or the time of a task.

    Leading axes may be resamples. BadInput unless there are at least two sizes, all positive, each once.
    """
    if len(robots) < 2 or len(np.unique(robots)) < len(robots) or robots.min() <= 0.0:
        raise BadInput("", "robots", f"expected at least two sizes, positive and each once, got {robots.tolist()}")
    smallest = int(np.argmin(robots))
    known = np.where(response != 0.0, response, np.nan)
    speed_up = known / known[..., smallest : smallest + 1]
    if is_time:
        speed_up = 1.0 / speed_up
    times = robots / robots[smallest]
    more = np.where(times > 1.0, 1.0 - 1.0 / times, np.nan)  # of the smallest itself there is no fraction
    serial = (1.0 / speed_up - 1.0 / times) / more
    return Scaling(robots, float(robots[smallest]), speed_up, speed_up / times, serial)


@dataclass(frozen=True)
class ScaledTimes:
    """Scaling of mean times up to one restriction time, which all sizes have."""

    mean: FloatArray  # (sizes,) of min(time, horizon), by Kaplan and Meier's estimate
    horizon: float  # up to when every run of every size was observed
    scaling: Scaling
    intervals: dict[str, list[Interval]]  # of speed_up, efficiency, serial_fraction: for each size, by the bootstrap


def scaling_of_times(robots: FloatArray, samples: Sequence[Sample], level: float = LEVEL) -> ScaledTimes:
    """The scaling of times, a sample for each of `robots` (sizes,); none is empty.

    Intervals resample seeds, of all sizes together. BadInput as `scaling`.
    """
    horizon = common_horizon(samples)
    means = np.array([kaplan_meier(sample).restricted_mean(horizon) for sample in samples])
    seeds = np.unique(np.concatenate([sample.seed for sample in samples]))
    counts = drawn(len(seeds))
    resampled = [
        resampled_restricted_means(sample, counts[:, np.searchsorted(seeds, sample.seed)], horizon)
        for sample in samples
    ]
    of_resamples = scaling(robots, np.stack(resampled, axis=1), is_time=True)
    intervals = {
        name: [percentile_interval(column, len(seeds), level) for column in getattr(of_resamples, name).T]
        for name in ("speed_up", "efficiency", "serial_fraction")
    }
    return ScaledTimes(means, horizon, scaling(robots, means, is_time=True), intervals)
