"""The section of events: metrics and events over time, and the paths of the robots."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.metrics.measures.registry import LINK_PDR, METRICS
from swarmwire.metrics.pictures.drawing.canvas import ACCENT, CURVE, GRID, INK, SMALL_PT, SOFT, plain_axes
from swarmwire.metrics.pictures.drawing.film import Film
from swarmwire.metrics.pictures.drawing.metrics_strip import UNKNOWN, Facts, info_of, is_count, limits, titled
from swarmwire.metrics.pictures.report.page import (
    COLUMN_IN,
    Part,
    ReportSection,
    ReportTable,
    blank_figure,
    drawn_figure,
)
from swarmwire.metrics.pictures.report.run_data import ARENA, Lane, RunData, Span, event_kind, thinned
from swarmwire.metrics.pictures.report.run_paths import path_figure
from swarmwire.metrics.text import number, short

LANE_IN = 0.29  # height of a lane
_BAR = (0.12, 0.3)  # lower and upper edge of a bar, as shares of a lane
_PANEL_IN, _TITLE_IN = 0.72, 0.24
_LEFT_IN, _RIGHT_IN, _FOOT_IN, _TOP_IN = 0.36, 0.1, 0.34, 0.04
_MAX_SHADED = 6  # at most this many spans are shaded through all panels
_MAX_LINES = 24  # at most this many starts of spans are lines through all panels
MAX_PANELS = 24
_COLUMNS = 2
_SMALL_TITLE_IN, _SMALL_PANEL_IN, _TICKS_IN, _SMALL_FOOT_IN = 0.26, 0.5, 0.2, 0.14
_SMALL_LEFT_IN, _GAP_IN, _SMALL_RIGHT_IN = 0.38, 0.42, 0.08
MAIN = ("order", "components", LINK_PDR)  # metrics of the timeline, if they have a value
SECONDARY = (  # metrics with small panels, if their values change
    "target_best",
    "target_mean",
    "largest_component",
    "age_of_information",
    "throughput",
    "collisions",
    "wall_contacts",
    "min_gap",
)
_INTEGERS = ("components",)
_MAX_LANES = 8
_MAX_EVENTS = 200
_TITLES = {LINK_PDR: "link_pdr: received / in range"}


def draw_lanes(axes: Any, lanes: Sequence[Lane], ends_s: tuple[float, float]) -> None:
    """Draw lanes on axes, the first on top, between the ends in s."""
    axes.set_axis_off()
    axes.set(xlim=ends_s, ylim=(0.0, len(lanes)))
    low, high = _BAR
    for row, lane in enumerate(lanes):
        bottom = len(lanes) - 1 - row
        title = lane.title.replace("_", " ")
        axes.text(ends_s[0], bottom + 0.44, title, fontsize=SMALL_PT, color=INK, va="bottom")
        axes.hlines(bottom + 0.5 * (low + high), *ends_s, color=GRID, lw=0.8, zorder=1)
        bars = [(span.from_s, min(span.until_s, ends_s[1]) - span.from_s) for span in lane.spans if span.until_s]
        axes.broken_barh(bars, (bottom + low, high - low), facecolors=ACCENT, alpha=0.55, linewidth=0, zorder=2)
        marks = [span.from_s for span in lane.spans if span.until_s is None]
        axes.plot(marks, [bottom + 0.5 * (low + high)] * len(marks), marker="D", ms=3.0, mew=0, ls="none", color=ACCENT)


@dataclass(frozen=True)
class Curve:
    """A metric of one arena over time."""

    name: str  # name of the metric
    title: str
    value: FloatArray  # (T,) NaN: undefined
    is_integer: bool = False  # drawn as steps
    facts: Facts = field(default_factory=lambda: UNKNOWN)  # bounds and kinds of metrics


def timeline(time_s: FloatArray, curves: Sequence[Curve], lanes: Sequence[Lane]) -> Any:
    """Draw curves over `time_s` (T,), and lanes above them."""
    lanes_in = LANE_IN * len(lanes)
    height_in = _TOP_IN + lanes_in + len(curves) * (_TITLE_IN + _PANEL_IN) + _FOOT_IN
    figure = blank_figure(COLUMN_IN, height_in)
    ends_s = float(time_s[0]), max(float(time_s[-1]), float(time_s[0]) + 1e-9)

    def box(top_in: float, panel_in: float) -> tuple[float, float, float, float]:
        bottom = 1.0 - (top_in + panel_in) / height_in
        return _LEFT_IN / COLUMN_IN, bottom, 1.0 - (_LEFT_IN + _RIGHT_IN) / COLUMN_IN, panel_in / height_in

    if lanes:
        draw_lanes(figure.add_axes(box(_TOP_IN, lanes_in)), lanes, ends_s)
    for row, curve in enumerate(curves):
        top_in = _TOP_IN + lanes_in + row * (_TITLE_IN + _PANEL_IN) + _TITLE_IN
        axes = plain_axes(figure, box(top_in, _PANEL_IN), curve.title)
        draw_curve(axes, time_s, curve)
        axes.set_xlim(*ends_s)
        _mark(axes, lanes, ends_s[1])
        if row < len(curves) - 1:
            axes.tick_params(labelbottom=False)
        else:
            axes.set_xlabel("time in s", fontsize=SMALL_PT, color=SOFT, labelpad=2)
    return figure


def draw_curve(axes: Any, time_s: FloatArray, curve: Curve) -> None:
    """Draw the curve on empty axes."""
    ticks, is_integer = thinned(curve.value), curve.is_integer or is_count(curve.name, curve.facts)
    style = "steps-post" if is_integer else "default"
    axes.plot(time_s[ticks], curve.value[ticks], color=CURVE, lw=1.0, drawstyle=style)
    axes.set_ylim(*limits(curve.name, curve.value, curve.facts))
    axes.locator_params(axis="y", nbins=3, integer=is_integer)
    axes.yaxis.set_major_formatter(short)


def _mark(axes: Any, lanes: Sequence[Lane], end_s: float) -> None:
    """Mark at most _MAX_LINES events through a panel."""
    spans = [span for lane in lanes for span in lane.spans]
    if len(spans) > _MAX_LINES:
        return
    for span in spans:
        axes.axvline(span.from_s, color=ACCENT, lw=0.6, alpha=0.6, zorder=0.5)
        if span.until_s is not None and len(spans) <= _MAX_SHADED:
            axes.axvspan(span.from_s, min(span.until_s, end_s), color=ACCENT, alpha=0.08, lw=0, zorder=0.4)


def small_panels(time_s: FloatArray, curves: Sequence[Curve]) -> Any:
    """Draw the first MAX_PANELS curves over `time_s` (T,)."""
    shown = list(curves)[:MAX_PANELS]
    rows = -(-len(shown) // _COLUMNS)
    row_in = _SMALL_TITLE_IN + _SMALL_PANEL_IN + _TICKS_IN
    height_in = rows * row_in + _SMALL_FOOT_IN
    figure = blank_figure(COLUMN_IN, height_in)
    panel_in = (COLUMN_IN - _SMALL_LEFT_IN - _SMALL_RIGHT_IN - (_COLUMNS - 1) * _GAP_IN) / _COLUMNS
    ends_s = float(time_s[0]), max(float(time_s[-1]), float(time_s[0]) + 1e-9)
    for index, curve in enumerate(shown):
        row, column = divmod(index, _COLUMNS)
        left_in = _SMALL_LEFT_IN + column * (panel_in + _GAP_IN)
        bottom_in = height_in - row * row_in - _SMALL_TITLE_IN - _SMALL_PANEL_IN
        box = left_in / COLUMN_IN, bottom_in / height_in, panel_in / COLUMN_IN, _SMALL_PANEL_IN / height_in
        axes = plain_axes(figure, box, curve.title)
        draw_curve(axes, time_s, curve)
        axes.set_xlim(*ends_s)
        axes.locator_params(axis="x", nbins=4)
        if index + _COLUMNS >= len(shown):
            axes.set_xlabel("time in s", fontsize=SMALL_PT, color=SOFT, labelpad=1)
    return figure


def _parts(run: RunData) -> list[Part]:
    """Return timeline, paths of the robots, small panels of the scenario's metrics, and events."""
    if isinstance(run.film, str):
        return [f"No tick can be shown: {run.film}"]
    film = run.film
    parts: list[Part] = []
    main = curves(film, MAIN)
    if main:
        lanes = [*_moments(run, film), *run.lanes]
        figure = timeline(film.time_s, main, lanes[:_MAX_LANES])
        parts.append(drawn_figure("timeline", figure, _caption(main, lanes)))
    parts.append(path_figure(film, run.static))
    others = curves(film, secondary_metrics(film))
    if others:
        figure = small_panels(film.time_s, others)
        limit = f"; of {len(others)} the first {MAX_PANELS}" if len(others) > MAX_PANELS else ""
        parts.append(drawn_figure("metrics", figure, f"The other metrics over time{limit}."))
    return [*parts, *_events(run)]


