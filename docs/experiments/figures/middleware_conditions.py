"""Middleware on a moving mesh under other conditions: one figure and one table over loss and number of robots."""

# pyright: basic, reportUnknownMemberType=false

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np
import polars as pl

from docs.experiments.figures._side_by_side import table as markdown
from docs.experiments.figures.middleware import LOSS, MEDIANS, NAME, Median, counts, digested, measured, successes
from examples.middleware.node import TRANSPORTS
from swarmwire.metrics.pictures.drawing.canvas import SMALL_PT, SOFT, plain_axes
from swarmwire.metrics.pictures.report.page import blank_figure

__all__ = ["CAMPAIGNS", "COLUMNS", "PAGE", "digested", "draw", "numbers"]

PAGE = "middleware"
CAMPAIGNS = (
    *("middleware", "middleware-loss", "middleware-4", "middleware-12"),
    *("middleware-rate", "middleware-standing", "middleware-convoy"),
)
COLUMNS = ()  # `digested` chooses


class Condition(NamedTuple):
    """Runs of a campaign that differ from the first condition by one thing."""

    axis: str
    value: str
    campaign: str
    loss: float | None = None  # of those of the campaign; None: it has one


CONDITIONS = (
    Condition("loss", "0", "middleware", 0.0),
    Condition("loss", "0.2", "middleware", 0.2),
    Condition("loss", "0.4", "middleware-loss"),
    Condition("robots", "4", "middleware-4"),
    Condition("robots", "8", "middleware", 0.0),
    Condition("robots", "12", "middleware-12"),
    Condition("bit rate", "fixed", "middleware", 0.0),
    Condition("bit rate", "adaptive", "middleware-rate"),
    Condition("motion", "none", "middleware-standing"),
    Condition("motion", "walk", "middleware", 0.0),
    Condition("motion", "convoy", "middleware-convoy"),
)
PANELS = (  # column, topic, title, and limits; without them the axis is logarithmic
    ("delivery_before", "state", "states delivered, no split", (-0.03, 1.03)),
    ("age_mean_s", "state", "mean age of states, s, no split", None),
    ("discovery_p50_s", "state", "discovery, median pair, s", (-0.3, 6.5)),
    ("recovery_p50_s", "state", "recovery after the split, median pair, s", (-0.5, 20.5)),
    ("kB_per_s", "state", "frames of all robots, kB/s, with each hop", (0.0, None)),
)
COLORS = ("#222222", "#2f6fae", "#7fb2e5", "#c2502e", "#e59a7f", "#8c1c13", "#4f8a3c")  # by middleware
STEP = 0.11  # between middlewares at a condition, whose distance is 1
GAP = 0.5  # between axes, besides
MEASURES = {
    "states": ("state", "delivery_before", ".2f"),
    "maps": ("map", "delivery_before", ".2f"),
    "commands": ("command", "delivery_before", ".2f"),
    "latency p95, ms": ("state", "latency_p95_ms", ".0f"),
    "age, s": ("state", "age_mean_s", ".2f"),
    "discovery p50, s": ("state", "discovery_p50_s", ".1f"),
    "states within a half": ("state", "delivery_within", ".2f"),
    "recovery p50, s": ("state", "recovery_p50_s", ".1f"),
    "commands across": ("command", "delivery_across", ".2f"),
    "kB/s": ("state", "kB_per_s", ".0f"),
    "airtime": ("state", "airtime", ".3f"),
}


def draw(runs: Mapping[str, pl.DataFrame]) -> Any:
    """Draw a panel per measure: medians with their intervals, by middleware and condition."""
    figure, positions = blank_figure(7.2, 8.2), list(_positions())
    for row, (column, topic, title, limits) in enumerate(PANELS):
        axes = plain_axes(figure, (0.07, 0.79 - 0.187 * row, 0.91, 0.135), title)
        axes.grid(visible=False, axis="x")
        last = limits[1] if limits else None
        for x, condition in positions:
            table = _rows(runs, condition)
            for index, name in enumerate(TRANSPORTS):
                values = measured(table.filter(pl.col(NAME) == name), topic, column)
                _draw_median(axes, x + STEP * (index - 3), Median.from_values(values), COLORS[index], last)
        axes.set_xticks([x for x, _ in positions], [condition.value for _, condition in positions], fontsize=SMALL_PT)
        if limits is not None:
            axes.set_ylim(*limits)
        else:
            axes.set_yscale("log")
            axes.yaxis.set_major_formatter("{x:g}")
            axes.yaxis.set_minor_formatter("")
    for axis in dict.fromkeys(condition.axis for condition in CONDITIONS):
        middle = np.mean([x for x, condition in positions if condition.axis == axis])
        axes.annotate(
            axis, (middle, 0), (0, -20), xycoords=("data", "axes fraction"), textcoords="offset points",
            ha="center", va="top", fontsize=SMALL_PT, color=SOFT,
        )  # fmt: skip
    for index, name in enumerate(TRANSPORTS):
        figure.text(0.07 + 0.13 * index, 0.985, f"● {name}", color=COLORS[index], fontsize=SMALL_PT, va="top")
    return figure


def _positions() -> Iterator[tuple[float, Condition]]:
    """Yield the place of each condition on the axis x, with gaps between axes."""
    x, last = 0.0, CONDITIONS[0].axis
    for condition in CONDITIONS:
        x += GAP if condition.axis != last else 0.0
        yield x, condition
        x, last = x + 1.0, condition.axis


def _draw_median(axes: Any, x: float, median: Median, color: str, last: float | None) -> None:
    """Draw a median and its interval; a hollow dot at the limit if half of the runs have no value."""
    if np.isfinite(median.low):
        axes.plot([x, x], [median.low, median.high if np.isfinite(median.high) else last], color=color, lw=0.9)
    if np.isfinite(median.value):
        axes.plot([x], [median.value], "o", ms=3.2, color=color, mew=0)
    elif last is not None:
        axes.plot([x], [last], "o", ms=3.2, mfc="none", mec=color, mew=0.7, clip_on=False)


def _rows(runs: Mapping[str, pl.DataFrame], condition: Condition) -> pl.DataFrame:
    table = runs[condition.campaign]
    return table if condition.loss is None else table.filter(pl.col(LOSS) == condition.loss)


def numbers(runs: Mapping[str, pl.DataFrame]) -> str:
    """Return a table of all medians over seeds, by condition and middleware."""
    new = [runs[name].with_columns(campaign=pl.lit(name)) for name in CAMPAIGNS[1:]]
    conditions: dict[tuple[str, float | None], Condition] = {}
    for condition in CONDITIONS:
        conditions.setdefault((condition.campaign, condition.loss), condition)
    rows: list[list[str]] = []
    for condition in conditions.values():
        table = _rows(runs, condition)
        for name in TRANSPORTS:
            point = table.filter(pl.col(NAME) == name)
            cells = [
                Median.from_values(measured(point, topic, column)).text(form)
                for topic, column, form in MEASURES.values()
            ]
            rows.append([f"{condition.axis} {condition.value}", name, str(len(successes(point))), *cells])
    return (
        f"{counts(pl.concat(new, how='diagonal_relaxed'), ('campaign', NAME))}\n\nAll conditions; {MEDIANS}:\n\n"
        f"{markdown(['condition', 'middleware', 'seeds', *MEASURES], rows)}"
    )
