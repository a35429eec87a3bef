"""The sections of models, with charts: resilience to loss, and scaling with the number of robots."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.metrics.pictures.drawing.canvas import ACCENT, CURVE, INK, SOFT, Look
from swarmwire.metrics.pictures.report.axes import column_axes, fits_log, plain_legend, set_log, set_share_limits
from swarmwire.metrics.pictures.report.campaign_data import (
    Levels,
    Rounding,
    Samples,
    figure_name,
    response_title,
    rounding_of,
)
from swarmwire.metrics.pictures.report.page import Figure, ReportTable, Section, drawn_figure
from swarmwire.metrics.records.campaign.spec import Response
from swarmwire.metrics.statistics.sample import Interval, SeedTable
from swarmwire.metrics.statistics.scaling import ScaledTimes, scaling_of_times
from swarmwire.metrics.statistics.summary import interval_text
from swarmwire.metrics.statistics.trends import (
    EXPLAINS_LITTLE,
    MIN_STRESSES,
    ChangePoint,
    Degradation,
    Fit,
    degradation,
    relative_means,
)
from swarmwire.metrics.text import listed, number, number_text, sentence

_LOSSES = ("share", "loss")  # last words of parameters of loss
_GRID = 200
_DASHES = ((0, (4, 2)), (0, (1, 1.5)), "-")  # of the shapes that are not the best
_COUNT = re.compile(r"robots\.[^.]+\.count")


@dataclass(frozen=True)
class FittedShape:
    """A fit at shares (g,)."""

    label: str
    share: FloatArray
    value: FloatArray
    better: bool  # than the others


def resilience_curve(
    share: FloatArray,
    value: FloatArray,
    low: FloatArray,
    high: FloatArray,
    shapes: Sequence[FittedShape],
    title: str,
    x_label: str,
) -> Any:
    """The figure of values (k,) with their intervals, over shares (k,) that were lost."""
    figure, axes = column_axes(title, x_label)
    axes.axhline(1.0, color=SOFT, lw=0.7, ls=":", zorder=1)
    lines: Look = {"color": CURVE, "lw": 1.0, "zorder": 3, "clip_on": False}
    axes.vlines(share, low, high, **lines)
    axes.plot(share, value, "o", color=CURVE, ms=3.6, zorder=4, clip_on=False)
    for shape, dashes in zip(shapes, _DASHES, strict=False):
        look: Look = {"color": ACCENT, "lw": 1.4} if shape.better else {"color": INK, "lw": 0.9, "ls": dashes}
        axes.plot(shape.share, shape.value, label=shape.label, zorder=2, **look)
    set_share_limits(axes, float(low.min()), float(high.max()))
    axes.set_xlim(-0.03 * float(share[-1]), None)
    plain_legend(axes, loc="best")
    return figure


def scaling_curve(
    robots: FloatArray, value: FloatArray, intervals: Sequence[Interval], title: str, level: float
) -> Any:
    """The figure of a value (k,) and its intervals over numbers of robots (k,); `level`: the value of ideal scaling."""
    figure, axes = column_axes(title, "robots")
    axes.axhline(level, color=SOFT, lw=0.7, ls="--", zorder=1)
    known = np.isfinite(value)
    low, high = np.array(intervals).T
    axes.vlines(robots[known], low[known], high[known], color=CURVE, lw=1.0)
    axes.plot(robots[known], value[known], "o-", color=CURVE, lw=1.3, ms=3.6)
    if fits_log(robots):
        set_log(axes.xaxis)
    axes.set_xticks(robots, [f"{count:g}" for count in robots])
    return figure


def resilience_section(samples: Samples, responses: tuple[Response, ...]) -> Section | None:
    """The section; None unless a share that starts at nothing lost is varied."""
    figures: list[Figure] = []
    rows: list[tuple[str, ...]] = []
    growing: list[str] = []
    for levels in filter(_is_loss, map(samples.levels, samples.folder.parameters)):
        for response in responses:
            table = _performance(samples, response, levels)
            fits = degradation(_numbers(levels), table)
            if fits is None:
                continue
            means, intervals = relative_means(_numbers(levels), table)
            present = means[np.isfinite(means)]
            if present[-1] >= present[0]:
                growing.append(f"`{response.column}`")
                continue
            figures.append(_resilience_figure(response, levels, means, intervals, fits))
            rows += [_words(response, levels, fits, fit) for fit in (fits.linear, fits.exponential)]
            if fits.step is not None and fits.is_step:
                rows.append(_step_words(response, levels, fits.step))
    if not figures:
        return None
    grows = f" Not falling, and so without a curve: {listed(list(dict.fromkeys(growing)))}." if growing else ""
    text = (
        "Remaining share of a response: its mean relative to that without loss, with 95 % intervals over seeds. A "
        "time counts by its reciprocal (a rate), and as 0 if it is never reached. A line and an "
        f"exponential are fitted to all runs; the red one has the lowest AIC, of a step, too.{grows}"
    )
    header = ("response", "over", "shape", "at 0", "slope at 0", "95 % interval", "R²", "AIC", "")
    return Section("Resilience", (text, *figures, ReportTable(header, tuple(rows), "Fits of the remaining share")))


def _is_loss(levels: Levels) -> bool:
    if levels.number is None or len(levels) < MIN_STRESSES or levels.path.rpartition(".")[2] not in _LOSSES:
        return False
    return bool(levels.number[0] == 0.0 and levels.number[-1] <= 1.0)


def _numbers(levels: Levels) -> FloatArray:
    assert levels.number is not None
    return levels.number


def _performance(samples: Samples, response: Response, levels: Levels) -> SeedTable:
    """The values at each level; rates in place of times, 0 where it was not reached."""
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
    share, full = _numbers(levels), np.isfinite(means)
    means, ends = means[full], np.array(intervals)[full]
    low, high = np.where(np.isnan(ends), means[:, None], ends).T
    grid = np.linspace(0.0, float(share[-1]), _GRID)
    shapes = [
        FittedShape(fit.form, grid, fit.at(grid), fit is fits.better and not fits.is_step)
        for fit in (fits.linear, fits.exponential)
        if np.isfinite(fit.a)
    ]
    if fits.step is not None and fits.is_step:
        step = np.where(grid < fits.step.place, fits.step.below, fits.step.above)
        shapes.append(FittedShape("step", grid, step, better=True))
    title = f"{'1 / ' if response.kind == 'time' else ''}{response_title(response)}, relative to none lost"
    name = figure_name("resilience", response.column, levels.path)
    drawn = resilience_curve(share[full], means, low, high, shapes, title, levels.title)
    caption = f"{sentence(response_title(response))} over `{levels.path}`: {_verdict(fits)}."
    return drawn_figure(name, drawn, caption)


def _verdict(fits: Degradation) -> str:
    """Which shape fits best by AIC, and how well."""
    if fits.step is not None and fits.is_step:
        lower = number(fits.better.aic - fits.step.aic)
        text = f"a step at {fits.step.place:.3g} ({interval_text(fits.step.place_interval)}) by AIC, {lower} lower"
        r_squared = fits.step.r_squared
    else:
        r_squared = fits.better.r_squared
        text = "AIC does not distinguish line and exponential"
        if fits.is_clear:
            text = f"{fits.better.form} by AIC, {number(abs(fits.linear.aic - fits.exponential.aic))} lower"
    if r_squared < EXPLAINS_LITTLE:
        text += f"; it explains little of the differences between runs, R² {r_squared:.2f}"
    return text


def _words(response: Response, levels: Levels, fits: Degradation, fit: Fit) -> tuple[str, ...]:
    better = ("better" if fits.is_clear else "no worse") if fit is fits.better and not fits.is_step else ""
    if fit.r_squared < EXPLAINS_LITTLE:
        better = f"{better}, explains little".removeprefix(", ")
    three, one = Rounding(3).text, Rounding(1).text
    slope = " to ".join(map(three, fit.b_interval)) if np.isfinite(fit.b_interval).all() else "–"
    shown = three(fit.a), three(fit.b), slope, three(fit.r_squared), one(fit.aic)
    return (response.column, levels.path, fit.form, *shown, better)


def _step_words(response: Response, levels: Levels, step: ChangePoint) -> tuple[str, ...]:
    three, one = Rounding(3).text, Rounding(1).text
    shown = three(step.below), "–", "–", three(step.r_squared), one(step.aic)
    return (response.column, levels.path, f"step at {step.place:.3g}", *shown, "better")


def scaling_section(samples: Samples, times: tuple[Response, ...]) -> Section | None:
    """The section; None unless a number of robots is varied and a time was measured."""
    parts: list[Figure | ReportTable] = []
    for levels in map(samples.levels, samples.folder.parameters):
        if not _COUNT.fullmatch(levels.path) or levels.number is None or len(levels) < 2 or levels.number[0] <= 0.0:
            continue
        for response in times:
            parts += _parts(samples, response, levels)
    if not parts:
        return None
    text = (
        "Speed-up X is the mean time of the smallest swarm over that of N robots, with 95 % intervals over seeds; "
        "efficiency is X per robot, 1 where each does as much as one of the smallest swarm (dashed). Times count up to "
        "one restriction time for all N, in the caption. The serial fraction of Karp and Flatt is the share of the "
        "work that does not gain from more robots: 0 at best, 1 if they gain nothing, more if they are in one "
        "another's way."
    )
    return Section("Scaling", (text, *parts))


def _parts(samples: Samples, response: Response, levels: Levels) -> list[Figure | ReportTable]:
    assert levels.number is not None
    by_size = [samples.sample(response, tuple(levels.points(level))) for level in range(len(levels))]
    full = [place for place, sample in enumerate(by_size) if len(sample)]
    if len(full) < 2 or full[0] != 0 or not by_size[0].value.max() > 0.0:
        return []
    robots, labels = levels.number[full], [levels.labels[place] for place in full]
    scaled = scaling_of_times(robots, [by_size[place] for place in full])
    figures: list[Figure | ReportTable] = []
    for field, level in (("efficiency", 1.0), ("serial_fraction", 0.0)):
        what = field.replace("_", " ")
        name = figure_name(what, response.column, levels.path)
        drawn_curve = scaling_curve(robots, getattr(scaled.scaling, field), scaled.intervals[field], what, level)
        caption = f"{what.capitalize()} of {response_title(response)}, `{levels.path}`."
        figures.append(drawn_figure(name, drawn_curve, caption))
    return [*figures, _table(response, levels.path, labels, scaled)]


def _table(response: Response, path: str, labels: Sequence[str], scaled: ScaledTimes) -> ReportTable:
    rounded = rounding_of(scaled.mean.tolist()).text
    rows = tuple(
        (
            label,
            rounded(mean),
            *(
                _with_interval(getattr(scaled.scaling, name)[place], scaled.intervals[name][place])
                for name in scaled.intervals
            ),
        )
        for place, (label, mean) in enumerate(zip(labels, scaled.mean.tolist(), strict=True))
    )
    header = (path, f"mean time in {response.unit}", "speed-up", "efficiency", "serial fraction")
    restricted = f"{number_text(scaled.horizon)} {response.unit}"
    return ReportTable(header, rows, f"Scaling of {response_title(response)}, each time counted up to {restricted}")


def _with_interval(value: float, interval: Interval) -> str:
    text = Rounding(3).text
    known = np.isfinite(interval).all() and interval.low < interval.high
    return f"{text(value)} ({text(interval.low)} to {text(interval.high)})" if known else text(value)
