"""How a response changes along a parameter: in a step, with stress (a line, or an exponential), with more robots.

The step has two levels, by least squares over all runs: of all ways to divide the ordered points into a lower and an
upper part, the one with the least sum of squares around two means (Hinkley, Biometrika 57, 1970, for normal noise).
There is a change only if that explains the runs better than one mean, and better than a line, by the information
criterion BIC = n ln(RSS / n) + k ln n. A step has two parameters more than a mean, its second level and its place; a
line has one.
"""

import math
import warnings
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from scipy import optimize

from swarmwire.comms.base.arrays import FloatArray, IntArray
from swarmwire.metrics.statistics.bootstrap import drawn_by_seed, percentile_interval
from swarmwire.metrics.statistics.sample import LEVEL, UNKNOWN, Interval, SeedTable

MIN_STRESSES = 3  # two points lie on every curve
PARAMETERS = 3  # a, b and the variance
GAUSS_NEWTON_STEPS = 20
ROUNDING = 1e-24  # of squares, relative to all
TELLING = 2.0  # smaller differences of AIC mean little (Burnham and Anderson, 2002)

Form = Literal["linear", "exponential"]
STEP_PARAMETERS = 4  # two levels, the place and the variance
EXPLAINS_LITTLE = 0.5  # R², below which a curve says little about the runs
SAME_VALUES = 1e-12  # relative, of values and of sums of squares


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
    """Both forms, and the step, fitted to the same runs."""

    linear: Fit
    exponential: Fit
    step: "ChangePoint | None"

    @property
    def better(self) -> Fit:
        """The one with the lower AIC; the line if they are equal."""
        return min((self.linear, self.exponential), key=lambda fit: fit.aic)

    @property
    def is_clear(self) -> bool:
        """Whether AIC distinguishes the forms, by 2 or more."""
        return abs(self.linear.aic - self.exponential.aic) >= TELLING

    @property
    def is_step(self) -> bool:
        """Whether a step has an AIC that is lower than that of both forms by 2 or more."""
        return self.step is not None and self.step.aic <= self.better.aic - TELLING


def relative_to_unharmed(stress: FloatArray, table: FloatArray) -> FloatArray:
    """Performance (stresses, seeds) over its mean at the least stress, of the same shape; NaN if that is 0 or none.

    Where less is better (times), hand over its reciprocal: how much is done in a time.
    """
    unharmed = table[int(np.argmin(stress))]
    there = unharmed[np.isfinite(unharmed)]
    mean = float(there.mean()) if len(there) else 0.0
    return table / (mean if mean != 0.0 else math.nan)


@dataclass(frozen=True)
class _Relative:
    """Resamples of the seeds: performance relative to that at the least stress of the same resample."""

    stress: FloatArray  # (stresses,)
    weight: FloatArray  # (resamples, stresses) number of runs
    mean: FloatArray  # (resamples, stresses) NaN of no run
    seeds: int

    def interval(self, values: FloatArray, level: float) -> Interval:
        """That of a statistic with these values (resamples,)."""
        return percentile_interval(values, self.seeds, level)


def _relative(stress: FloatArray, table: SeedTable) -> _Relative:
    sums = resampled_sums(table)
    with np.errstate(divide="ignore", invalid="ignore"):
        mean = sums.total / np.where(sums.count > 0.0, sums.count, np.nan)
        mean /= mean[:, [int(np.argmin(stress))]]
    return _Relative(stress, sums.count, mean, len(np.unique(table.seed)))


def relative_means(
    stress: FloatArray, table: FloatArray | SeedTable, level: float = LEVEL
) -> tuple[FloatArray, list[Interval]]:
    """Mean performance at each stress relative to that at the least stress, (stresses,), and the intervals.

    Intervals resample seeds, for numerator and denominator together: at the least stress it is 1 without an error.
    NaN at stresses without a value.
    """
    seed_table = SeedTable.from_table(table)
    sums, drawn = point_sums(seed_table), _relative(stress, seed_table)
    means = sums.total / np.where(sums.count > 0.0, sums.count, np.nan)
    return means / means[int(np.argmin(stress))], [drawn.interval(column, level) for column in drawn.mean.T]


def degradation(stress: FloatArray, table: FloatArray | SeedTable, level: float = LEVEL) -> Degradation | None:
    """Fit a + b f, a exp(b f) and a step to performance at stresses f (stresses,), relative to its mean at the least.

    Intervals resample seeds, and so include the error of that mean. None if fewer than three stresses have values.
    """
    value, seed = SeedTable.from_table(table)
    full = np.isfinite(value).any(axis=1)
    if np.count_nonzero(full) < MIN_STRESSES:
        return None
    stress, value = stress[full], relative_to_unharmed(stress[full], value[full])
    there = np.isfinite(value)
    if not there.any():
        return None
    x, y = np.broadcast_to(stress[:, None], value.shape)[there], value[there]
    line = np.polyfit(x, y, 1)
    slope, start = float(line[0]), float(line[1])
    guess = (start, slope / start if start > 0.0 else 0.0)
    drawn = _relative(stress, SeedTable(value, seed))
    return Degradation(
        _fit("linear", x, y, (start, slope), drawn, level),
        _fit("exponential", x, y, guess, drawn, level),
        change_point(stress, SeedTable(value, seed), level),
    )


