"""What a metric is: a frozen dataclass of parameters that names itself and measures a number per arena and tick."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import ClassVar, Literal

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.truth import Static
from swarmwire.metrics.moment import Moment

Kind = Literal["level", "count", "time"]
Measure = Callable[[Moment], FloatArray | float]  # to (arenas,), or one number for all; NaN: nothing to measure


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
    bounds: ClassVar[tuple[float, float | None]]  # least and largest value of a tick; None: no largest

    @abstractmethod
    def begin(self, static: Static) -> Measure:
        """A fresh measure for a run; it is called once per tick, in order."""
