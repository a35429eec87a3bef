"""Metrics over time in panels on top of one another, with what happened in lanes above them."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from swarmwire.comms.arrays import FloatArray
from swarmwire.metrics.drawing.looks import ACCENT, CURVE, SMALL_PT, SOFT
from swarmwire.metrics.drawing.metric_axes import UNKNOWN, Facts, is_count, limits
from swarmwire.metrics.drawing.plain_axes import plain_axes
from swarmwire.metrics.report.in_words import short
from swarmwire.metrics.report.lanes import Lane
from swarmwire.metrics.report.run_figures.event_lanes import LANE_IN, draw_lanes
from swarmwire.metrics.report.svg import COLUMN_IN, blank_figure
from swarmwire.metrics.report.thinned import thinned

_PANEL_IN, _TITLE_IN = 0.72, 0.24
_LEFT_IN, _RIGHT_IN, _FOOT_IN, _TOP_IN = 0.36, 0.1, 0.34, 0.04
_MAX_SHADED = 6  # spans that are shaded through all panels; of more there are lines, of many more nothing
_MAX_LINES = 24


@dataclass(frozen=True)
class Curve:
    """A metric of one arena over time."""

    name: str  # as metrics have it
    title: str
    value: FloatArray  # (T,) NaN: undefined
    whole: bool = False  # a number of things: it jumps, and stays in between
    facts: Facts = field(default_factory=lambda: UNKNOWN)  # in which its bounds and kind stand


def timeline(time_s: FloatArray, curves: Sequence[Curve], lanes: Sequence[Lane]) -> Any:
    """The figure: curves over `time_s` (T,), and lanes above them."""
    lanes_in = LANE_IN * len(lanes)
    height_in = _TOP_IN + lanes_in + len(curves) * (_TITLE_IN + _PANEL_IN) + _FOOT_IN
    figure = blank_figure(COLUMN_IN, height_in)
    ends_s = float(time_s[0]), max(float(time_s[-1]), float(time_s[0]) + 1e-9)

    def place(above_in: float, high_in: float) -> tuple[float, float, float, float]:
        low = 1.0 - (above_in + high_in) / height_in
        return _LEFT_IN / COLUMN_IN, low, 1.0 - (_LEFT_IN + _RIGHT_IN) / COLUMN_IN, high_in / height_in

    if lanes:
        draw_lanes(figure.add_axes(place(_TOP_IN, lanes_in)), lanes, ends_s)
    for row, curve in enumerate(curves):
        above_in = _TOP_IN + lanes_in + row * (_TITLE_IN + _PANEL_IN) + _TITLE_IN
        axes = plain_axes(figure, place(above_in, _PANEL_IN), curve.title)
        draw_curve(axes, time_s, curve)
        axes.set_xlim(*ends_s)
        _mark(axes, lanes, ends_s[1])
        if row < len(curves) - 1:
            axes.tick_params(labelbottom=False)
        else:
            axes.set_xlabel("time in s", fontsize=SMALL_PT, color=SOFT, labelpad=2)
    return figure


def draw_curve(axes: Any, time_s: FloatArray, curve: Curve) -> None:
    """The curve on axes of its own, which have no limits across yet."""
    kept, whole = thinned(curve.value), curve.whole or is_count(curve.name, curve.facts)
    steps = "steps-post" if whole else "default"
    axes.plot(time_s[kept], curve.value[kept], color=CURVE, lw=1.0, drawstyle=steps)
    axes.set_ylim(*limits(curve.name, curve.value, curve.facts))
    axes.locator_params(axis="y", nbins=3, integer=whole)
    axes.yaxis.set_major_formatter(short)


def _mark(axes: Any, lanes: Sequence[Lane], end_s: float) -> None:
    """What happened, through a panel, where it does not hide it."""
    spans = [span for lane in lanes for span in lane.spans]
    if len(spans) > _MAX_LINES:
        return
    for span in spans:
        axes.axvline(span.from_s, color=ACCENT, lw=0.6, alpha=0.6, zorder=0.5)
        if span.until_s is not None and len(spans) <= _MAX_SHADED:
            axes.axvspan(span.from_s, min(span.until_s, end_s), color=ACCENT, alpha=0.08, lw=0, zorder=0.4)
