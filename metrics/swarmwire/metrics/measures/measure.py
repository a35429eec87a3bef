"""Online metrics, their statistics over ticks, and stop conditions that end an arena early."""

import traceback
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple, Protocol

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
from swarmwire.metrics.measures.registry import resolve_metrics
from swarmwire.metrics.text import json_number

PlottedMetric = Metric | MetricSeries  # a name, a unit and bounds
Comparison = Literal["at_least", "at_most", "above", "below"]


class MetricValues(Protocol):
    """Metrics with their values in the latest tick."""

    @property
    def metrics(self) -> Sequence[PlottedMetric]:
        """The metrics, in order."""
        ...

    @property
    def latest(self) -> Mapping[str, FloatArray]:
        """Values by name, (arenas,) each."""
        ...


class _Statistics(NamedTuple):
    """Statistics over the ticks that had a value, (metrics, arenas) each."""

    ticks: IntArray
    total: FloatArray
    least: FloatArray
    largest: FloatArray


class Metrics(Observer):
    """Observer that measures each tick. Summary part: `metrics`, per arena {name: {final, mean, min, max}}.

    mean, min and max are over ticks: over the values of a level, and over the increments of a count, so a count's mean
    is per tick (times the tick rate: per second). final is the level at the start of the last tick, or the count's
    total over the run. An arena that leaves is measured up to its last tick. Ticks without a value (no robot alive) are
    left out; a metric that never had one, such as those of the radio graph without a radio, is null. Memory does not
    grow with the run.
    """

    def __init__(self, metrics: Sequence[str | Metric] | None = None) -> None:
        """Measure these metrics (names or objects), or the standard ones; BadInput for an unknown name."""
        self.metrics = resolve_metrics(metrics)

    def begin(self, static: Static) -> None:
        """Start a run; BadInput if a metric's parameters do not fit the run, CustomCodeFailed if it raises."""
        shape = (len(self.metrics), static.arenas)
        self._static = static
        self._measures: list[Measure] = [self._begin_metric(metric) for metric in self.metrics]
        self._is_count: BoolArray = np.array([metric.kind == "count" for metric in self.metrics], np.bool_)
        self._statistics = _Statistics(
            np.zeros(shape, np.int64), np.zeros(shape), np.full(shape, np.nan), np.full(shape, np.nan)
        )
        self._latest: FloatArray = np.full(shape, np.nan)

    def see(self, truth: Truth) -> None:
        """Measure a tick; CustomCodeFailed names a metric that raises, or has no value per arena."""
        view = TickView(self._static, truth)
        value = np.empty_like(self._latest)
        for row, (metric, measure) in enumerate(zip(self.metrics, self._measures, strict=True)):
            try:
                value[row] = measure(view)
            except (Exception, SystemExit) as error:
                raise _metric_failure(metric) from error
        _accumulate(value, self._latest, truth.running, self._is_count, self._statistics)
        self._latest = value

    def _begin_metric(self, metric: Metric) -> Measure:
        try:
            return metric.begin(self._static)
        except BadInput as error:  # parameters that do not fit this run
            raise BadInput(error.where, f"metrics.{metric.name}.{error.key}", error.expected) from None
        except (Exception, SystemExit) as error:
            raise _metric_failure(metric) from error

    @property
    def latest(self) -> dict[str, FloatArray]:
        """Values by name, (arenas,) each: a level in its last tick, a count's total so far; NaN where undefined."""
        return {metric.name: self._latest[row] for row, metric in enumerate(self.metrics)}

    @property
    def values(self) -> FloatArray:
        """The values that `latest` returns, (metrics, arenas)."""
        return self._latest

    def end(self, last: PacketCounts | None) -> dict[str, Any]:
        """Return the statistics over the ticks seen."""
        ticks, total, least, largest = self._statistics
        mean = total / np.where(ticks > 0, ticks, np.nan)
        columns = {"final": self._latest, "mean": mean, "min": least, "max": largest}
        return {
            "metrics": [
                {
                    metric.name: {name: json_number(column[row, arena]) for name, column in columns.items()}
                    for row, metric in enumerate(self.metrics)
                }
                for arena in range(self._static.arenas)
            ]
        }


def _metric_failure(metric: Metric) -> CustomCodeFailed:
    return CustomCodeFailed(f"the metric {metric.name} ({type(metric).__name__})", traceback.format_exc())


