"""What a robot's senses read in this tick. Arrays have a leading axis n for a VectorAgent."""

from dataclasses import dataclass
from functools import cached_property
from typing import Generic, TypeVar

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.sheets import Light, Proximity, Ring

S = TypeVar("S", bound=Ring)


@dataclass(frozen=True)
class _Around(Generic[S]):
    """Sensors around a body, in the data sheet's order (use the angles, never the indices)."""

    value: FloatArray  # (…, sensors) the response, 0 to 1
    sheet: S

    @property
    def angle_rad(self) -> FloatArray:
        """Where the sensors look in the body's frame, (sensors,)."""
        return self.sheet.angle_rad


class _AroundOne(_Around[S]):
    def vector_sum(self) -> tuple[float, float]:
        """X and y of the sum of the sensors as vectors, `value` long towards `angle_rad`: where most of it is."""
        cosine, sine = self.sheet.direction
        return float(np.add.reduce(self.value * cosine)), float(np.add.reduce(self.value * sine))


class _AroundMany(_Around[S]):
    def vector_sum(self) -> tuple[FloatArray, FloatArray]:
        """X and y, (n,) each, of the sum of each robot's sensors as vectors, `value` long towards `angle_rad`."""
        cosine, sine = self.sheet.direction
        return np.add.reduce(self.value * cosine, 1), np.add.reduce(self.value * sine, 1)


class _Near(_Around[Proximity]):
    @cached_property
    def distance_m(self) -> FloatArray:
        """Distance from the rim at which an ideal sensor answers `value`; the reach if nothing is seen, (…, rays)."""
        return self.sheet.response.distance_m(self.value)


class ProximityReading(_Near, _AroundOne[Proximity]):
    """One robot's rays, (rays,) each: value is 0 for nothing, 1 for touching."""


class ProximityReadings(_Near, _AroundMany[Proximity]):
    """The rays of n robots, (n, rays) each but the angles."""


class LightReading(_AroundOne[Light]):
    """One robot's photocells, (cells,) each: value is 0 for dark."""


class LightReadings(_AroundMany[Light]):
    """The photocells of n robots, (n, cells) each but the angles."""


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


@dataclass(frozen=True)
class BumperReading:
    """One robot's bumper."""

    pressed: bool  # touched a robot, an obstacle or a wall in the tick before


@dataclass(frozen=True)
class BumperReadings:
    """The bumpers of n robots."""

    pressed: FloatArray  # (n,) 1 for a robot that touched anything in the tick before, else 0


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
