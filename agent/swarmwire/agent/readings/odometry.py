"""Readings of the wheel encoders."""

from dataclasses import dataclass

from swarmwire.comms.arrays import FloatArray


@dataclass(frozen=True)
class OdometryReading:
    """One robot's wheel encoders."""

    left_m: float  # travelled by the left wheel since the start
    right_m: float


@dataclass(frozen=True)
class OdometryReadings:
    """The wheel encoders of n robots."""

    left_m: FloatArray  # (n,)
    right_m: FloatArray  # (n,)