@njit()
def _accumulate(value: AnyArray, latest: AnyArray, running: AnyArray, is_count: AnyArray, statistics: Any):
    """Add the values of a tick, (metrics, arenas), to the statistics; values of counts become their totals so far.

    Arenas that are not `running` (arenas,) add nothing and repeat their latest values.
    """
    ticks, total, least, largest = statistics
    for m in range(value.shape[0]):
        for arena in range(value.shape[1]):
            if not running[arena]:
                value[m, arena] = latest[m, arena]
                continue
            v = value[m, arena]
            if not np.isnan(v):
                ticks[m, arena] += 1
                total[m, arena] += v
                least[m, arena] = v if ticks[m, arena] == 1 else min(least[m, arena], v)
                largest[m, arena] = v if ticks[m, arena] == 1 else max(largest[m, arena], v)
            if is_count[m] and ticks[m, arena]:
                value[m, arena] = total[m, arena]


@dataclass(frozen=True)
class Condition:
    """A metric's value in an arena, compared with a number."""

    metric: str  #: name of a metric: a level's value in the tick, a count's total so far, or a time
    comparison: Comparison
    limit: float
    hold_s: float = 0.0  #: time for which the comparison must be true in every tick
    keep_running: bool = False  #: record the time only; the arena continues

    def __str__(self) -> str:
        """Return the condition in words: "order at least 0.9 for 5 s"."""
        hold = f" for {self.hold_s:g} s" if self.hold_s else ""
        return f"{self.metric} {self.comparison.replace('_', ' ')} {self.limit:g}{hold}"


class MeasuredStopConditions(Observer):
    """Observer that ends arenas.

    Summary parts: `stop`, the conditions in words; `stops`, per arena {stop_time_s, stopped_by}.

    A condition holds in an arena once it has been true in every tick for `hold_s`, since a tick t0; the arena ends
    then, unless the condition keeps it running. Its stop time is the t0 of the first condition to hold; if several hold
    in one tick, of the first in the list. A metric without a value makes its condition false.
    """

    def __init__(self, metrics: Metrics, conditions: Sequence[Condition]) -> None:
        """Evaluate these conditions on `metrics`, which has their metrics and must see each tick first."""
        self._metrics, self._conditions = metrics, tuple(conditions)
        names = [metric.name for metric in metrics.metrics]
        self._rows: IntArray = np.array([names.index(c.metric) for c in conditions], np.int64)
        # "At most" is "at least" of the negated values.
        upward = [c.comparison in ("at_least", "above") for c in conditions]
        self._sign: FloatArray = np.where(upward, 1.0, -1.0)[:, None]
        self._limit: FloatArray = self._sign * np.array([c.limit for c in conditions])[:, None]
        self._strict: BoolArray = np.array([c.comparison in ("above", "below") for c in conditions])[:, None]
        self._hold_ns: IntArray = np.array([to_ns(c.hold_s) for c in conditions], np.int64)[:, None]
        self._ends: BoolArray = np.array([not c.keep_running for c in conditions])[:, None]

    def begin(self, static: Static) -> None:
        """Start a run."""
        self._true: BoolArray = np.zeros((len(self._conditions), static.arenas), np.bool_)  # result of the last tick

        self._since_ns: IntArray = np.zeros(self._true.shape, np.int64)  # start of the true stretch, if true
        self._over: BoolArray = np.zeros(static.arenas, np.bool_)
        self._stopped: BoolArray = np.zeros(static.arenas, np.bool_)  # True once any condition held
        self._stopped_by: IntArray = np.zeros(static.arenas, np.int64)  # index of the first condition, if stopped
        self._stop_ns: IntArray = np.zeros(static.arenas, np.int64)  # if stopped

    def see(self, truth: Truth) -> None:
        """Evaluate the conditions in a tick."""
        value = self._sign * self._metrics.values[self._rows]
        true = np.where(self._strict, value > self._limit, value >= self._limit)
        self._since_ns[true & ~self._true] = truth.time_ns
        self._true = true
        holds = true & (truth.time_ns - self._since_ns >= self._hold_ns)
        new = np.flatnonzero(holds.any(axis=0) & ~self._stopped)
        if len(new):
            self._stopped_by[new] = holds[:, new].argmax(axis=0)
            self._stop_ns[new] = self._since_ns[self._stopped_by[new], new]
            self._stopped[new] = True
        self._over |= (holds & self._ends).any(axis=0)

    def done(self) -> BoolArray | None:
        """Return True for the arenas that are over, (arenas,); None if none is."""
        return self._over if self._over.any() else None

    def end(self, last: PacketCounts | None) -> dict[str, Any]:
        """Return the first condition that held in each arena, and its time in s from the start of the run."""
        stops = [self._stop(arena) for arena in range(len(self._over))]
        return {"stop": [str(condition) for condition in self._conditions], "stops": stops}

    def _stop(self, arena: int) -> dict[str, Any]:
        if not self._stopped[arena]:
            return {"stop_time_s": None, "stopped_by": None}
        condition = self._conditions[int(self._stopped_by[arena])]
        return {"stop_time_s": to_s(int(self._stop_ns[arena])), "stopped_by": str(condition)}
