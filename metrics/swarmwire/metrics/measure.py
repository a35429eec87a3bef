"""Metrics, computed online: one number per metric and arena in each tick, their statistics over ticks at the end."""

# pyright: basic, reportUnknownMemberType=false

import math
import traceback
from collections.abc import Sequence
from typing import Any

import numpy as np

from swarmwire.comms.arrays import BoolArray, FloatArray, IntArray
from swarmwire.comms.errors import BadInput, CustomCodeFailed
from swarmwire.comms.interfaces import Observer
from swarmwire.comms.kernels import njit
from swarmwire.comms.truth import PacketCounts, Static, Truth
from swarmwire.metrics.metric import Measure, Metric
from swarmwire.metrics.registry import chosen
from swarmwire.metrics.tick_view import TickView


def json_number(number: float) -> float | None:
    """A Python float, or None for what is not a number: undefined, or nothing to measure."""
    value = float(number)
    return None if math.isnan(value) else value


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
        """What `latest` tells, (metrics, arenas)."""
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
def _add(value, latest, running, counts, seen, total, least, most):
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
