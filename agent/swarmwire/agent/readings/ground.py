"""Readings of the ground sensors."""

from dataclasses import dataclass

from swarmwire.comms.arrays import FloatArray


@dataclass(frozen=True)
class GroundReading:
    """The floor under one robot's sensors, in the data sheet's order."""

    shade: FloatArray  # (points,) 0 black to 1 white


@dataclass(frozen=True)
class GroundReadings:
    """The floor under the sensors of n robots."""

    shade: FloatArray  # (n, points) 0 black to 1 white
