"""What drawings take numbers from: the metrics of a run in this process, or those that a run elsewhere publishes."""

from collections.abc import Mapping, Sequence
from typing import Protocol

from swarmwire.comms.arrays import FloatArray


class Plotted(Protocol):
    """A metric, as far as a plot needs to know it."""

    @property
    def name(self) -> str:
        """In the plot's legend."""
        ...

    @property
    def unit(self) -> str:
        """Of its values."""
        ...

    @property
    def bounds(self) -> tuple[float, float | None]:
        """Least and largest value of a tick; None: no largest."""
        ...


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
