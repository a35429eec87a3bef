"""Readings of the compass."""

from dataclasses import dataclass

from swarmwire.comms.arrays import FloatArray


@dataclass(frozen=True)
class CompassReading:
    """One robot's compass."""

    heading_rad: float  # 0 along the arena's +x, counter-clockwise, in (-pi, pi]


@dataclass(frozen=True)
class CompassReadings:
    """The compasses of n robots."""

    heading_rad: FloatArray  # (n,)
