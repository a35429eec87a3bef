"""The reading of the IMU."""

from dataclasses import dataclass
from typing import Generic

from swarmwire.agent.readings.number import N


@dataclass(frozen=True)
class ImuReading(Generic[N]):
    """What the IMU feels, in the body's frame: the mean over the tick before."""

    forward_mps2: N  # acceleration towards ahead
    left_mps2: N  # acceleration to the left: in a left turn it is positive
    turn_radps: N  # turn rate, positive to the left
