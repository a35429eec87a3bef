"""What a metric is: a frozen dataclass of parameters that names itself and measures a number per arena and tick."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.clock import to_ns
from swarmwire.comms.config import parameter
from swarmwire.comms.truth import Static
from swarmwire.metrics.tick_view import TickView

Kind = Literal["level", "count", "time"]
Need = Literal["poses", "contacts", "graph", "airtime", "latency"]  # latency: on air
Measure = Callable[[TickView], FloatArray | float]  # to (arenas,), or one number for all; NaN: nothing to measure


class Metric(ABC):
    """One number per arena and tick.

    A `level` is a state that can be read off at any tick (order). A `count` is what happened within the tick
    (contacts), which adds up over the run. A `time` is when something happened, in s from the start of the run: NaN
    until it has, the same from then on; a run that ends before is right-censored.
    A subclass is a frozen dataclass whose fields, made by `comms.parameters.parameter`, are its parameters. What it
    must remember from tick to tick lives in the function that `begin` returns, so one metric serves many runs.
    """

    name: ClassVar[str]  # in scenarios, summaries and plots
    help: ClassVar[str]  # one line: formula and unit
    unit: ClassVar[str] = ""
    kind: ClassVar[Kind] = "level"
    standard: ClassVar[bool] = False  # measured in every run; others where a scenario lists them
    needs: ClassVar[tuple[Need, ...]] = (
        "poses",
    )  # data that logs of real robots may lack; without them it is left out
    bounds: ClassVar[tuple[float, float | None]]  # least and largest value of a tick; None: no largest

    @abstractmethod
    def begin(self, static: Static) -> Measure:
        """A fresh measure for a run; it is called once per tick, in order."""


@dataclass(frozen=True)
class Sampled(Metric):
    """A metric that is measured at the start, then in the first tick at or after each multiple of `every_s`.

    In between it has the value of the last sample, even if robots have died since; 0 samples every tick.
    """

    every_s: float = parameter(1.0, help="from one sample to the next; 0: every tick", unit="s", at_least=0.0)

    @abstractmethod
    def sample(self, static: Static) -> Measure:
        """A fresh measure for a run; it is called for the ticks that are sampled, in order."""

    def begin(self, static: Static) -> Measure:
        """A fresh measure, which holds what was sampled last."""
        sample, every_ns = self.sample(static), max(to_ns(self.every_s), 1)
        held: FloatArray | float = np.nan
        next_ns = 0

        def measure(view: TickView) -> FloatArray | float:
            nonlocal held, next_ns
            now_ns = view.truth.time_ns
            if now_ns >= next_ns:
                held, next_ns = sample(view), (now_ns // every_ns + 1) * every_ns
            return held

        return measure
