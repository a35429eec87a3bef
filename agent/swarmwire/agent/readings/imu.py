"""Readings of the IMU."""

from dataclasses import dataclass

from swarmwire.comms.arrays import FloatArray


@dataclass(frozen=True)
class ImuReading:
    """What one robot's IMU feels, in the body's frame: the mean over the tick before."""

    forward_mps2: float  # acceleration towards ahead
    left_mps2: float  # acceleration to the left: in a left turn it is positive
    turn_radps: float  # turn rate, positive to the left


@dataclass(frozen=True)
class ImuReadings:
    """What the IMUs of n robots feel."""

    forward_mps2: FloatArray  # (n,)
    left_mps2: FloatArray  # (n,)
    turn_radps: FloatArray  # (n,)
