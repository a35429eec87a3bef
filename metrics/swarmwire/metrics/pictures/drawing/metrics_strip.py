"""Metrics next to an arena: the axes of a metric, and small plots whose past is strong and whose future is faint."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.config import did_you_mean
from swarmwire.comms.base.errors import BadInput
from swarmwire.metrics.measures.metric import MetricInfo, metric_info
from swarmwire.metrics.measures.registry import LINK_PDR, METRICS
from swarmwire.metrics.pictures.drawing.canvas import (
    CURVE,
    FAINT,
    INK,
    SMALL_PT,
    SOFT,
    TEXT_PT,
    FigureLayout,
    Look,
    plain_axes,
)
from swarmwire.metrics.pictures.drawing.film import Film

Facts = Mapping[str, MetricInfo]
UNKNOWN: Facts = {}
MAX_PLOTS = 4
PREFERRED = ("target_best", "target_mean", "order", "largest_component", LINK_PDR, "min_gap", "collisions")
USUAL_PLOTS = 3
_MAX_POINTS = 1500  # points of a curve, more than a plot has pixels
_HEAD_IN, _FOOT_IN, _NUMBERS_IN, _GAP_IN = 0.2, 0.18, 0.3, 0.16


def info_of(name: str, facts: Facts) -> MetricInfo:
    """Return unit, kind and bounds of a metric from the run or the registry; for an unknown metric its name alone."""
    if name in facts:
        return facts[name]
    if name in METRICS:
        return metric_info(METRICS[name])
    return MetricInfo(name, "", "", "level", (None, None))


def is_count(name: str, facts: Facts = UNKNOWN) -> bool:
    """Return True if the metric adds up over the run."""
    return info_of(name, facts).kind == "count"


def limits(name: str, value: FloatArray, facts: Facts = UNKNOWN) -> tuple[float, float]:
    """Return the limits of an axis with a margin: 0 to 1 for shares, else from 0 or the least value to the greatest."""
    if info_of(name, facts).bounds == (0.0, 1.0):
        return -0.03, 1.05
    finite = value[np.isfinite(value)]
    low, high = (float(finite.min()), float(finite.max())) if len(finite) else (0.0, 1.0)
    low = min(low, 0.0)
    span = max(high - low, 1.0 if is_count(name, facts) or low == high else 1e-6)
    return low - 0.03 * span, high + 0.08 * span


def titled(name: str, facts: Facts = UNKNOWN) -> str:
    """Return the name in words, with its unit if it has one."""
    unit = info_of(name, facts).unit
    words = name.replace("_", " ")
    return f"{words} ({unit})" if unit else words


def choose(metrics: Mapping[str, FloatArray], facts: Facts, selected: Sequence[str] | None) -> list[str]:
    """Return the metrics to plot: the selected ones, or the first ones with a value, the scenario's before others.

    BadInput for a metric that was not recorded, or for too many.
    """
    if selected is None:
        listed = [name for name in facts if not (name in METRICS and METRICS[name].standard)]
        names = dict.fromkeys([*listed, *PREFERRED])
        return [name for name in names if name in metrics and np.isfinite(metrics[name]).any()][:USUAL_PLOTS]
    for name in selected:
        if name not in metrics:
            raise BadInput("--metric", name, f"was not recorded; expected {did_you_mean(metrics, name)}")
    if len(selected) > MAX_PLOTS:
        raise BadInput("--metric", "", f"expected {MAX_PLOTS} at most, got {len(selected)}")
    return list(selected)


class MetricStrip:
    """Plots in the panel of a layout: stacked right of the arena, or side by side below it."""

    def __init__(self, figure: Any, layout: FigureLayout, film: Film, names: Sequence[str]) -> None:
        """Draw the fixed parts."""
        self._plots = [
            _Plot(plain_axes(figure, box, titled(name, film.facts)), name, film, has_time)
            for name, (box, has_time) in zip(names, _boxes(layout, len(names)), strict=True)
        ]

    @property
    def artists(self) -> tuple[Any, ...]:
        """Moving artists."""
        return tuple(artist for plot in self._plots for artist in plot.artists)

    def show(self, index: int) -> None:
        """Show this tick of the film."""
        for plot in self._plots:
            plot.show(index)


class _Plot:
    def __init__(self, axes: Any, name: str, film: Film, has_time: bool) -> None:
        time_s, value, facts = film.time_s, film.metrics[name], film.facts
        self._step = step = max(1, len(film.time_s) // _MAX_POINTS)
        self._time_s, self._value = time_s, value
        self._is_integer = is_count(name, facts)
        axes.set_xlim(float(time_s[0]), max(float(time_s[-1]), float(time_s[0]) + 1e-9))
        axes.set_ylim(*limits(name, value, facts))
        axes.locator_params(axis="y", nbins=3, integer=self._is_integer)
        axes.locator_params(axis="x", nbins=4, integer=True)
        if has_time:
            axes.set_xlabel("time in s", fontsize=SMALL_PT, color=SOFT, labelpad=1)
        else:
            axes.tick_params(labelbottom=False)
        axes.plot(time_s[::step], value[::step], color=FAINT, lw=1.0, zorder=2)
        [self._past] = axes.plot([], [], color=CURVE, lw=1.4, zorder=3)
        [self._cursor] = axes.plot([], [], color=SOFT, lw=0.7, alpha=0.7, zorder=2.5)
        look: Look = {"markersize": 4.5, "markeredgecolor": "white", "markeredgewidth": 0.8, "clip_on": False}
        [self._dot] = axes.plot([], [], "o", color=CURVE, zorder=4, **look)
        corner: Look = {"xy": (1.0, 1.0), "xycoords": "axes fraction", "xytext": (0, 4), "textcoords": "offset points"}
        bold: Look = {"fontsize": TEXT_PT, "fontweight": "bold", "color": INK, "ha": "right", "va": "baseline"}
        self._number = axes.annotate("", **corner, **bold)
        self._low, self._high = axes.get_ylim()

    @property
    def artists(self) -> tuple[Any, ...]:
        return self._cursor, self._past, self._dot, self._number

    def show(self, index: int) -> None:
        now_s, value = self._time_s[index], self._value[index]
        past = slice(0, index + 1, self._step)
        self._past.set_data(
            np.append(self._time_s[past], now_s),
            np.append(self._value[past], value),
        )
        self._cursor.set_data([now_s, now_s], [self._low, self._high])
        self._dot.set_data([now_s], [value])
        self._number.set_text("–" if not np.isfinite(value) else f"{value:.0f}" if self._is_integer else f"{value:.2f}")


def _boxes(layout: FigureLayout, plots: int) -> list[tuple[tuple[float, float, float, float], bool]]:
    """Return the box of each plot within the panel, as shares of the figure, and True if it has an axis of time."""
    assert layout.panel is not None
    x, y, width, height = layout.panel
    left = _NUMBERS_IN / layout.width_in
    foot, head, gap = (inches / layout.height_in for inches in (_FOOT_IN + 0.1, _HEAD_IN, _GAP_IN))
    if layout.panel_on_right:
        each = (height - foot - plots * head - (plots - 1) * gap) / plots
        bottoms = [y + foot + (plots - 1 - i) * (each + head + gap) for i in range(plots)]
        return [((x + left, bottom, width - left, each), i == plots - 1) for i, bottom in enumerate(bottoms)]
    each = width / plots
    return [((x + i * each + left, y + foot, each - 1.4 * left, height - foot - head), True) for i in range(plots)]
