"""The plots of a recording: metrics by kind, and receivers per second by packet fate."""

from collections import deque
from collections.abc import Mapping, Sequence
from math import isnan
from typing import Any

import numpy as np
import rerun as rr

from swarmwire.comms.base.arrays import FloatArray, IntArray
from swarmwire.comms.observe.truth import EventRecord, Static, Truth
from swarmwire.comms.robot.packets import FATE_NAMES, Fate
from swarmwire.metrics.measures.measure import PlottedMetric
from swarmwire.metrics.measures.registry import LINK_PDR
from swarmwire.metrics.pictures.drawing.canvas import FATE_COLORS, Color
from swarmwire.metrics.pictures.viewer.rows import RerunRows
from swarmwire.metrics.pictures.viewer.selection import ARENA
from swarmwire.metrics.pictures.viewer.style import KEY_LINES, MARK, SERIES, log_legend

_MAX_WIDTH = 3.0  # later lines are above earlier ones and thinner, so that equal lines are all visible
_WIDTH = 1.8  # width of lines with fixed colours
_EVENT_MARK = 1.04  # height of the mark of an event, above all shares
_FATES = {fate: FATE_NAMES[fate].replace("_", " ") for fate in FATE_COLORS}
_PLOTS = {"m": "distances", "s": "times", "bit/s": "rates"}  # plots by unit; other metrics are shares or numbers


class RerunSeries:
    """Lines of a plot by name, each from its first tick with a value.

    Lines that appear in the same tick form an entity, since rerun takes the number of lines from an entity's first row:
    `plots/<plot>/since_<n>`, where n is the number of earlier lines. `keys/<plot>` has their names.
    """

    def __init__(self, plot: str, colors: Mapping[str, Color] | None = None) -> None:
        """Create lines with these colours by name, or with those of the palette in order of appearance."""
        self._plot, self._colors = plot, colors or {}
        self._names: dict[str, list[str]] = {}  # names of lines by entity
        self._lines: dict[str, Color] = {}  # colours of lines by name

    def add(self, rows: RerunRows, value: Mapping[str, float]) -> None:
        """Add a tick's numbers by name, or NaN; names are the same in each tick."""
        new = [name for name, number in value.items() if name not in self._lines and not isnan(number)]
        if new:
            self._appear(rows.rec, new)
        for entity, names in self._names.items():
            rows.add(entity, rr.Scalars.columns, scalars=[value[name] for name in names])

    def _appear(self, rec: Any, names: list[str]) -> None:
        before = len(self._lines)
        entity = f"plots/{self._plot}/since_{before}"
        indices = range(before, before + len(names))
        colors = [self._colors.get(name, SERIES[i % len(SERIES)]) for i, name in zip(indices, names, strict=True)]
        widths = [_WIDTH if self._colors else _MAX_WIDTH / (1 + i) ** 0.5 for i in indices]
        rec.log(entity, rr.SeriesLines(names=names, colors=colors, widths=widths), static=True)
        self._names[entity] = names
        self._lines.update(zip(names, colors, strict=True))
        log_legend(rec, f"keys/{self._plot}", list(self._lines.items()), KEY_LINES)


class RerunPlots:
    """Plots of the arena, each with the series that have had a value.

    shares: metrics within 0 and 1, and `link_pdr` (received / in range, over the last second), with marks of events;
    distances, times and rates: metrics in m, in s and in bit/s; numbers: other metrics; packets: receivers per second
    by fate, once it has occurred. Receivers out of range are omitted, since they would dwarf the others.
    """

    def __init__(self, static: Static, metrics: Sequence[PlottedMetric]) -> None:
        """Create plots of these metrics, and of packets if there is a radio."""
        self._rate_hz, self._radio = static.rate_hz, static.range_m is not None
        self._robots = static.robots
        self._names = {"shares": [m.name for m in metrics if _plot(m) == "shares"]}
        self._names |= {plot: [m.name for m in metrics if _plot(m) == plot] for plot in (*_PLOTS.values(), "numbers")}
        fates: dict[str, Color] = {_FATES[fate]: color for fate, color in FATE_COLORS.items()}
        self._series = {plot: RerunSeries(plot) for plot in self._names}
        self._series["packets"] = RerunSeries("packets", fates)
        self._occurred: set[str] = set()  # names of fates
        self._second: deque[IntArray] = deque(maxlen=static.rate_hz)  # per tick: (fates,), in range

    def begin(self, rec: Any) -> None:
        """Log the look of the marks of events; the look of a series is logged with its first value."""
        look = rr.SeriesPoints(names="event", colors=MARK, markers="Diamond", marker_sizes=4.0)
        rec.log("plots/shares/event", look, static=True)

    def add(self, rows: RerunRows, latest: Mapping[str, FloatArray], truth: Truth) -> None:
        """Add the numbers of a tick."""
        numbers = {plot: {name: latest[name][ARENA] for name in names} for plot, names in self._names.items()}
        if self._radio:
            per_second, in_range = self._per_second(truth)
            link_pdr = per_second[Fate.RECEIVED] / in_range if in_range > 0 else np.nan
            numbers["shares"].setdefault(LINK_PDR, link_pdr)
            numbers["packets"] = self._by_name(per_second)
        for plot, value in numbers.items():
            self._series[plot].add(rows, value)
        if any(self._concerns(event) for event in truth.events):
            rows.add("plots/shares/event", rr.Scalars.columns, scalars=[_EVENT_MARK])

    def _concerns(self, event: EventRecord) -> bool:
        return not event.singly or bool(event.changed[: self._robots].any())

    def _per_second(self, truth: Truth) -> tuple[FloatArray, float]:
        """Return receivers per second over the last second: by fate, (fates,), and in range."""
        if truth.tally is not None:
            self._second.append(np.append(truth.tally.fates[ARENA], truth.tally.in_range[ARENA]))
        if not self._second:
            return np.zeros(len(Fate)), 0.0
        rates = np.sum(self._second, axis=0) * (self._rate_hz / len(self._second))
        return rates[:-1], float(rates[-1])

    def _by_name(self, per_second: FloatArray) -> dict[str, float]:
        """Return receivers per second of each fate, NaN until it first occurs."""
        rates = {name: float(per_second[fate]) for fate, name in _FATES.items()}
        self._occurred |= {name for name, rate in rates.items() if rate > 0}
        return {name: rate if name in self._occurred else np.nan for name, rate in rates.items()}


def _plot(metric: PlottedMetric) -> str:
    return "shares" if metric.bounds == (0.0, 1.0) else _PLOTS.get(metric.unit, "numbers")
