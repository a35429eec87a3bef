"""The section of resilience: what is left of each response when more and more is lost."""

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.metrics.campaign.response import Response
from swarmwire.metrics.report.campaign.figure_name import figure_name
from swarmwire.metrics.report.campaign.levels import Levels, levels_of
from swarmwire.metrics.report.campaign.rounding import Rounding
from swarmwire.metrics.report.campaign.samples import Samples
from swarmwire.metrics.report.campaign.words import listed, response_title, sentence
from swarmwire.metrics.report.figures.resilience_curve import FittedShape, resilience_curve
from swarmwire.metrics.report.in_words import number
from swarmwire.metrics.report.section import Figure, Section, Table
from swarmwire.metrics.report.svg import as_svg
from swarmwire.metrics.statistics.bootstrap import percentile_interval, resampled_means
from swarmwire.metrics.statistics.trends import (
    MIN_STRESSES,
    Degradation,
    Fit,
    degradation,
    relative_to_unharmed,
)

_LOSSES = ("share", "loss")  # last words of parameters that say how much is lost
_GRID = 60


def resilience_section(samples: Samples, responses: tuple[Response, ...]) -> Section | None:
    """The section; None unless a share that starts at nothing lost is varied."""
    figures: list[Figure] = []
    rows: list[tuple[str, ...]] = []
    growing: list[str] = []
    for levels in filter(_is_loss, (levels_of(path, samples.folder.points) for path in samples.folder.parameters)):
        for response in responses:
            left = _what_is_left(samples, response, levels)
            if left is None:
                continue
            fits = degradation(_numbers(levels), left)
            if fits is None:
                continue
            present = _present(left)
            if present[-1].mean() >= present[0].mean():
                growing.append(f"`{response.column}`")
                continue
            figures.append(_figure(response, levels, left, fits))
            rows += [_words(response, levels, fits, fit) for fit in (fits.linear, fits.exponential)]
    if not figures:
        return None
    grows = f" Not falling, and so without a curve: {listed(list(dict.fromkeys(growing)))}." if growing else ""
    text = (
        "What is left of a response, relative to its mean with nothing lost, with 95 % intervals of the means. A "
        "time counts by its reciprocal, how much is done in a time, and as 0 where it never came. A line and an "
        f"exponential are fitted to all runs; the red one has the lower AIC.{grows}"
    )
    header = ("response", "over", "shape", "at 0", "slope at 0", "95 % interval", "R²", "AIC", "")
    return Section("Resilience", (text, *figures, Table(header, tuple(rows), "Fits of what is left")))


def _is_loss(levels: Levels) -> bool:
    if levels.number is None or len(levels) < MIN_STRESSES or levels.path.rpartition(".")[2] not in _LOSSES:
        return False
    return bool(levels.number[0] == 0.0 and levels.number[-1] <= 1.0)


def _numbers(levels: Levels) -> FloatArray:
    assert levels.number is not None
    return levels.number


def _what_is_left(samples: Samples, response: Response, levels: Levels) -> FloatArray | None:
    """Values (levels, runs) relative to nothing lost; None if there is nothing to compare with."""
    cells = [tuple(levels.points(level)) for level in range(len(levels))]
    table = samples.table(response, cells)
    if response.kind == "time":
        reached = samples.reached(response, cells)
        table = np.where(reached, 1.0 / np.where(table > 0.0, table, np.nan), np.where(np.isnan(table), np.nan, 0.0))
    left = relative_to_unharmed(_numbers(levels), table)
    return left if np.isfinite(left).any() else None


def _present(left: FloatArray) -> list[FloatArray]:
    """The values of each level that has any."""
    rows = [row[np.isfinite(row)] for row in left]
    return [row for row in rows if len(row)]


def _figure(response: Response, levels: Levels, left: FloatArray, fits: Degradation) -> Figure:
    share = _numbers(levels)
    full, present = np.isfinite(left).any(axis=1), _present(left)
    means = np.array([row.mean() for row in present])
    intervals = np.array([percentile_interval(resampled_means(row), len(row)) for row in present])
    low, high = np.where(np.isnan(intervals), means[:, None], intervals).T
    grid = np.linspace(0.0, float(share[-1]), _GRID)
    shapes = [
        FittedShape(fit.form, grid, fit.at(grid), fit is fits.better)
        for fit in (fits.linear, fits.exponential)
        if np.isfinite(fit.a)
    ]
    title = f"{'1 / ' if response.kind == 'time' else ''}{response_title(response)}, relative to none lost"
    name = figure_name("resilience", response.column, levels.path)
    drawn = resilience_curve(share[full], means, low, high, shapes, title, levels.path)
    if fits.told:
        verdict = f"{fits.better.form} by AIC, {number(abs(fits.linear.aic - fits.exponential.aic))} lower"
    else:
        verdict = "AIC does not tell the two shapes apart"
    caption = f"{sentence(response_title(response))} over `{levels.path}`: {verdict}."
    return Figure(name, as_svg(drawn, name), caption)


def _words(response: Response, levels: Levels, fits: Degradation, fit: Fit) -> tuple[str, ...]:
    better = ("better" if fits.told else "no worse") if fit is fits.better else ""
    three, one = Rounding(3).text, Rounding(1).text
    slope = " to ".join(map(three, fit.b_interval)) if np.isfinite(fit.b_interval).all() else "–"
    shown = three(fit.a), three(fit.b), slope, three(fit.r_squared), one(fit.aic)
    return (response.column, levels.path, fit.form, *shown, better)