def _curve(form: Form) -> Any:
    return _line if form == "linear" else _exponential


def _line(x: FloatArray, a: float, b: float) -> FloatArray:
    return a + b * x


def _exponential(x: FloatArray, a: float, b: float) -> FloatArray:
    return a * np.exp(np.minimum(b * x, 700.0))  # the search may try values that would overflow


def _fit(form: Form, x: FloatArray, y: FloatArray, guess: tuple[float, float], drawn: _Relative, level: float) -> Fit:
    scipy: Any = optimize
    try:
        with warnings.catch_warnings(action="ignore", category=optimize.OptimizeWarning):  # its variance is not used
            found = scipy.curve_fit(_curve(form), x, y, p0=guess)[0]
    except RuntimeError:  # its word for a search that came to no end
        return Fit(form, math.nan, math.nan, UNKNOWN, UNKNOWN, math.nan, math.inf)
    a, b = float(found[0]), float(found[1])
    residual = max(float(np.sum((y - _curve(form)(x, a, b)) ** 2)), ROUNDING * float(np.sum(y**2)))
    total = float(np.sum((y - y.mean()) ** 2))
    a_drawn, b_drawn = _refitted(form, drawn, a, b)
    return Fit(
        form,
        a,
        b,
        drawn.interval(a_drawn, level),
        drawn.interval(b_drawn, level),
        1.0 - residual / total if total > 0.0 else math.nan,
        len(y) * math.log(residual / len(y)) + 2.0 * PARAMETERS if residual > 0.0 else -math.inf,
    )


def _refitted(form: Form, drawn: _Relative, a: float, b: float) -> tuple[FloatArray, FloatArray]:
    """Both parameters of each resample, (resamples,), by Gauss and Newton's method from those of all runs.

    Runs at one stress weigh as their mean does with their number, so that the means are enough.
    """
    x, weight = drawn.stress, np.where(np.isfinite(drawn.mean), drawn.weight, 0.0)
    mean = np.where(np.isfinite(drawn.mean), drawn.mean, 0.0)
    a_drawn, b_drawn = np.full((len(mean), 1), a), np.full((len(mean), 1), b)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        for _ in range(1 if form == "linear" else GAUSS_NEWTON_STEPS):
            if form == "linear":
                by_a, by_b = np.ones_like(mean), np.broadcast_to(x, mean.shape)
            else:
                by_a = np.exp(np.minimum(b_drawn * x, 700.0))
                by_b = a_drawn * x * by_a
            left = mean - _curve(form)(x, a_drawn, b_drawn)
            aa, ab, bb, la, lb = (
                np.sum(weight * one * other, axis=1, keepdims=True)
                for one, other in ((by_a, by_a), (by_a, by_b), (by_b, by_b), (by_a, left), (by_b, left))
            )
            determinant = aa * bb - ab * ab
            a_drawn = a_drawn + (bb * la - ab * lb) / determinant
            b_drawn = b_drawn + (aa * lb - ab * la) / determinant
    return a_drawn[:, 0], b_drawn[:, 0]


@dataclass(frozen=True)
class PointSums:
    """Of the values of each point, (points,); of resamples (resamples, points)."""

    count: FloatArray
    total: FloatArray
    squares: FloatArray


def point_sums(table: SeedTable) -> PointSums:
    """The sums over all runs."""
    return _weighted(table, np.ones((1, table.value.shape[1])), 0)


def resampled_sums(table: SeedTable) -> PointSums:
    """The same of resamples of the seeds: a seed brings its runs of all points, or none."""
    return _weighted(table, drawn_by_seed(table.seed)[0].astype(np.float64))


def _weighted(table: SeedTable, weight: FloatArray, row: int | slice = slice(None)) -> PointSums:
    there = np.isfinite(table.value)
    value = np.where(there, table.value, 0.0)
    count, total, squares = (weight @ of.T for of in (there.astype(np.float64), value, value**2))
    return PointSums(count[row], total[row], squares[row])


