"""The reading of the compass."""

from dataclasses import dataclass
from typing import Generic

from swarmwire.agent.readings.number import N


@dataclass(frozen=True)
class CompassReading(Generic[N]):
    """The heading."""

    heading_rad: N  # 0 along the arena's +x, counter-clockwise, in (-pi, pi]
