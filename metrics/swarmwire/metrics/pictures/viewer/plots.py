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

_WIDEST = 3.0  # each line is drawn over those before it, and is thinner, so that equal ones are all seen
_OWN_WIDTH = 1.8  # where each has a colour of its own, whenever it comes
_EVENT_MARK = 1.04  # where the mark of an event stands among the shares: above them all
_FATES = {fate: FATE_NAMES[fate].replace("_", " ") for fate in FATE_COLORS}
_PLOTS = {"m": "distances", "s": "times", "bit/s": "rates"}  # by a metric's unit; the others are shares or numbers


class RerunSeries:
    """Lines of a plot, by name: each from the first tick in which it has a value.

    Lines that appear in the same tick are one entity, whose number of lines rerun takes from its first row:
    `plots/<plot>/since_<n>`, where n is how many lines were there before them. `keys/<plot>` has their names.
    """

    def __init__(self, plot: str, colors: Mapping[str, Color] | None = None) -> None:
        """Lines of this plot, in these colours by name, or in those of the palette as they come."""
        self._plot, self._colors = plot, colors or {}
        self._names: dict[str, list[str]] = {}  # of each entity's lines
        self._there: dict[str, Color] = {}  # every line

    def add(self, rows: RerunRows, value: Mapping[str, float]) -> None:
        """Add a tick's numbers by name, NaN for none; the same names in each tick."""
        new = [name for name, number in value.items() if name not in self._there and not isnan(number)]
        if new:
            self._appear(rows.rec, new)
        for entity, names in self._names.items():
            rows.add(entity, rr.Scalars.columns, scalars=[value[name] for name in names])

    def _appear(self, rec: Any, names: list[str]) -> None:
        before = len(self._there)
        entity = f"plots/{self._plot}/since_{before}"
        places = range(before, before + len(names))
        colors = [self._colors.get(name, SERIES[at % len(SERIES)]) for at, name in zip(places, names, strict=True)]
        widths = [_OWN_WIDTH if self._colors else _WIDEST / (1 + at) ** 0.5 for at in places]
        rec.log(entity, rr.SeriesLines(names=names, colors=colors, widths=widths), static=True)
        self._names[entity] = names
        self._there.update(zip(names, colors, strict=True))
        log_legend(rec, f"keys/{self._plot}", list(self._there.items()), KEY_LINES)


class RerunPlots:
    """Plots of the arena, each with the series that have had a value.

    shares: the metrics within 0 and 1, and `link_pdr` (received / in range, over the last second), with a mark where an
    event took effect; distances, times and rates: those in m, in s and in bit/s; numbers: the other metrics; packets:
    receivers per second by fate, once one has had it. Those out of range are left out: they would dwarf the others.
    """

    def __init__(self, static: Static, metrics: Sequence[PlottedMetric]) -> None:
        """Plots of these metrics, and of the packets if there is a radio."""
        self._rate_hz, self._radio = static.rate_hz, static.range_m is not None
        self._robots = static.robots
        self._names = {"shares": [m.name for m in metrics if _plot(m) == "shares"]}
        self._names |= {plot: [m.name for m in metrics if _plot(m) == plot] for plot in (*_PLOTS.values(), "numbers")}
        fates: dict[str, Color] = {_FATES[fate]: color for fate, color in FATE_COLORS.items()}
        self._series = {plot: RerunSeries(plot) for plot in self._names}
        self._series["packets"] = RerunSeries("packets", fates)
        self._occurred: set[str] = set()  # fates
        self._second: deque[IntArray] = deque(maxlen=static.rate_hz)  # per tick: (fates,), in range

    def begin(self, rec: Any) -> None:
        """Log the look of the marks of events; that of a series comes with its first value."""
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
        """Receivers per second over the last one: by fate, (fates,), and in range."""
        if truth.tally is not None:
            self._second.append(np.append(truth.tally.fates[ARENA], truth.tally.in_range[ARENA]))
        if not self._second:
            return np.zeros(len(Fate)), 0.0
        rates = np.sum(self._second, axis=0) * (self._rate_hz / len(self._second))
        return rates[:-1], float(rates[-1])

    def _by_name(self, per_second: FloatArray) -> dict[str, float]:
        """Receivers per second of each fate, NaN until it first occurs."""
        rates = {name: float(per_second[fate]) for fate, name in _FATES.items()}
        self._occurred |= {name for name, rate in rates.items() if rate > 0}
        return {name: rate if name in self._occurred else np.nan for name, rate in rates.items()}


def _plot(metric: PlottedMetric) -> str:
    return "shares" if metric.bounds == (0.0, 1.0) else _PLOTS.get(metric.unit, "numbers")
