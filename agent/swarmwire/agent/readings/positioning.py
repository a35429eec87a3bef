"""The reading of positioning."""

from dataclasses import dataclass
from typing import Generic

from swarmwire.agent.readings.number import N


@dataclass(frozen=True)
class PositioningReading(Generic[N]):
    """Where the robot is told to be, arena frame."""

    x_m: N
    y_m: N
