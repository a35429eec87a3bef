"""Metrics, computed online, their statistics over ticks, and conditions by which an arena ends early."""

import traceback
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, Protocol

import numpy as np

from swarmwire.comms.base.arrays import AnyArray, BoolArray, FloatArray, IntArray
from swarmwire.comms.base.clock import to_ns, to_s
from swarmwire.comms.base.errors import BadInput, CustomCodeFailed
from swarmwire.comms.base.kernels import njit
from swarmwire.comms.observe.interfaces import Observer
from swarmwire.comms.observe.run_views import MetricSeries
from swarmwire.comms.observe.truth import Static, Truth
from swarmwire.comms.radio.records import PacketCounts
from swarmwire.metrics.measures.metric import Measure, Metric, TickView
from swarmwire.metrics.measures.registry import chosen
from swarmwire.metrics.text import json_number

Plotted = Metric | MetricSeries  # a name, a unit and bounds
Comparison = Literal["at_least", "at_most", "above", "below"]


class Measured(Protocol):
    """Metrics with their values in the tick last seen."""

    @property
    def metrics(self) -> Sequence[Plotted]:
        """Which, in order."""
        ...

    @property
    def latest(self) -> Mapping[str, FloatArray]:
        """By name, per arena, (arenas,)."""
        ...


class Metrics(Observer):
    """Observer that measures each tick. Summary part: `metrics`, per arena {name: {final, mean, min, max}}.

    mean, min and max are over ticks: of a level its value at each, of a count what each added, so a count's mean is
    per tick (times the tick rate: per second). final is the level at the start of the last tick, the count's total over
    the run. An arena that leaves is measured up to its last tick. Ticks without a value (no robot alive) are left out;
    what never had one, as the radio graph's without a radio, is null. Memory does not grow with the run.
    """

    def __init__(self, metrics: Sequence[str | Metric] | None = None) -> None:
        """Measure these, by name or as they are, or the standard ones; BadInput for an unknown name."""
        self.metrics = chosen(metrics)

    def begin(self, static: Static) -> None:
        """Start afresh; BadInput if a metric's parameters do not go with the run, CustomCodeFailed if it raises."""
        shape = (len(self.metrics), static.arenas)
        self._static = static
        self._measures: list[Measure] = [self._begun(metric) for metric in self.metrics]
        self._counts: BoolArray = np.array([metric.kind == "count" for metric in self.metrics], np.bool_)
        self._seen: IntArray = np.zeros(shape, np.int64)
        self._sum: FloatArray = np.zeros(shape)
        self._min: FloatArray = np.full(shape, np.nan)
        self._max: FloatArray = np.full(shape, np.nan)
        self._latest: FloatArray = np.full(shape, np.nan)

    def see(self, truth: Truth) -> None:
        """Measure a tick; CustomCodeFailed names a metric that raises, or has no value per arena."""
        view = TickView(self._static, truth)
        value = np.empty_like(self._sum)
        for row, (metric, measure) in enumerate(zip(self.metrics, self._measures, strict=True)):
            try:
                value[row] = measure(view)
            except (Exception, SystemExit) as error:
                raise _failed(metric) from error
        _add(value, self._latest, truth.running, self._counts, self._seen, self._sum, self._min, self._max)
        self._latest = value

    def _begun(self, metric: Metric) -> Measure:
        try:
            return metric.begin(self._static)
        except BadInput as error:  # parameters that do not go with this run
            raise BadInput(error.where, f"metrics.{metric.name}.{error.key}", error.expected) from None
        except (Exception, SystemExit) as error:
            raise _failed(metric) from error

    @property
    def latest(self) -> dict[str, FloatArray]:
        """By name, per arena: each level in its last tick, each count's total so far; NaN where undefined."""
        return {metric.name: self._latest[row] for row, metric in enumerate(self.metrics)}

    @property
    def values(self) -> FloatArray:
        """The values that `latest` returns, (metrics, arenas)."""
        return self._latest

    def end(self, last: PacketCounts | None) -> dict[str, Any]:
        """The statistics over the ticks seen."""
        mean = self._sum / np.where(self._seen > 0, self._seen, np.nan)
        columns = {"final": self._latest, "mean": mean, "min": self._min, "max": self._max}
        return {
            "metrics": [
                {
                    metric.name: {name: json_number(column[row, arena]) for name, column in columns.items()}
                    for row, metric in enumerate(self.metrics)
                }
                for arena in range(self._static.arenas)
            ]
        }


def _failed(metric: Metric) -> CustomCodeFailed:
    return CustomCodeFailed(f"the metric {metric.name} ({type(metric).__name__})", traceback.format_exc())


