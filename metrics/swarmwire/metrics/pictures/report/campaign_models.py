"""The sections of fitted models: resilience to loss, and scaling with the number of robots."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.metrics.pictures.drawing.canvas import ACCENT, CURVE, INK, SOFT, Look
from swarmwire.metrics.pictures.report.axes import column_axes, fits_log, plain_legend, set_log, set_share_limits
from swarmwire.metrics.pictures.report.campaign_data import (
    CampaignData,
    Levels,
    Rounding,
    Samples,
    figure_name,
    response_title,
    rounding_of,
)
from swarmwire.metrics.pictures.report.page import Figure, Part, ReportSection, ReportTable, drawn_figure
from swarmwire.metrics.records.campaign.campaign_json import Response
from swarmwire.metrics.statistics.sample import Interval, SeedTable
from swarmwire.metrics.statistics.scaling import ScaledTimes, scaling_of_times
from swarmwire.metrics.statistics.summary import interval_text
from swarmwire.metrics.statistics.trends import (
    LOW_R_SQUARED,
    MIN_STRESSES,
    ChangePoint,
    Degradation,
    Fit,
    degradation,
    relative_means,
)
from swarmwire.metrics.text import listed, number, number_text, sentence

_LOSSES = ("share", "loss")  # last words of paths of parameters that are losses
_GRID = 200  # values at which a fit is drawn
_DASHES = ((0, (4, 2)), (0, (1, 1.5)), "-")  # line styles of the shapes that are not the best
_COUNT = re.compile(r"robots\.[^.]+\.count")
_RESILIENCE_METHOD = (
    "Resilience. a + b f and a exp(b f) are fitted by least squares to all runs at loss f, relative to the mean "
    "at the least loss; intervals resample seeds, and so include the error of that mean. AIC = n ln(RSS / n) + "
    "2 · 3, and a difference of less than 2 is not informative (Burnham and Anderson, Model Selection, 2002). A "
    "change point whose AIC, with 2 · 4, is lower by 2 is named instead: a step. R² below 0.5 explains little."
)
_SCALING_METHOD = (
    "Scaling. Karp and Flatt's fraction e = (1/X − 1/s) / (1 − 1/s) of speed-up X with s times as many robots "
    "(Communications of the ACM 33, 1990), as used of swarms by Harwell and Gini (arXiv 1907.03880). Times are "
    "means of min(time, h) by Kaplan and Meier's estimate, where h is the time up to which every run of every "
    "size was observed. Intervals resample seeds, of all sizes together."
)


@dataclass(frozen=True)
class FittedShape:
    """The values of a fit at shares (g,)."""

    label: str
    share: FloatArray
    value: FloatArray
    best: bool  # drawn highlighted


def resilience_curve(
    share: FloatArray,
    value: FloatArray,
    low: FloatArray,
    high: FloatArray,
    shapes: Sequence[FittedShape],
    title: str,
    x_label: str,
) -> Any:
    """Draw values (k,) with their intervals and fits over lost shares (k,)."""
    figure, axes = column_axes(title, x_label)
    axes.axhline(1.0, color=SOFT, lw=0.7, ls=":", zorder=1)
    lines: Look = {"color": CURVE, "lw": 1.0, "zorder": 3, "clip_on": False}
    axes.vlines(share, low, high, **lines)
    axes.plot(share, value, "o", color=CURVE, ms=3.6, zorder=4, clip_on=False)
    for shape, dashes in zip(shapes, _DASHES, strict=False):
        look: Look = {"color": ACCENT, "lw": 1.4} if shape.best else {"color": INK, "lw": 0.9, "ls": dashes}
        axes.plot(shape.share, shape.value, label=shape.label, zorder=2, **look)
    set_share_limits(axes, float(low.min()), float(high.max()))
    axes.set_xlim(-0.03 * float(share[-1]), None)
    plain_legend(axes, loc="best")
    return figure


def scaling_curve(
    robots: FloatArray, value: FloatArray, intervals: Sequence[Interval], title: str, level: float
) -> Any:
    """Draw values (k,) and their intervals over numbers of robots (k,); `level`: the value of ideal scaling."""
    figure, axes = column_axes(title, "robots")
    axes.axhline(level, color=SOFT, lw=0.7, ls="--", zorder=1)
    finite = np.isfinite(value)
    low, high = np.array(intervals).T
    axes.vlines(robots[finite], low[finite], high[finite], color=CURVE, lw=1.0)
    axes.plot(robots[finite], value[finite], "o-", color=CURVE, lw=1.3, ms=3.6)
    if fits_log(robots):
        set_log(axes.xaxis)
    axes.set_xticks(robots, [f"{count:g}" for count in robots])
    return figure


def _resilience_parts(data: CampaignData) -> list[Part]:
    samples = data.samples
    figures: list[Figure] = []
    rows: list[tuple[str, ...]] = []
    growing: list[str] = []
    for levels in filter(_is_loss, map(samples.levels, samples.folder.parameters)):
        for response in data.shown:
            table = _performance(samples, response, levels)
            fits = degradation(_numbers(levels), table)
            if fits is None:
                continue
            means, intervals = relative_means(_numbers(levels), table)
            finite = means[np.isfinite(means)]
            if finite[-1] >= finite[0]:
                growing.append(f"`{response.column}`")
                continue
            figures.append(_resilience_figure(response, levels, means, intervals, fits))
            rows += [_fit_cells(response, levels, fits, fit) for fit in (fits.linear, fits.exponential)]
            if fits.step is not None and fits.is_step:
                rows.append(_step_cells(response, levels, fits.step))
    if not figures:
        return []
    note = f" Not falling, and so without a curve: {listed(list(dict.fromkeys(growing)))}." if growing else ""
    text = (
        "Remaining share of a response: its mean relative to that without loss, with 95 % intervals over seeds. A "
        "time counts by its reciprocal (a rate), and as 0 if it is never reached. A line and an "
        f"exponential are fitted to all runs; the red one has the lowest AIC, of a step, too.{note}"
    )
    header = ("response", "over", "shape", "at 0", "slope at 0", "95 % interval", "R²", "AIC", "")
    return [text, *figures, ReportTable(header, tuple(rows), "Fits of the remaining share")]


RESILIENCE = ReportSection("Resilience", _resilience_parts, (_RESILIENCE_METHOD,))


def _is_loss(levels: Levels) -> bool:
    if levels.number is None or len(levels) < MIN_STRESSES or levels.path.rpartition(".")[2] not in _LOSSES:
        return False
    return bool(levels.number[0] == 0.0 and levels.number[-1] <= 1.0)


def _numbers(levels: Levels) -> FloatArray:
    assert levels.number is not None
    return levels.number


def _performance(samples: Samples, response: Response, levels: Levels) -> SeedTable:
    """Return the values at each level; rates in place of times, 0 for runs without the event."""
    cells = [tuple(levels.points(level)) for level in range(len(levels))]
    table = samples.table(response, cells)
    if response.kind != "time":
        return table
    reached, time_s = samples.reached(response, cells), table.value
    rate = np.where(reached, 1.0 / np.where(time_s > 0.0, time_s, np.nan), np.where(np.isnan(time_s), np.nan, 0.0))
    return table._replace(value=rate)


def _resilience_figure(
    response: Response, levels: Levels, means: FloatArray, intervals: list[Interval], fits: Degradation
) -> Figure:
    finite = np.isfinite(means)
    share, means, ends = _numbers(levels)[finite], means[finite], np.array(intervals)[finite]
    low, high = np.where(np.isnan(ends), means[:, None], ends).T
    grid = np.linspace(0.0, float(_numbers(levels)[-1]), _GRID)
    shapes = [
        FittedShape(fit.form, grid, fit.evaluate(grid), fit is fits.better and not fits.is_step)
        for fit in (fits.linear, fits.exponential)
        if np.isfinite(fit.a)
    ]
    if fits.step is not None and fits.is_step:
        step = np.where(grid < fits.step.position, fits.step.below, fits.step.above)
        shapes.append(FittedShape("step", grid, step, best=True))
    title = f"{'1 / ' if response.kind == 'time' else ''}{response_title(response)}, relative to none lost"
    name = figure_name("resilience", response.column, levels.path)
    figure = resilience_curve(share, means, low, high, shapes, title, levels.title)
    caption = f"{sentence(response_title(response))} over `{levels.path}`: {_verdict(fits)}."
    return drawn_figure(name, figure, caption)


def _verdict(fits: Degradation) -> str:
    """Return a text on the shape that fits best by AIC, and its quality."""
    if fits.step is not None and fits.is_step:
        lower = number(fits.better.aic - fits.step.aic)
        text = (
            f"a step at {fits.step.position:.3g} ({interval_text(fits.step.position_interval)}) by AIC, {lower} lower"
        )
        r_squared = fits.step.r_squared
    else:
        r_squared = fits.better.r_squared
        text = "AIC does not distinguish line and exponential"
        if fits.is_clear:
            text = f"{fits.better.form} by AIC, {number(abs(fits.linear.aic - fits.exponential.aic))} lower"
    if r_squared < LOW_R_SQUARED:
        text += f"; it explains little of the differences between runs, R² {r_squared:.2f}"
    return text


def _fit_cells(response: Response, levels: Levels, fits: Degradation, fit: Fit) -> tuple[str, ...]:
    better = ("better" if fits.is_clear else "no worse") if fit is fits.better and not fits.is_step else ""
    if fit.r_squared < LOW_R_SQUARED:
        better = f"{better}, explains little".removeprefix(", ")
    text, aic_text = Rounding(3).text, Rounding(1).text
    slope = " to ".join(map(text, fit.b_interval)) if np.isfinite(fit.b_interval).all() else "–"
    numbers = text(fit.a), text(fit.b), slope, text(fit.r_squared), aic_text(fit.aic)
    return (response.column, levels.path, fit.form, *numbers, better)


def _step_cells(response: Response, levels: Levels, step: ChangePoint) -> tuple[str, ...]:
    text, aic_text = Rounding(3).text, Rounding(1).text
    numbers = text(step.below), "–", "–", text(step.r_squared), aic_text(step.aic)
    return (response.column, levels.path, f"step at {step.position:.3g}", *numbers, "better")


def _scaling_parts(data: CampaignData) -> list[Part]:
    parts: list[Part] = []
    for levels in map(data.samples.levels, data.samples.folder.parameters):
        if not _COUNT.fullmatch(levels.path) or levels.number is None or len(levels) < 2 or levels.number[0] <= 0.0:
            continue
        for response in data.times:
            parts += _scaling(data.samples, response, levels)
    if not parts:
        return []
    text = (
        "Speed-up X is the mean time of the smallest swarm over that of N robots, with 95 % intervals over seeds; "
        "efficiency is X per robot, 1 where each does as much as one of the smallest swarm (dashed). Times count up to "
        "one restriction time for all N, in the caption. The serial fraction of Karp and Flatt is the share of the "
        "work that does not gain from more robots: 0 at best, 1 if they gain nothing, more if they are in one "
        "another's way."
    )
    return [text, *parts]


SCALING = ReportSection("Scaling", _scaling_parts, (_SCALING_METHOD,))


def _scaling(samples: Samples, response: Response, levels: Levels) -> list[Part]:
    """Return the figures and the table of a time over the numbers of robots of a group."""
    assert levels.number is not None
    by_size = [samples.sample(response, tuple(levels.points(level))) for level in range(len(levels))]
    measured = [index for index, sample in enumerate(by_size) if len(sample)]
    if len(measured) < 2 or measured[0] != 0 or not by_size[0].value.max() > 0.0:
        return []
    robots, labels = levels.number[measured], [levels.labels[index] for index in measured]
    scaled = scaling_of_times(robots, [by_size[index] for index in measured])
    figures: list[Part] = []
    for field, level in (("efficiency", 1.0), ("serial_fraction", 0.0)):
        title = field.replace("_", " ")
        name = figure_name(title, response.column, levels.path)
        curve = scaling_curve(robots, getattr(scaled.scaling, field), scaled.intervals[field], title, level)
        caption = f"{title.capitalize()} of {response_title(response)}, `{levels.path}`."
        figures.append(drawn_figure(name, curve, caption))
    return [*figures, _table(response, levels.path, labels, scaled)]


def _table(response: Response, path: str, labels: Sequence[str], scaled: ScaledTimes) -> ReportTable:
    rounded = rounding_of(scaled.mean.tolist()).text
    rows = tuple(
        (
            label,
            rounded(mean),
            *(
                _with_interval(getattr(scaled.scaling, name)[index], scaled.intervals[name][index])
                for name in scaled.intervals
            ),
        )
        for index, (label, mean) in enumerate(zip(labels, scaled.mean.tolist(), strict=True))
    )
    header = (path, f"mean time in {response.unit}", "speed-up", "efficiency", "serial fraction")
    restricted = f"{number_text(scaled.horizon)} {response.unit}"
    return ReportTable(header, rows, f"Scaling of {response_title(response)}, each time counted up to {restricted}")


def _with_interval(value: float, interval: Interval) -> str:
    text = Rounding(3).text
    has_width = np.isfinite(interval).all() and interval.low < interval.high
    return f"{text(value)} ({text(interval.low)} to {text(interval.high)})" if has_width else text(value)
