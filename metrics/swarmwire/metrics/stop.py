"""Stop conditions: an arena ends early once a metric has been beyond a limit for long enough."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from swarmwire.comms.arrays import BoolArray, FloatArray, IntArray
from swarmwire.comms.clock import to_ns, to_s
from swarmwire.comms.interfaces import Observer
from swarmwire.comms.truth import PacketCounts, Static, Truth
from swarmwire.metrics.measure import Metrics

Comparison = Literal["at_least", "at_most", "above", "below"]


@dataclass(frozen=True)
class Condition:
    """A metric's value in an arena, compared with a number."""

    metric: str  # by name: of a level its value in the tick, of a count its total so far, of a time that time
    comparison: Comparison
    limit: float
    hold_s: float = 0.0  # how long it must compare so, in every tick

    def __str__(self) -> str:
        """In words: "order at least 0.9 for 5 s"."""
        hold = f" for {self.hold_s:g} s" if self.hold_s else ""
        return f"{self.metric} {self.comparison.replace('_', ' ')} {self.limit:g}{hold}"


class StopConditions(Observer):
    """Observer that ends arenas.

    Summary parts: `stop`, the conditions in words; `stops`, per arena {stop_time_s, stopped_by}.

    A condition holds in an arena once it has been true in every tick from one at t0 on, and t0 is `hold_s` ago; the
    arena is over then, and t0 its stop time. What has no value is not true. Of several conditions any will do; of those
    that come to hold in the same tick the first is named.
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

    def begin(self, static: Static) -> None:
        """Start afresh."""
        self._true: BoolArray = np.zeros((len(self._conditions), static.arenas), np.bool_)  # in the last tick
        self._since_ns: IntArray = np.zeros(self._true.shape, np.int64)  # where true: since when
        self._over: BoolArray = np.zeros(static.arenas, np.bool_)
        self._by: IntArray = np.zeros(static.arenas, np.int64)  # where over: number of the condition
        self._stop_ns: IntArray = np.zeros(static.arenas, np.int64)  # where over

    def see(self, truth: Truth) -> None:
        """Judge a tick."""
        value = self._sign * self._metrics.values[self._rows]
        true = np.where(self._strict, value > self._limit, value >= self._limit)
        self._since_ns[true & ~self._true] = truth.time_ns
        self._true = true
        holds = true & (truth.time_ns - self._since_ns >= self._hold_ns)
        new = np.flatnonzero(holds.any(axis=0) & ~self._over)
        if len(new):
            self._by[new] = holds[:, new].argmax(axis=0)
            self._stop_ns[new] = self._since_ns[self._by[new], new]
            self._over[new] = True

    def done(self) -> BoolArray | None:
        """Which arenas have been found over so far, (arenas,); None: none."""
        return self._over if self._over.any() else None

    def end(self, last: PacketCounts | None) -> dict[str, Any]:
        """When each arena was over, in s from the start of the run, and by which condition; None where it was not."""
        stops = [self._stop(arena) for arena in range(len(self._over))]
        return {"stop": [str(condition) for condition in self._conditions], "stops": stops}

    def _stop(self, arena: int) -> dict[str, Any]:
        if not self._over[arena]:
            return {"stop_time_s": None, "stopped_by": None}
        by = self._conditions[int(self._by[arena])]
        return {"stop_time_s": to_s(int(self._stop_ns[arena])), "stopped_by": str(by)}
