"""An omnidirectional camera: the sensor `camera`."""

from dataclasses import dataclass
from math import isfinite, radians, tan
from typing import ClassVar, Self

import numpy as np

from swarmwire.comms.base.arrays import FloatArray, IntArray
from swarmwire.comms.base.config import parameter
from swarmwire.comms.robot.sensors.sensor import Draw, Field, Noise, SensorSpec

WHITE = 0xFFFFFF  # the brightest colour


@dataclass(frozen=True)
class CameraSpec(SensorSpec):
    """An omnidirectional camera: a mirror above the body shows the lit LEDs of other robots, nearest first.

    Readings: distance_m, bearing_rad, colour (n, max_blobs), nan after the last blob.
    """

    truth: ClassVar[str] = "swarmwire.world.sensors.camera:CameraSensor"

    height_m: float = parameter(help="height of the mirror above the body's lower side", unit="m", above=0)
    aperture_deg: float = parameter(
        help="angle between straight down and the farthest visible point", unit="deg", above=0, below=90
    )
    max_blobs: int = parameter(
        32, help="largest number of blobs in a reading, which has the nearest blobs", at_least=1, at_most=1000
    )
    noise_relative: float = parameter(
        0.0, help="standard deviation of the error of a distance, as a share of it", at_least=0, at_most=1
    )

    @classmethod
    def example(cls) -> Self:
        """Return a typical camera."""
        return cls(height_m=0.2, aperture_deg=70.0, max_blobs=4)

    def reach_m(self, altitude_m: float) -> float:
        """Radius in m of the visible floor, for a body at this altitude."""
        return (altitude_m + self.height_m) * tan(radians(self.aperture_deg))

    def reading_fields(self) -> tuple[Field, ...]:
        """Return the fields `distance_m`, `bearing_rad` and `colour`, each with a number per blob."""
        blobs, noise = self.max_blobs, Noise("normal", 0.0, self.noise_relative)
        distance = "over the floor to each blob of light, nearest first; nan: no further blob"
        bearing = "in the body's frame, 0 ahead, positive to the left"
        return (
            Field("distance_m", blobs, noise, self.step, low=0.0, unit="m", help=distance, per="blobs"),
            Field("bearing_rad", blobs, angle=True, unit="rad", help=bearing, per="blobs"),
            Field("colour", blobs, help="0xRRGGBB", per="blobs"),
        )

    def synthetic(self, name: str, tick: int, draw: Draw) -> tuple[FloatArray, ...]:
        """Return random blobs, a random number of them per robot."""
        blobs = self.max_blobs
        is_empty = np.arange(blobs) >= draw("blobs", 1) * blobs
        distance = np.sort(draw("distance", blobs), axis=1)
        bearing = (draw("bearing", blobs) * 2.0 - 1.0) * np.pi
        colour = np.floor(draw("colour", blobs) * WHITE)
        return tuple(np.where(is_empty, np.nan, column) for column in (distance, bearing, colour))


@dataclass(frozen=True)
class Blob:
    """An LED of another robot in view."""

    distance_m: float  #: distance over the floor from the body's centre
    bearing_rad: float  #: (-pi, pi], 0 ahead, positive to the left, in the body's frame
    colour: int  #: 0xRRGGBB


@dataclass(frozen=True)
class CameraReading:
    """The blobs in view of one robot's omnidirectional camera."""

    blobs: list[Blob]  #: nearest first, by true distance

    @classmethod
    def from_columns(cls, distance_m: FloatArray, bearing_rad: FloatArray, colour: FloatArray) -> "CameraReading":
        """Make the reading from its columns (max_blobs,), nan after the last blob."""
        columns = (column.tolist() for column in (distance_m, bearing_rad, colour))
        return cls([Blob(d, bearing, int(rgb)) for d, bearing, rgb in zip(*columns, strict=True) if isfinite(d)])


@dataclass(frozen=True)
class CameraReadings:
    """The blobs in view of n robots' cameras: a column per blob, sorted by true distance; nan after the last blob."""

    distance_m: FloatArray  #: (n, max_blobs) over the floor, from the body's centre
    bearing_rad: FloatArray  #: (n, max_blobs) in the body's frame, (-pi, pi], 0 ahead, positive to the left
    colour: FloatArray  #: (n, max_blobs) 0xRRGGBB

    @property
    def count(self) -> IntArray:
        """Number of blobs in view of each robot, (n,)."""
        return np.count_nonzero(np.isfinite(self.distance_m), axis=1)
