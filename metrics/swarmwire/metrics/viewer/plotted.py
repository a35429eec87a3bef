"""What drawings take numbers from: the metrics of a run in this process, or those that a run elsewhere publishes."""

from collections.abc import Mapping, Sequence
from typing import Protocol

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.run_views import MetricSeries
from swarmwire.metrics.metric import Metric

Plotted = Metric | MetricSeries  # a name, a unit and bounds


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
