"""Readings of the bumper."""

from dataclasses import dataclass

from swarmwire.comms.arrays import FloatArray


@dataclass(frozen=True)
class BumperReading:
    """One robot's bumper."""

    pressed: bool  # touched a robot, an obstacle or a wall in the tick before


@dataclass(frozen=True)
class BumperReadings:
    """The bumpers of n robots."""

    pressed: FloatArray  # (n,) 1 for a robot that touched anything in the tick before, else 0
