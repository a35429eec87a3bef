"""Trends of a response along a parameter: a step, or a decline with stress (a line or an exponential).

The step has two levels, by least squares over all runs: of all divisions of the ordered points into a lower and an
upper part, the one with the least sum of squares around two means (Hinkley, Biometrika 57, 1970, for normal noise).
There is a change only if the step explains the runs better than one mean, and better than a line, by the information
criterion BIC = n ln(RSS / n) + k ln n. A step has two parameters more than a mean, its second level and its position; a
line has one more.
"""

import math
import warnings
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from scipy import optimize

from swarmwire.comms.base.arrays import FloatArray, IntArray
from swarmwire.metrics.statistics.bootstrap import draw_counts_by_seed, percentile_interval
from swarmwire.metrics.statistics.sample import LEVEL, UNKNOWN, Interval, SeedTable

MIN_STRESSES = 3  # two points lie on every curve
PARAMETERS = 3  # a, b and the variance
GAUSS_NEWTON_STEPS = 20
ROUNDING = 1e-24  # relative error of a sum of squares
CLEAR_AIC_DIFFERENCE = 2.0  # smaller differences of AIC mean little (Burnham and Anderson, 2002)

Form = Literal["linear", "exponential"]
STEP_PARAMETERS = 4  # two levels, the position and the variance
LOW_R_SQUARED = 0.5  # a curve with a lower R² explains little
SAME_VALUES = 1e-12  # relative error of values and of sums of squares


@dataclass(frozen=True)
class Fit:
    """Least squares over all runs; NaN, and AIC inf, if no curve of this form converged."""

    form: Form
    a: float  #: value without stress: near 1 for relative performance
    b: float  #: slope per unit of stress without stress, relative to a if exponential
    a_interval: Interval
    b_interval: Interval
    r_squared: float  #: explained share of the runs' variance; NaN without variance
    aic: float  #: n ln(RSS / n) + 2 * 3

    def evaluate(self, stress: FloatArray) -> FloatArray:
        """Return the curve at stresses of any shape."""
        return _curve(self.form)(stress, self.a, self.b)


@dataclass(frozen=True)
class Degradation:
    """The two curves and the step, fitted to the same runs."""

    linear: Fit
    exponential: Fit
    step: "ChangePoint | None"

    @property
    def better(self) -> Fit:
        """The curve with the lower AIC; the line if they are equal."""
        return min((self.linear, self.exponential), key=lambda fit: fit.aic)

    @property
    def is_clear(self) -> bool:
        """True if AIC distinguishes the curves, by 2 or more."""
        return abs(self.linear.aic - self.exponential.aic) >= CLEAR_AIC_DIFFERENCE

    @property
    def is_step(self) -> bool:
        """True if a step has an AIC that is lower than that of both curves by 2 or more."""
        return self.step is not None and self.step.aic <= self.better.aic - CLEAR_AIC_DIFFERENCE


def relative_to_unharmed(stress: FloatArray, table: FloatArray) -> FloatArray:
    """Return performance (stresses, seeds) divided by its mean at the least stress; NaN if that is 0 or undefined.

    For times, for which less is better, pass their reciprocals.
    """
    unharmed = table[int(np.argmin(stress))]
    defined = unharmed[np.isfinite(unharmed)]
    mean = float(defined.mean()) if len(defined) else 0.0
    return table / (mean if mean != 0.0 else math.nan)


@dataclass(frozen=True)
class _Relative:
    """Resamples of the seeds: performance relative to that at the least stress of the same resample."""

    stress: FloatArray  # (stresses,)
    weight: FloatArray  # (resamples, stresses) number of runs
    mean: FloatArray  # (resamples, stresses) NaN without a run
    seeds: int

    def interval(self, values: FloatArray, level: float) -> Interval:
        """Return the interval of a statistic with these values (resamples,)."""
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
    """Return mean performance at each stress relative to that at the least stress, (stresses,), and the intervals.

    Intervals resample seeds, for numerator and denominator together: at the least stress the mean is exactly 1. NaN at
    stresses without a value.
    """
    seed_table = SeedTable.from_table(table)
    sums, resamples = point_sums(seed_table), _relative(stress, seed_table)
    means = sums.total / np.where(sums.count > 0.0, sums.count, np.nan)
    return means / means[int(np.argmin(stress))], [resamples.interval(column, level) for column in resamples.mean.T]


