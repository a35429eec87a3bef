"""A laser scanner: the sensor `scan`."""

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, ClassVar, Self

import numpy as np

from swarmwire.comms.base import math as portable
from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.config import parameter
from swarmwire.comms.robot.sensors.rays import ray_directions
from swarmwire.comms.robot.sensors.sensor import Draw, Field, LazyArray, Noise, RangedSensorSpec

FULL_DEG = 360.0


@dataclass(frozen=True)
class ScanSpec(RangedSensorSpec):
    """A laser scanner: the distance to the nearest object on each ray, all at one height.

    Readings: range_m (n, rays), inf where nothing is within the range.
    """

    truth: ClassVar[str] = "swarmwire.world.sensors.scan:ScanSensor"

    rays: int = parameter(help="number of rays", at_least=1, at_most=10_000)
    range_m: float = parameter(help="length of a ray from the scanner", unit="m", above=0)
    range_min_m: float = parameter(
        0.0, help="least distance; nearer objects read as this distance", unit="m", at_least=0
    )
    first_deg: float = parameter(0.0, help="direction of the first ray, counter-clockwise from ahead", unit="deg")
    span_deg: float = parameter(
        FULL_DEG,
        help="angle from the first ray to the last; 360: rays all around, the last one step before the first",
        unit="deg",
        above=0,
        at_most=FULL_DEG,
    )
    at_m: float = parameter(0.0, help="distance of the scanner ahead of the body's centre", unit="m")
    noise_m: float = parameter(0.0, help="standard deviation of the error", unit="m", at_least=0)
    noise_relative: float = parameter(0.0, help="share of the distance that is added to noise_m", at_least=0, at_most=1)

    @classmethod
    def example(cls) -> Self:
        """Return a typical scanner."""
        return cls(rays=12, range_m=1.0, noise_m=0.01)

    def fault(self, radius_m: float) -> tuple[str, str] | None:
        """Return the key and the expectation for a range or a position that cannot be."""
        if self.range_min_m >= self.range_m:
            return "range_min_m", f"expected less than range_m, got {self.range_min_m!r}"
        if abs(self.at_m) > radius_m:
            return "at_m", f"expected a place on the body, whose radius is {radius_m:g} m; got {self.at_m!r}"
        return None

    def reading_fields(self) -> tuple[Field, ...]:
        """Return the field `range_m`, with a number per ray."""
        noise, low, high = Noise("normal", self.noise_m, self.noise_relative), self.range_min_m, self.range_m
        meaning = "distance along each ray from the scanner; inf where nothing is within the range"
        return (Field("range_m", self.rays, noise, self.step, low, high, np.inf, unit="m", help=meaning, per="rays"),)

    def synthetic(self, name: str, tick: int, draw: Draw) -> tuple[FloatArray, ...]:
        """Return random ranges; a fifth of the rays meet nothing."""
        share = draw(name, self.rays)
        return (np.where(share < 0.8, share * self.range_m, np.inf),)

    @property
    def step_rad(self) -> float:
        """Angle between two neighbouring rays."""
        gaps = self.rays if self.span_deg == FULL_DEG else max(self.rays - 1, 1)
        return float(np.deg2rad(self.span_deg) / gaps)

    @cached_property
    def angle_rad(self) -> FloatArray:
        """The directions of the rays in the body's frame, in (-pi, pi], (rays,)."""
        return ray_directions(np.deg2rad(self.first_deg) + self.step_rad * np.arange(self.rays))

    @cached_property
    def direction(self) -> tuple[FloatArray, FloatArray]:
        """Cosine and sine of `angle_rad`, (rays,) each."""
        return portable.cos(self.angle_rad), portable.sin(self.angle_rad)


@dataclass(frozen=True)
class ScanReading:
    """A reading of the scanner."""

    range_m: FloatArray  #: (…, rays) from the scanner; inf where nothing is within its range
    spec: ScanSpec
    if not TYPE_CHECKING:
        range_m = LazyArray()

    @property
    def angle_rad(self) -> FloatArray:
        """Directions of the rays in the body's frame, in (-pi, pi], 0 ahead, positive to the left, (rays,)."""
        return self.spec.angle_rad
