"""How performance falls with stress (a line, or an exponential), and how it grows with the number of robots."""

import math
import warnings
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from scipy import optimize, special

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.errors import BadInput
from swarmwire.metrics.statistics.sample import LEVEL, UNKNOWN, Interval

MIN_STRESSES = 3  # two points lie on every curve
PARAMETERS = 3  # a, b and the variance
ROUNDING = 1e-24  # of squares, relative to all
TELLING = 2.0  # smaller differences of AIC mean little (Burnham and Anderson, 2002)

Form = Literal["linear", "exponential"]


@dataclass(frozen=True)
class Fit:
    """Least squares over all runs; NaN, and AIC inf, where no curve of this form was found."""

    form: Form
    a: float  # at no stress: near 1 if performance is relative to the unharmed
    b: float  # slope per unit of stress at none, relative to a if exponential
    a_interval: Interval
    b_interval: Interval
    r_squared: float  # share of the runs' variance that is explained; NaN if there is none
    aic: float  # n ln(RSS / n) + 2 * 3

    def at(self, stress: FloatArray) -> FloatArray:
        """The curve at stresses of any shape."""
        return _curve(self.form)(stress, self.a, self.b)


@dataclass(frozen=True)
class Degradation:
    """Both forms, fitted to the same runs."""

    linear: Fit
    exponential: Fit

    @property
    def better(self) -> Fit:
        """The one with the lower AIC; the line if they are equal."""
        return min((self.linear, self.exponential), key=lambda fit: fit.aic)

    @property
    def is_clear(self) -> bool:
        """Whether AIC tells the forms apart, by 2 or more."""
        return abs(self.linear.aic - self.exponential.aic) >= TELLING


def relative_to_unharmed(stress: FloatArray, table: FloatArray) -> FloatArray:
    """Performance (stresses, seeds) over its mean at the least stress, of the same shape; NaN if that is 0 or none.

    Where less is better (times), hand over its reciprocal: how much is done in a time.
    """
    unharmed = table[int(np.argmin(stress))]
    there = unharmed[np.isfinite(unharmed)]
    mean = float(there.mean()) if len(there) else 0.0
    return table / (mean if mean != 0.0 else math.nan)


def degradation(stress: FloatArray, table: FloatArray, level: float = LEVEL) -> Degradation | None:
    """Fits a + b f and a exp(b f) to performance (stresses, seeds) at stresses f (stresses,); NaN: no value.

    Intervals are Student's, from the curvature of the squares. None if fewer than three stresses have values.
    """
    there = np.isfinite(table)
    if np.count_nonzero(there.any(axis=1)) < MIN_STRESSES:
        return None
    x = np.broadcast_to(stress[:, None], table.shape)[there]
    y = table[there]
    line = np.polyfit(x, y, 1)
    slope, start = float(line[0]), float(line[1])
    guess = (start, slope / start if start > 0.0 else 0.0)
    return Degradation(_fit("linear", x, y, (start, slope), level), _fit("exponential", x, y, guess, level))


def _curve(form: Form) -> Any:
    return _line if form == "linear" else _exponential


def _line(x: FloatArray, a: float, b: float) -> FloatArray:
    return a + b * x


def _exponential(x: FloatArray, a: float, b: float) -> FloatArray:
    return a * np.exp(np.minimum(b * x, 700.0))  # the search may try values that would overflow


def _fit(form: Form, x: FloatArray, y: FloatArray, guess: tuple[float, float], level: float) -> Fit:
    scipy: Any = optimize
    try:
        with warnings.catch_warnings(action="ignore", category=optimize.OptimizeWarning):  # its variance is inf then
            found, covariance = scipy.curve_fit(_curve(form), x, y, p0=guess)
    except RuntimeError:  # its word for a search that came to no end
        return Fit(form, math.nan, math.nan, UNKNOWN, UNKNOWN, math.nan, math.inf)
    a, b = float(found[0]), float(found[1])
    residual = max(float(np.sum((y - _curve(form)(x, a, b)) ** 2)), ROUNDING * float(np.sum(y**2)))
    total = float(np.sum((y - y.mean()) ** 2))
    student: Any = special.stdtrit(max(len(y) - 2, 1), 0.5 + 0.5 * level)
    reach_a, reach_b = (float(student) * math.sqrt(float(variance)) for variance in np.diag(covariance))
    return Fit(
        form,
        a,
        b,
        Interval(a - reach_a, a + reach_a),
        Interval(b - reach_b, b + reach_b),
        1.0 - residual / total if total > 0.0 else math.nan,
        len(y) * math.log(residual / len(y)) + 2.0 * PARAMETERS if residual > 0.0 else -math.inf,
    )


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