def degradation(stress: FloatArray, table: FloatArray | SeedTable, level: float = LEVEL) -> Degradation | None:
    """Fit a + b f, a exp(b f) and a step to performance at stresses f (stresses,), relative to its mean at the least.

    Intervals resample seeds, and so include the error of that mean. None if fewer than three stresses have values.
    """
    value, seed = SeedTable.from_table(table)
    has_value = np.isfinite(value).any(axis=1)
    if np.count_nonzero(has_value) < MIN_STRESSES:
        return None
    stress, value = stress[has_value], relative_to_unharmed(stress[has_value], value[has_value])
    defined = np.isfinite(value)
    if not defined.any():
        return None
    x, y = np.broadcast_to(stress[:, None], value.shape)[defined], value[defined]
    line = np.polyfit(x, y, 1)
    slope, start = float(line[0]), float(line[1])
    guess = (start, slope / start if start > 0.0 else 0.0)
    resamples = _relative(stress, SeedTable(value, seed))
    return Degradation(
        _fit("linear", x, y, (start, slope), resamples, level),
        _fit("exponential", x, y, guess, resamples, level),
        change_point(stress, SeedTable(value, seed), level),
    )


def _curve(form: Form) -> Any:
    return _line if form == "linear" else _exponential


def _line(x: FloatArray, a: float, b: float) -> FloatArray:
    return a + b * x


def _exponential(x: FloatArray, a: float, b: float) -> FloatArray:
    return a * np.exp(np.minimum(b * x, 700.0))  # the optimizer may try values that overflow


def _fit(
    form: Form, x: FloatArray, y: FloatArray, guess: tuple[float, float], resamples: _Relative, level: float
) -> Fit:
    scipy: Any = optimize
    try:
        with warnings.catch_warnings(action="ignore", category=optimize.OptimizeWarning):  # its variance is not used
            parameters = scipy.curve_fit(_curve(form), x, y, p0=guess)[0]
    except RuntimeError:  # no convergence
        return Fit(form, math.nan, math.nan, UNKNOWN, UNKNOWN, math.nan, math.inf)
    a, b = float(parameters[0]), float(parameters[1])
    residual = max(float(np.sum((y - _curve(form)(x, a, b)) ** 2)), ROUNDING * float(np.sum(y**2)))
    total = float(np.sum((y - y.mean()) ** 2))
    a_resampled, b_resampled = _refit(form, resamples, a, b)
    return Fit(
        form=form,
        a=a,
        b=b,
        a_interval=resamples.interval(a_resampled, level),
        b_interval=resamples.interval(b_resampled, level),
        r_squared=1.0 - residual / total if total > 0.0 else math.nan,
        aic=len(y) * math.log(residual / len(y)) + 2.0 * PARAMETERS if residual > 0.0 else -math.inf,
    )


def _refit(form: Form, resamples: _Relative, a: float, b: float) -> tuple[FloatArray, FloatArray]:
    """Return the parameters of each resample, (resamples,) each, by Gauss and Newton's method from those of all runs.

    The runs at one stress are equivalent to their mean, weighted by their number, so the means are enough.
    """
    x, weight = resamples.stress, np.where(np.isfinite(resamples.mean), resamples.weight, 0.0)
    mean = np.where(np.isfinite(resamples.mean), resamples.mean, 0.0)
    a_resampled, b_resampled = np.full((len(mean), 1), a), np.full((len(mean), 1), b)

    def weighted_sum(first: FloatArray, second: FloatArray) -> FloatArray:
        return np.sum(weight * first * second, axis=1, keepdims=True)

    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        for _ in range(1 if form == "linear" else GAUSS_NEWTON_STEPS):
            if form == "linear":
                da, db = np.ones_like(mean), np.broadcast_to(x, mean.shape)  # derivatives by a and b
            else:
                da = np.exp(np.minimum(b_resampled * x, 700.0))
                db = a_resampled * x * da
            residual = mean - _curve(form)(x, a_resampled, b_resampled)
            aa, ab, bb = weighted_sum(da, da), weighted_sum(da, db), weighted_sum(db, db)
            ra, rb = weighted_sum(da, residual), weighted_sum(db, residual)
            determinant = aa * bb - ab * ab
            a_resampled = a_resampled + (bb * ra - ab * rb) / determinant
            b_resampled = b_resampled + (aa * rb - ab * ra) / determinant
    return a_resampled[:, 0], b_resampled[:, 0]


@dataclass(frozen=True)
class PointSums:
    """Number, sum and sum of squares of the values of each point, (points,), or (resamples, points)."""

    count: FloatArray
    total: FloatArray
    squares: FloatArray


def point_sums(table: SeedTable) -> PointSums:
    """Return the sums over all runs."""
    return _weighted(table, np.ones((1, table.value.shape[1])), 0)


def resampled_sums(table: SeedTable) -> PointSums:
    """Return the sums of resamples of the seeds: a draw of a seed includes its runs at all points."""
    return _weighted(table, draw_counts_by_seed(table.seed)[0].astype(np.float64))