EVENTS = ReportSection("Events", _parts)


def secondary_metrics(film: Film) -> list[str]:
    """Return the metrics with small panels: the scenario's metrics except times, then standard ones that change."""
    listed = [name for name in film.metrics if name not in METRICS or not METRICS[name].standard]
    listed = [name for name in listed if not _is_time(name, film.facts)]
    changing = [name for name in SECONDARY if name in film.metrics and np.unique(film.metrics[name]).size > 1]
    return [name for name in (*listed, *changing) if name not in MAIN]


def curves(film: Film, names: tuple[str, ...] | list[str]) -> list[Curve]:
    """Return the curves of these metrics, without those that are always undefined."""
    return [
        Curve(name, _TITLES.get(name, titled(name, film.facts)), film.metrics[name], name in _INTEGERS, film.facts)
        for name in names
        if name in film.metrics and np.isfinite(film.metrics[name]).any()
    ]


def _is_time(name: str, facts: Facts) -> bool:
    return info_of(name, facts).kind == "time"


def _moments(run: RunData, film: Film) -> list[Lane]:
    """Return lanes for the time of the stop condition and the values of metrics that are times."""
    end: dict[str, Any] = run.summary["by_arena"][ARENA] if run.summary else {"stopped_by": None}
    moments: dict[str, float] = {}
    if end["stopped_by"]:
        moments[f"stop: {end['stopped_by']}, since"] = float(end["stop_time_s"])
    for name, value in film.metrics.items():
        if _is_time(name, film.facts) and np.isfinite(value[-1]):
            moments[f"{name.removesuffix('_s')}:"] = float(value[-1])
    return [Lane(f"{text} {number(time_s)} s", [Span(time_s, None)]) for text, time_s in moments.items()]


