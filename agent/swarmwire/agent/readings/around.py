"""Readings of sensors around a body."""

from dataclasses import dataclass
from functools import cached_property
from typing import Generic, TypeVar, cast

import numpy as np

from swarmwire.agent.readings.number import N
from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.bodies.sensors import Infrared, Light, Proximity, Rim, Ring

S = TypeVar("S", bound=Ring)
R = TypeVar("R", bound=Rim)


@dataclass(frozen=True)
class Around(Generic[N, S]):
    """Sensors around a body, in the data sheet's order (use the angles, never the indices)."""

    value: FloatArray  # (…, sensors) the response, 0 to 1
    sheet: S

    @property
    def angle_rad(self) -> FloatArray:
        """Where the sensors look in the body's frame, (sensors,)."""
        return self.sheet.angle_rad

    def vector_sum(self) -> tuple[N, N]:
        """X and y of the sum of the sensors as vectors, `value` long towards `angle_rad`: where most of it is."""
        value, (cosine, sine) = self.value, self.sheet.direction
        if value.ndim == 1:  # once a robot and tick: a faster call than that for any axis
            return cast("tuple[N, N]", (float(np.add.reduce(value * cosine)), float(np.add.reduce(value * sine))))
        return cast("tuple[N, N]", (np.add.reduce(value * cosine, 1), np.add.reduce(value * sine, 1)))


class _AtRim(Around[N, R]):
    @cached_property
    def distance_m(self) -> FloatArray:
        """Distance from the rim at which an ideal sensor answers `value`; the reach if it sees nothing, (…, rays)."""
        return self.sheet.response.distance_m(self.value)


class ProximityReading(_AtRim[N, Proximity]):
    """The rays of proximity, (…, rays): value is 0 for nothing, 1 for touching."""


class InfraredReading(_AtRim[N, Infrared]):
    """The rays of passive infrared, (…, rays): value is 0 for no robot, 1 for touching one."""


class LightReading(Around[N, Light]):
    """Photocells, (…, cells): value is 0 for dark."""