def _weighted(table: SeedTable, weight: FloatArray, row: int | slice = slice(None)) -> PointSums:
    defined = np.isfinite(table.value)
    value = np.where(defined, table.value, 0.0)
    count, total, squares = (weight @ terms.T for terms in (defined.astype(np.float64), value, value**2))
    return PointSums(count[row], total[row], squares[row])


@dataclass(frozen=True)
class ChangePoint:
    """A step. Its position is halfway between the two points that it divides."""

    after: float  #: the last value of the parameter below it
    before: float  #: the first value above it
    position: float
    position_interval: Interval
    below: float  #: mean of the response below
    above: float
    effect: float  #: above - below
    effect_interval: Interval
    standardised: float  #: effect / standard deviation around the two levels; inf without variance around them
    gain: float  #: BIC of a constant or a line, the lower one, minus BIC of the step, > 0
    r_squared: float  #: explained share of the runs' variance
    aic: float  #: n ln(RSS / n) + 2 * 4


def change_point(parameter: FloatArray, table: FloatArray | SeedTable, level: float = LEVEL) -> ChangePoint | None:
    """Return the step along a parameter (points,), strictly rising, of the responses (points, seeds), NaN: no value.

    Intervals are bootstrap percentiles over seeds, given that there is a step. None if a constant or a line fits as
    well, or fewer than two points have values.
    """
    value, seed = SeedTable.from_table(table)
    has_value = np.isfinite(value).any(axis=1)
    parameter, value = parameter[has_value], value[has_value]
    if len(parameter) < 2:
        return None
    mean = float(np.nanmean(value))
    centred = SeedTable(value - mean, seed)  # this preserves digits of the sums of squares
    sums = point_sums(centred)
    residual = _residuals(sums)
    split = int(np.argmin(residual))
    gain = _gain(parameter, sums, float(residual[split]), mean)
    if not gain > 0.0:
        return None
    n, constant = float(sums.count.sum()), float(sums.squares.sum())
    least = max(float(residual[split]), SAME_VALUES * constant)
    positions = 0.5 * (parameter[:-1] + parameter[1:])
    below, above = _levels(sums)
    effect = float(above[split] - below[split])
    resampled_positions, resampled_effect = _resampled(centred, positions)
    seeds = len(np.unique(seed))
    deviation = math.sqrt(float(residual[split]) / max(n - 2.0, 1.0))
    return ChangePoint(
        after=float(parameter[split]),
        before=float(parameter[split + 1]),
        position=float(positions[split]),
        position_interval=percentile_interval(resampled_positions, seeds, level),
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
    """Return the means below and above each split, (…, splits); NaN if a resample has no run in that part."""
    count, total = np.cumsum(sums.count, axis=-1), np.cumsum(sums.total, axis=-1)
    count_below, count_above = count[..., :-1], count[..., -1:] - count[..., :-1]
    below = total[..., :-1] / np.where(count_below > 0.0, count_below, np.nan)
    return below, (total[..., -1:] - total[..., :-1]) / np.where(count_above > 0.0, count_above, np.nan)


def _residuals(sums: PointSums) -> FloatArray:
    """Return the sum of squares around the two means of each split, (…, splits); inf without two means."""
    below, above = _levels(sums)
    count = np.cumsum(sums.count, axis=-1)
    explained = count[..., :-1] * below**2 + (count[..., -1:] - count[..., :-1]) * above**2
    residual = sums.squares.sum(axis=-1, keepdims=True) - explained
    return np.where(np.isfinite(residual), np.maximum(residual, 0.0), np.inf)


def _gain(parameter: FloatArray, sums: PointSums, residual: float, mean: float) -> float:
    """Return the BIC of a constant or of a line, the lower one, minus that of the step.

    0 if all values are equal up to rounding.
    """
    n, constant = float(sums.count.sum()), float(sums.squares.sum())
    if constant <= n * (SAME_VALUES * mean) ** 2:
        return 0.0

    def bic(squares: float, parameters: int) -> float:
        return n * math.log(max(squares, SAME_VALUES * constant)) + parameters * math.log(n)

    line = _line_residual(parameter, sums) if len(parameter) > 2 else constant  # two points lie on every line
    return min(bic(constant, 2), bic(line, 3)) - bic(residual, STEP_PARAMETERS)


def _line_residual(parameter: FloatArray, sums: PointSums) -> float:
    """Return the sum of squares around the best line, for values with mean 0."""
    x = parameter - np.average(parameter, weights=sums.count)
    return float(sums.squares.sum() - (x @ sums.total) ** 2 / (x**2 @ sums.count))


def _resampled(table: SeedTable, positions: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return positions and effects of the best steps of resampled seeds, (resamples,) each."""
    sums = resampled_sums(table)
    split: IntArray = np.argmin(_residuals(sums), axis=1)
    below, above = _levels(sums)
    rows = np.arange(len(split))
    effect = above[rows, split] - below[rows, split]
    return positions[split], effect