@njit()
def _add(
    value: AnyArray,
    latest: AnyArray,
    running: AnyArray,
    counts: AnyArray,
    seen: AnyArray,
    total: AnyArray,
    least: AnyArray,
    most: AnyArray,
):
    """Add the values of a tick, (metrics, arenas), to the statistics; those of counts become their totals so far.

    In arenas that are not `running` (arenas,) nothing is added, and the values are the latest.
    """
    for m in range(value.shape[0]):
        for arena in range(value.shape[1]):
            if not running[arena]:
                value[m, arena] = latest[m, arena]
                continue
            one = value[m, arena]
            if not np.isnan(one):
                seen[m, arena] += 1
                total[m, arena] += one
                least[m, arena] = one if seen[m, arena] == 1 else min(least[m, arena], one)
                most[m, arena] = one if seen[m, arena] == 1 else max(most[m, arena], one)
            if counts[m] and seen[m, arena]:
                value[m, arena] = total[m, arena]


@dataclass(frozen=True)
class Condition:
    """A metric's value in an arena, compared with a number."""

    metric: str  # by name: of a level its value in the tick, of a count its total so far, of a time that time
    comparison: Comparison
    limit: float
    hold_s: float = 0.0  # how long it must compare so, in every tick
    keep_running: bool = False  # only its time is noted; the arena runs on

    def __str__(self) -> str:
        """In words: "order at least 0.9 for 5 s"."""
        hold = f" for {self.hold_s:g} s" if self.hold_s else ""
        return f"{self.metric} {self.comparison.replace('_', ' ')} {self.limit:g}{hold}"


class MeasuredStopConditions(Observer):
    """Observer that ends arenas.

    Summary parts: `stop`, the conditions in words; `stops`, per arena {stop_time_s, stopped_by}.

    A condition holds in an arena once it has been true in every tick from one at t0 on, and t0 is `hold_s` ago; the
    arena is over then, unless the condition keeps it running. Its stop time is the t0 of the first condition to hold,
    of several in one tick the first in the list. What has no value is not true.
    """

    def __init__(self, metrics: Metrics, conditions: Sequence[Condition]) -> None:
        """Judge by these conditions; `metrics` measures what they name, and must see each tick before."""
        self._metrics, self._conditions = metrics, tuple(conditions)
        names = [metric.name for metric in metrics.metrics]
        self._rows: IntArray = np.array([names.index(of.metric) for of in conditions], np.int64)
        # "at most" is "at least" of what is turned around.
        upward = [of.comparison in ("at_least", "above") for of in conditions]
        self._sign: FloatArray = np.where(upward, 1.0, -1.0)[:, None]
        self._limit: FloatArray = self._sign * np.array([of.limit for of in conditions])[:, None]
        self._strict: BoolArray = np.array([of.comparison in ("above", "below") for of in conditions])[:, None]
        self._hold_ns: IntArray = np.array([to_ns(of.hold_s) for of in conditions], np.int64)[:, None]
        self._ends: BoolArray = np.array([not of.keep_running for of in conditions])[:, None]

    def begin(self, static: Static) -> None:
        """Start afresh."""
        self._true: BoolArray = np.zeros((len(self._conditions), static.arenas), np.bool_)  # in the last tick
        self._since_ns: IntArray = np.zeros(self._true.shape, np.int64)  # where true: since when
        self._over: BoolArray = np.zeros(static.arenas, np.bool_)
        self._held: BoolArray = np.zeros(static.arenas, np.bool_)  # where any condition has come to hold
        self._by: IntArray = np.zeros(static.arenas, np.int64)  # where held: number of the first condition
        self._stop_ns: IntArray = np.zeros(static.arenas, np.int64)  # where held

    def see(self, truth: Truth) -> None:
        """Judge a tick."""
        value = self._sign * self._metrics.values[self._rows]
        true = np.where(self._strict, value > self._limit, value >= self._limit)
        self._since_ns[true & ~self._true] = truth.time_ns
        self._true = true
        holds = true & (truth.time_ns - self._since_ns >= self._hold_ns)
        new = np.flatnonzero(holds.any(axis=0) & ~self._held)
        if len(new):
            self._by[new] = holds[:, new].argmax(axis=0)
            self._stop_ns[new] = self._since_ns[self._by[new], new]
            self._held[new] = True
        self._over |= (holds & self._ends).any(axis=0)

    def done(self) -> BoolArray | None:
        """Which arenas have been found over so far, (arenas,); None: none."""
        return self._over if self._over.any() else None

    def end(self, last: PacketCounts | None) -> dict[str, Any]:
        """When which condition came to hold in each arena first, in s from the start of the run; None: none did."""
        stops = [self._stop(arena) for arena in range(len(self._over))]
        return {"stop": [str(condition) for condition in self._conditions], "stops": stops}

    def _stop(self, arena: int) -> dict[str, Any]:
        if not self._held[arena]:
            return {"stop_time_s": None, "stopped_by": None}
        by = self._conditions[int(self._by[arena])]
        return {"stop_time_s": to_s(int(self._stop_ns[arena])), "stopped_by": str(by)}
