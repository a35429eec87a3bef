"""Panels of the particle swarms' figures."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import polars as pl

from docs.experiments.figures._pso_samples import EVERY_S, HALF, at, mean_distances, times, values
from swarmwire.metrics.drawing.canvas import INK, SMALL_PT, SOFT, TEXT_PT, Look, plain_axes
from swarmwire.metrics.report.axes import ordered_colors
from swarmwire.metrics.report.page import blank_figure
from swarmwire.metrics.statistics.sample import Sample
from swarmwire.metrics.statistics.summary import summary

LIMIT_S = 300.0


@dataclass(frozen=True)
class Kind:
    """Who searched: what their campaigns' names end with, what they are called, and their colour."""

    suffix: str
    who: str
    color: str

    @property
    def look(self) -> Look:
        """Of their curves."""
        return {"color": self.color, "marker": "o", "ms": 3, "lw": 1.3, "zorder": 4, "label": self.who}


def panels(titles: Sequence[tuple[str, str]]) -> tuple[Any, list[Any]]:
    """A figure of two rows of three axes at most, each with what stands above it and below."""
    figure = blank_figure(7.2, 4.6 if len(titles) > 3 else 2.3)
    rows = -(-len(titles) // 3)
    found: list[Any] = []
    for k, (title, below) in enumerate(titles):
        low, height = (0.6 - 0.5 * (k // 3), 0.32) if rows > 1 else (0.2, 0.64)
        axes = plain_axes(figure, (0.05 + 0.325 * (k % 3), low, 0.265, height), title)
        axes.set_xlabel(below, fontsize=TEXT_PT, color=SOFT)
        found.append(axes)
    return figure, found


def times_by(runs: pl.DataFrame, column: str) -> tuple[list[float], list[Sample]]:
    """The values of a column, and the times to half at each."""
    told = values(runs, column)
    return told, [times(runs.filter(pl.col(column) == value), HALF) for value in told]


def time_curve(axes: Any, x: Sequence[float], samples: Sequence[Sample], look: Look) -> None:
    """Median times with their intervals; what lies beyond the limit is a triangle at it."""
    of = [summary(sample) for sample in samples]
    median = np.array([one.q50 for one in of])
    ends = [np.array([getattr(one.q50_interval, end) for one in of]) for end in ("low", "high")]
    low, high = (np.where(np.isfinite(end), end, LIMIT_S) for end in ends)
    axes.vlines(x, low, high, color=look["color"], lw=0.9, zorder=3)
    axes.plot(x, median, **look)
    beyond = np.isnan(median)
    mark: Look = {"ls": "", "marker": "^", "ms": 4, "mfc": "white", "mec": look["color"], "zorder": 5, "clip_on": False}
    axes.plot(np.array(x)[beyond], np.full(int(beyond.sum()), LIMIT_S), **mark)


def share_curve(axes: Any, x: Sequence[float], samples: Sequence[Sample], look: Look) -> None:
    """Share of the runs that came to it within the limit."""
    axes.plot(x, [1.0 - sample.censored for sample in samples], **look)


def distance_curves(axes: Any, runs: pl.DataFrame, ranges: Sequence[float], look: Look) -> None:
    """Mean distance to the light over time, a curve for each radio range, named at its end if it is solid."""
    for range_m, color in zip(ranges, ordered_colors(len(ranges)), strict=True):
        distance_m = mean_distances(at(runs, radio__range_m=range_m))
        axes.plot(EVERY_S * np.arange(len(distance_m)), distance_m, color=color, **look)
        if look["ls"] == "-":
            where: Look = {"fontsize": SMALL_PT, "color": color, "va": "center"}
            axes.text(EVERY_S * len(distance_m), distance_m[-1], f"{range_m:g} m", **where)


def ladder(axes: Any, steps: Sequence[tuple[str, pl.DataFrame, Any]]) -> None:
    """Mean time to half, up to the limit, with its interval, for each step; the first at the top."""
    for place, (_, runs, color) in enumerate(steps):
        of = summary(times(runs, HALF))
        axes.plot([of.mean_interval.low, of.mean_interval.high], [-place] * 2, color=color, lw=1.4)
        axes.plot(of.mean, -place, "o", ms=4, color=color)
    axes.set_yticks([-place for place in range(len(steps))], [label for label, _, _ in steps])
    axes.tick_params(axis="y", length=0, labelsize=SMALL_PT, labelcolor=INK)
    axes.set_ylim(-len(steps) + 0.4, 0.8)
    axes.grid(axis="x", color=SOFT, lw=0.3, alpha=0.5)
