"""What a robot's senses read in this tick. Arrays of Proximity have a leading axis n for a VectorAgent."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.sheets import Proximity


@dataclass(frozen=True)
class _Rays:
    """Rays around a body, in the data sheet's order (use the angles, never the indices)."""

    value: FloatArray  # (…, rays) the sensor's response: 0 nothing, 1 touching
    sheet: Proximity

    @cached_property
    def distance_m(self) -> FloatArray:
        """Distance from the rim at which an ideal sensor answers `value`; the reach if nothing is seen, (…, rays)."""
        return self.sheet.response.distance_m(self.value)

    @property
    def angle_rad(self) -> FloatArray:
        """Directions of the rays in the body's frame, (rays,)."""
        return self.sheet.angle_rad


class ProximityReading(_Rays):
    """One robot's rays, (rays,) each."""

    def vector_sum(self) -> tuple[float, float]:
        """X and y of the sum of the rays as vectors, `value` long towards `angle_rad`: where things are near."""
        cosine, sine = self.sheet.direction
        return float(np.add.reduce(self.value * cosine)), float(np.add.reduce(self.value * sine))


class ProximityReadings(_Rays):
    """The rays of n robots, (n, rays) each but the angles."""

    def vector_sum(self) -> tuple[FloatArray, FloatArray]:
        """X and y, (n,) each, of the sum of each robot's rays as vectors, `value` long towards `angle_rad`."""
        cosine, sine = self.sheet.direction
        return np.add.reduce(self.value * cosine, 1), np.add.reduce(self.value * sine, 1)


@dataclass(frozen=True)
class CompassReading:
    """One robot's compass."""

    heading_rad: float  # 0 along the arena's +x, counter-clockwise, in (-pi, pi]


@dataclass(frozen=True)
class CompassReadings:
    """The compasses of n robots."""

    heading_rad: FloatArray  # (n,)


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
