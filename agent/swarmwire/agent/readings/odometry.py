"""The reading of the wheel encoders."""

from dataclasses import dataclass
from typing import Generic

from swarmwire.agent.readings.number import N


@dataclass(frozen=True)
class OdometryReading(Generic[N]):
    """The wheel encoders."""

    left_m: N  # travelled by the left wheel since the start
    right_m: N