@dataclass(frozen=True)
class ChangePoint:
    """A step. Its place is halfway between the two points that it divides."""

    after: float  # the last value of the parameter below it
    before: float  # the first above
    place: float
    place_interval: Interval
    below: float  # mean of the response below
    above: float
    effect: float  # above - below
    effect_interval: Interval
    standardised: float  # effect / standard deviation around the two levels; inf if nothing varies around them
    gain: float  # by how much BIC is lower than that of a constant or a line, > 0
    r_squared: float  # share of the runs' variance that is explained
    aic: float  # n ln(RSS / n) + 2 * 4


def change_point(parameter: FloatArray, table: FloatArray | SeedTable, level: float = LEVEL) -> ChangePoint | None:
    """The step along a parameter (points,), strictly rising, of the responses (points, seeds), NaN: no value.

    Intervals are bootstrap percentiles over seeds, given that there is a step. None if a constant or a line does as
    well, or fewer than two points have values.
    """
    value, seed = SeedTable.from_table(table)
    full = np.isfinite(value).any(axis=1)
    parameter, value = parameter[full], value[full]
    if len(parameter) < 2:
        return None
    mean = float(np.nanmean(value))
    centred = SeedTable(value - mean, seed)  # so that sums of squares keep their digits
    sums = point_sums(centred)
    residual = _residuals(sums)
    split = int(np.argmin(residual))
    gain = _gain(parameter, sums, float(residual[split]), mean)
    if not gain > 0.0:
        return None
    n, constant = float(sums.count.sum()), float(sums.squares.sum())
    least = max(float(residual[split]), SAME_VALUES * constant)
    places = 0.5 * (parameter[:-1] + parameter[1:])
    below, above = _levels(sums)
    effect = float(above[split] - below[split])
    resampled_place, resampled_effect = _resampled(centred, places)
    seeds = len(np.unique(seed))
    deviation = math.sqrt(float(residual[split]) / max(n - 2.0, 1.0))
    return ChangePoint(
        after=float(parameter[split]),
        before=float(parameter[split + 1]),
        place=float(places[split]),
        place_interval=percentile_interval(resampled_place, seeds, level),
        below=mean + float(below[split]),
        above=mean + float(above[split]),
        effect=effect,
        effect_interval=percentile_interval(resampled_effect, seeds, level),
        standardised=effect / deviation if deviation > 0.0 else math.copysign(math.inf, effect),
        gain=gain,
        r_squared=1.0 - float(residual[split]) / constant,
        aic=n * math.log(least / n) + 2.0 * STEP_PARAMETERS,
    )


def _levels(sums: PointSums) -> tuple[FloatArray, FloatArray]:
    """Means below and above each split, (…, splits); NaN where a resample drew no run of that part."""
    count, total = np.cumsum(sums.count, axis=-1), np.cumsum(sums.total, axis=-1)
    below = total[..., :-1] / np.where(count[..., :-1] > 0.0, count[..., :-1], np.nan)
    rest = count[..., -1:] - count[..., :-1]
    return below, (total[..., -1:] - total[..., :-1]) / np.where(rest > 0.0, rest, np.nan)


def _residuals(sums: PointSums) -> FloatArray:
    """Sum of squares around the two means of each split, (…, splits); inf without two."""
    below, above = _levels(sums)
    count = np.cumsum(sums.count, axis=-1)
    explained = count[..., :-1] * below**2 + (count[..., -1:] - count[..., :-1]) * above**2
    left = sums.squares.sum(axis=-1, keepdims=True) - explained
    return np.where(np.isfinite(left), np.maximum(left, 0.0), np.inf)


def _gain(parameter: FloatArray, sums: PointSums, residual: float, mean: float) -> float:
    """BIC of a constant or of a line, the lower one, less that of the step.

    0 if the constant leaves nothing to explain but rounding of the mean.
    """
    n, constant = float(sums.count.sum()), float(sums.squares.sum())
    if constant <= n * (SAME_VALUES * mean) ** 2:
        return 0.0

    def bic(squares: float, parameters: int) -> float:
        return n * math.log(max(squares, SAME_VALUES * constant)) + parameters * math.log(n)

    line = _line_residual(parameter, sums) if len(parameter) > 2 else constant  # two points lie on every line
    return min(bic(constant, 2), bic(line, 3)) - bic(residual, STEP_PARAMETERS)


def _line_residual(parameter: FloatArray, sums: PointSums) -> float:
    """Sum of squares around the best line, of values whose mean is 0."""
    x = parameter - np.average(parameter, weights=sums.count)
    return float(sums.squares.sum() - (x @ sums.total) ** 2 / (x**2 @ sums.count))


def _resampled(table: SeedTable, places: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Places and effects of the best steps of resampled seeds, each (resamples,)."""
    sums = resampled_sums(table)
    split: IntArray = np.argmin(_residuals(sums), axis=1)
    below, above = _levels(sums)
    rows = np.arange(len(split))
    effect = above[rows, split] - below[rows, split]
    return places[split], effect