def _caption(main: list[Curve], lanes: list[Lane]) -> str:
    names = ", ".join(curve.name.replace("_", " ") for curve in main)
    text = f"{names[0].upper()}{names[1:]} over time"
    if not lanes:
        return f"{text}; no events."
    limit = f" Of {len(lanes)} kinds of events the first {_MAX_LANES} are drawn." if len(lanes) > _MAX_LANES else ""
    return f"{text}, and above it the events: a bar until the end, a diamond where no end is recorded.{limit}"


def _events(run: RunData) -> list[Part]:
    if run.events is None:
        return ["Events were not recorded, or cannot be read; see `swarmwire verify`."]
    if not len(run.events):
        return []
    rows = tuple(
        (
            number(row["time_s"]),
            event_kind(row).replace("_", " ") + (" ended" if row["ended"] else ""),
            _names(row["robots"]),
        )
        for row in run.events.head(_MAX_EVENTS).iter_rows(named=True)
    )
    caption = f"The first {_MAX_EVENTS} of {len(run.events)} events" if len(run.events) > _MAX_EVENTS else "All events"
    return [ReportTable(("time in s", "event", "robots that it changed"), rows, f"{caption}.", folded=True)]


def _names(robots: list[str]) -> str:
    return ", ".join(robots[:8]) + (f" and {len(robots) - 8} more" if len(robots) > 8 else "") if robots else "–"
