"""The section of survival: the share of runs in which a time's event happened, and Kaplan-Meier curves over time."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.metrics.pictures.drawing.canvas import CURVE, GRID, Look
from swarmwire.metrics.pictures.report.axes import (
    column_axes,
    fits_log,
    ordered_colors,
    plain_legend,
    set_log,
    set_share_limits,
)
from swarmwire.metrics.pictures.report.campaign_data import CampaignData, Levels, Samples, figure_name, response_title
from swarmwire.metrics.pictures.report.page import Figure, Part, ReportSection, drawn_figure
from swarmwire.metrics.records.campaign.campaign_json import Response
from swarmwire.metrics.statistics.bootstrap import binomial_interval, bootstrapped_mean, percentile_interval
from swarmwire.metrics.statistics.sample import Interval, Sample
from swarmwire.metrics.statistics.survival import kaplan_meier
from swarmwire.metrics.text import number, sentence

MAX_CURVES = 6
_MAX_PARAMETERS = 2
_LEGEND_IN = 0.72
_MAX_CORNERS, _MAX_TICKS = 300, 60
_TIMES = (
    "Times. A run that ended before an event happened is right-censored at its end, or earlier by the time for which "
    "the event must hold to count, since a later beginning cannot be observed. Quartiles of times are "
    "those of Kaplan and Meier's estimate (Journal of the American Statistical Association 53, 1958), their "
    "intervals Brookmeyer and Crowley's (Biometrics 38, 1982) with the log-log band; where the estimate does "
    "not come down to a quartile, the quartile is beyond the limit (>). Ticks on curves are censored runs. "
    'Runs in the column "stopped first" were ended by a stop condition before the event. The estimate treats '
    "them as censored by chance. If the condition is related to the event, the estimate misleads: run again with "
    "`keep_running = true` in `[stop]`. Where runs stop early, values at the end and sums are of runs of different "
    "lengths."
)
_SHARES = (
    "Shares of runs. Intervals are Wilson's score intervals (Journal of the American Statistical Association 22, 1927)."
)


def share_curve(x: FloatArray, share: FloatArray, intervals: Sequence[Interval], title: str, x_label: str) -> Any:
    """Draw the share of runs (k,) in which an event happened, and its intervals, over x (k,)."""
    figure, axes = column_axes(title, x_label)
    low, high = np.array(intervals).T
    axes.vlines(x, low, high, color=CURVE, lw=1.0, zorder=3, clip_on=False)
    axes.plot(x, share, "o-", color=CURVE, lw=1.3, ms=3.6, zorder=4, clip_on=False)
    set_share_limits(axes, float(low.min()), 1.0)
    if fits_log(x):
        set_log(axes.xaxis)
    return figure


@dataclass(frozen=True)
class SurvivalCurve:
    """The Kaplan-Meier estimate of a group; the share is 1 before the first time."""

    label: str
    time_s: FloatArray  # (k,) times at which the share falls, ascending
    share: FloatArray  # (k,) share of runs without the event, from that time on
    censored_s: FloatArray  # (c,) ends of runs without the event
    end_s: float  # end of the longest run


def survival_curves(curves: Sequence[SurvivalCurve], title: str, x_label: str) -> Any:
    """Draw the curves as steps, with a tick at each censored run."""
    figure, axes = column_axes(title, x_label, right_in=_LEGEND_IN if len(curves) > 1 else 0.1)
    axes.grid(axis="x", color=GRID, linewidth=0.6)
    for curve, color in zip(curves, ordered_colors(len(curves)), strict=True):
        time_s, share = _steps(curve)
        axes.plot(time_s, share, drawstyle="steps-post", color=color, lw=1.3, label=curve.label, solid_capstyle="butt")
        ends_s = np.unique(curve.censored_s)
        ends_s = ends_s[:: -(-len(ends_s) // _MAX_TICKS) or 1]
        if len(ends_s):
            share_at_end = share[np.maximum(np.searchsorted(time_s, ends_s, side="right") - 1, 0)]
            mark: Look = {"ms": 5, "mew": 1.1, "ls": "", "clip_on": False, "zorder": 4}
            axes.plot(ends_s, share_at_end, "|", color=color, **mark)
    axes.set_ylim(0.0, 1.03)
    axes.set_xlim(0.0, None)
    if len(curves) > 1:
        plain_legend(axes, loc="upper left", bbox_to_anchor=(1.01, 1.03), handletextpad=0.5)
    return figure


def _steps(curve: SurvivalCurve) -> tuple[FloatArray, FloatArray]:
    """Return the corners from 0 to the end, at most _MAX_CORNERS."""
    time_s = np.concatenate(([0.0], curve.time_s, [max(curve.end_s, *curve.time_s, 0.0)]))
    share = np.concatenate(([1.0], curve.share, [curve.share[-1] if len(curve.share) else 1.0]))
    if len(time_s) <= _MAX_CORNERS:
        return time_s, share
    grid: FloatArray = np.linspace(0.0, float(time_s[-1]), _MAX_CORNERS)
    last = np.unique(np.searchsorted(time_s, grid, side="right") - 1)
    return time_s[last], share[last]


def _parts(data: CampaignData) -> list[Part]:
    samples, times = data.samples, data.times
    levels = list(map(samples.levels, samples.folder.parameters[:_MAX_PARAMETERS]))
    levels = [each for each in levels if len(each) > 1]
    numeric = [each for each in levels if each.number is not None]
    figures = [_share_figure(samples, response, each) for response in times for each in numeric]
    figures += [_survival_figure(samples, response, each) for response in times for each in levels or [None]]
    if not figures:
        return []
    text = (
        "Over a number: the share of runs in which the event happened before they ended, with 95 % intervals "
        "(Wilson's; over several design points by the bootstrap of seeds). Over time: the share of runs in which the "
        "event has not happened yet, by Kaplan and Meier's estimate; a curve falls with each run in which it happens, "
        "and a tick is a run that ended before."
    )
    return [text, *figures]


SURVIVAL = ReportSection("Survival", _parts, (_TIMES, _SHARES))


def _share_figure(samples: Samples, response: Response, levels: Levels) -> Figure:
    assert levels.number is not None
    name = figure_name("reached", response.column, levels.path)
    samples_by_level = [samples.sample(response, tuple(levels.points(level))) for level in range(len(levels))]
    share = np.array([1.0 - sample.censored for sample in samples_by_level])
    limit = samples.limit(response)
    within = "" if limit is None else f" within {number(limit)} {response.unit}"
    curve = share_curve(
        levels.number,
        share,
        [share_interval(sample) for sample in samples_by_level],
        f"share of runs that reach it{within}",
        levels.title,
    )
    caption = f"{sentence(response_title(response))}: share of runs that reach it{within}, over `{levels.path}`."
    return drawn_figure(name, curve, caption)


def share_interval(sample: Sample) -> Interval:
    """Return the interval of the share of observed events: Wilson's, or by the bootstrap of seeds if seeds repeat."""
    if sample.seeds == len(sample):
        low, high = binomial_interval(np.array([sample.observed.sum()]), np.array([len(sample)]))
        return Interval(float(low[0]), float(high[0]))
    return percentile_interval(
        bootstrapped_mean(sample.observed.astype(np.float64), sample.seed).resampled, sample.seeds
    )


