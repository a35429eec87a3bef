"""Panels side by side, and means with their intervals."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.metrics.pictures.drawing.canvas import SMALL_PT, SOFT, TEXT_PT, Look, plain_axes
from swarmwire.metrics.pictures.report.page import blank_figure
from swarmwire.metrics.statistics.bootstrap import bootstrapped_mean
from swarmwire.metrics.statistics.sample import Interval

PANEL_IN, HEIGHT_IN = 2.9, 2.35
_LEFT_IN, _RIGHT_IN, _FOOT_IN, _HEAD_IN = 0.42, 0.12, 0.42, 0.26


def panels(*titles: tuple[str, str]) -> tuple[Any, list[Any]]:
    """A figure with axes side by side, for each a title and what its x axis shows."""
    figure = blank_figure(PANEL_IN * len(titles), HEIGHT_IN)
    wide, high = PANEL_IN - _LEFT_IN - _RIGHT_IN, HEIGHT_IN - _FOOT_IN - _HEAD_IN
    panel_axes: list[Any] = []
    for column, (title, x_label) in enumerate(titles):
        left = (column * PANEL_IN + _LEFT_IN) / (PANEL_IN * len(titles))
        axes = plain_axes(figure, (left, _FOOT_IN / HEIGHT_IN, wide / PANEL_IN / len(titles), high / HEIGHT_IN), title)
        axes.set_xlabel(x_label, fontsize=TEXT_PT, color=SOFT, labelpad=3)
        panel_axes.append(axes)
    return figure, panel_axes


def mean_and_interval(value: FloatArray) -> tuple[float, Interval]:
    """The mean of runs (n,) and its bootstrap interval."""
    return float(value.mean()), bootstrapped_mean(value).interval()


def means(axes: Any, x: Sequence[float], values: Sequence[FloatArray], **look: Any) -> None:
    """Means over runs as points, their intervals as lines."""
    estimates = [mean_and_interval(value) for value in values]
    low, high = (np.array([interval[end] for _, interval in estimates]) for end in (0, 1))
    axes.vlines(x, low, high, color=look["color"], lw=1.0, zorder=3)
    options: Look = {"ms": 3, "lw": 1.2, "zorder": 4, **look}
    axes.plot(x, [mean for mean, _ in estimates], "o-" if "ls" not in options else "o", **options)


def legend(axes: Any, **where: Any) -> None:
    """A legend without a frame."""
    axes.legend(fontsize=SMALL_PT, frameon=False, handlelength=1.8, borderaxespad=0.2, **where)


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A Markdown table."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def within(mean: float, interval: Interval, digits: int) -> str:
    """A mean with its interval, as text."""
    return f"{mean:.{digits}f} ({interval.low:.{digits}f} to {interval.high:.{digits}f})"
