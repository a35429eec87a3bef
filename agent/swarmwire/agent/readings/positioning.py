"""Readings of positioning."""

from dataclasses import dataclass

from swarmwire.comms.arrays import FloatArray


@dataclass(frozen=True)
class PositioningReading:
    """Where one robot is told to be, arena frame."""

    x_m: float
    y_m: float


@dataclass(frozen=True)
class PositioningReadings:
    """Where n robots are told to be, arena frame."""

    x_m: FloatArray  # (n,)
    y_m: FloatArray  # (n,)