def _survival_figure(samples: Samples, response: Response, levels: Levels | None) -> Figure:
    title = response_title(response)
    if levels is None:
        name = figure_name("survival", response.column)
        points = tuple(range(len(samples.folder.points)))
        curves = [_curve(samples, response, "all runs", points)]
        return drawn_figure(name, survival_curves(curves, "share of runs yet to reach it", title), f"{title}.")
    name = figure_name("survival", response.column, levels.path)
    last_level, curve_count = len(levels) - 1, min(MAX_CURVES, len(levels))
    shown = [round(last_level * index / (curve_count - 1)) for index in range(curve_count)]
    curves = [_curve(samples, response, levels.short[level], tuple(levels.points(level))) for level in shown]
    figure = survival_curves(curves, f"share of runs yet to reach it, by {levels.title}", title)
    subset = f",  {len(shown)} of its {len(levels)} values" if len(shown) < len(levels) else ""
    pooled = ", over all values of the others" if len(samples.folder.parameters) > 1 else ""
    return drawn_figure(name, figure, f"{sentence(title)} by `{levels.path}`{subset}{pooled}.")


def _curve(samples: Samples, response: Response, label: str, points: tuple[int, ...]) -> SurvivalCurve:
    sample = samples.sample(response, points)
    estimate = kaplan_meier(sample)
    cut_off = sample.value[~sample.observed]
    end_s = float(sample.value.max()) if len(sample) else 0.0
    return SurvivalCurve(label, estimate.time, estimate.survival, cut_off, end_s)
