"""Readings of the sensors of one robot, or of n robots.

A reading with a single number per robot holds a float for an Agent and an array (n,) for a VectorAgent (type `N`).
Arrays of the form (…, width) are (width,) for one robot and (n, width) for n robots. Angles are in the body's frame, 0
ahead and positive to the left, unless another frame is named.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Generic, TypeVar, cast

import numpy as np

from swarmwire.comms.arrays import FloatArray, IntArray
from swarmwire.comms.bodies.ranging_specs import (
    InfraredSpec,
    LightSpec,
    ProximitySpec,
    RadialSpec,
    RayArraySpec,
    ScanSpec,
)

N = TypeVar("N", bound=float | FloatArray)  # a float for an Agent; (n,) for a VectorAgent
S = TypeVar("S", bound=RadialSpec)
R = TypeVar("R", bound=RayArraySpec)


@dataclass(frozen=True)
class Around(Generic[N, S]):
    """Sensors around a body, in the order of the spec (use the angles, never the indices)."""

    value: FloatArray  # (…, sensors) the response, 0 to 1
    spec: S

    @property
    def angle_rad(self) -> FloatArray:
        """Directions of the sensors in the body's frame, (sensors,)."""
        return self.spec.angle_rad

    def vector_sum(self) -> tuple[N, N]:
        """X and y of the sum of the sensors as vectors of length `value` towards `angle_rad`."""
        value, (cosine, sine) = self.value, self.spec.direction
        if value.ndim == 1:  # called once per robot and tick: faster than the call with an axis
            return cast("tuple[N, N]", (float(np.add.reduce(value * cosine)), float(np.add.reduce(value * sine))))
        return cast("tuple[N, N]", (np.add.reduce(value * cosine, 1), np.add.reduce(value * sine, 1)))


class _AtRim(Around[N, R]):
    @cached_property
    def distance_m(self) -> FloatArray:
        """Distance from the rim at which an ideal ray reads `value`; its range if it sees nothing, (…, rays)."""
        return self.spec.response.distance_m(self.value)


class ProximityReading(_AtRim[N, ProximitySpec]):
    """Proximity rays, (…, rays): value is 0 for nothing, 1 for touching."""


class InfraredReading(_AtRim[N, InfraredSpec]):
    """Rays of passive infrared, (…, rays): value is 0 for no robot, 1 for touching one."""


class LightReading(Around[N, LightSpec]):
    """Photocells, (…, cells): value is 0 for dark."""


@dataclass(frozen=True)
class BatteryReading(Generic[N]):
    """The battery's gauge."""

    charge: N  # 1 full, 0 empty; an empty battery stops the motors
    voltage_v: N


@dataclass(frozen=True)
class BumperReading:
    """One robot's bumper."""

    pressed: bool  # touched a robot, an obstacle or a wall in the tick before


@dataclass(frozen=True)
class BumperReadings:
    """The bumpers of n robots."""

    pressed: FloatArray  # (n,) 1 for a robot that touched anything in the tick before, else 0


@dataclass(frozen=True)
class Blob:
    """A LED of another robot in view."""

    distance_m: float  # over the floor, from the body's centre
    bearing_rad: float  # in the body's frame, (-pi, pi], 0 ahead, positive to the left
    colour: int  # 0xRRGGBB


@dataclass(frozen=True)
class CameraReading:
    """The blobs in view of one robot's omnidirectional camera."""

    blobs: list[Blob]  # by true distance, the nearest first

    @classmethod
    def of(cls, distance_m: FloatArray, bearing_rad: FloatArray, colour: FloatArray) -> "CameraReading":
        """The reading of these columns (most_blobs,), nan where there is no blob."""
        seen = np.isfinite(distance_m)
        columns = (column[seen].tolist() for column in (distance_m, bearing_rad, colour))
        return cls([Blob(d, bearing, int(rgb)) for d, bearing, rgb in zip(*columns, strict=True)])


@dataclass(frozen=True)
class CameraReadings:
    """The blobs in view of n robots' cameras, a column per blob, by true distance; nan where there is none."""

    distance_m: FloatArray  # (n, most_blobs) over the floor, from the body's centre
    bearing_rad: FloatArray  # (n, most_blobs) in the body's frame, (-pi, pi], 0 ahead, positive to the left
    colour: FloatArray  # (n, most_blobs) 0xRRGGBB

    @property
    def count(self) -> IntArray:
        """Number of blobs in view of each robot, (n,)."""
        return np.count_nonzero(np.isfinite(self.distance_m), axis=1)


@dataclass(frozen=True)
class CompassReading(Generic[N]):
    """The heading of the body."""

    heading_rad: N  # 0 along the arena's +x, counter-clockwise, in (-pi, pi]


@dataclass(frozen=True)
class GroundReading:
    """The floor under the ground sensors, in the order of the spec."""

    shade: FloatArray  # (…, points) 0 black to 1 white


@dataclass(frozen=True)
class ImuReading(Generic[N]):
    """Acceleration and turn rate in the body's frame: the mean over the tick before."""

    forward_mps2: N  # acceleration ahead
    left_mps2: N  # acceleration to the left: in a left turn it is positive
    turn_radps: N  # turn rate, positive to the left


@dataclass(frozen=True)
class OdometryReading(Generic[N]):
    """The wheel encoders."""

    left_m: N  # travelled by the left wheel since the start
    right_m: N


class CustomReading:
    """The reading of a custom sensor: each of its fields is an attribute.

    For one robot a float, or (width,); for n robots (n,), or (n, width).
    """

    def __init__(self, sensor: str, fields: Mapping[str, Any]) -> None:
        self._sensor, self._fields = sensor, fields

    def __getattr__(self, name: str) -> Any:
        """A field by its name."""
        if name.startswith("_") or name not in self._fields:
            raise AttributeError(f"the sensor {self._sensor} has the fields {', '.join(self._fields)}, not {name}")
        return self._fields[name]


@dataclass(frozen=True)
class PositioningReading(Generic[N]):
    """The measured position, in the arena's frame."""

    x_m: N
    y_m: N


@dataclass(frozen=True)
class ScanReading:
    """The rays of the scanner."""

    range_m: FloatArray  # (…, rays) from the scanner; inf where nothing is within its range
    spec: ScanSpec

    @property
    def angle_rad(self) -> FloatArray:
        """Directions of the rays in the body's frame, (rays,)."""
        return self.spec.angle_rad
