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
    """An omnidirectional camera: a mirror above the body shows the lit LEDs of other robots, the nearest first.

    Readings: distance_m, bearing_rad, colour (n, max_blobs), nan after the last blob.
    """

    truth: ClassVar[str] = "swarmwire.world.sensors.camera:CameraSensor"

    height_m: float = parameter(help="height of the mirror above the body's lower side", unit="m", above=0)
    aperture_deg: float = parameter(
        help="angle between straight down and the farthest that it sees", unit="deg", above=0, below=90
    )
    max_blobs: int = parameter(
        32, help="largest number of blobs in a reading: the nearest ones", at_least=1, at_most=1000
    )
    noise_relative: float = parameter(
        0.0, help="standard deviation of the error of a distance, as a share of it", at_least=0, at_most=1
    )

    @classmethod
    def example(cls) -> Self:
        """As `SensorSpec.example`."""
        return cls(height_m=0.2, aperture_deg=70.0, max_blobs=4)

    def reach_m(self, altitude_m: float) -> float:
        """Radius in m of the visible floor, for a body at this altitude."""
        return (altitude_m + self.height_m) * tan(radians(self.aperture_deg))

    def reading_fields(self) -> tuple[Field, ...]:
        """As `SensorSpec.reading_fields`."""
        blobs, noise = self.max_blobs, Noise("normal", 0.0, self.noise_relative)
        distance = "over the floor to each blob of light, the nearest first; nan: no further blob"
        bearing = "in the body's frame, 0 ahead, positive to the left"
        return (
            Field("distance_m", blobs, noise, self.step, low=0.0, unit="m", help=distance, per="blobs"),
            Field("bearing_rad", blobs, angle=True, unit="rad", help=bearing, per="blobs"),
            Field("colour", blobs, help="0xRRGGBB", per="blobs"),
        )

    def synthetic(self, name: str, tick: int, draw: Draw) -> tuple[FloatArray, ...]:
        """As `SensorSpec.synthetic`."""
        blobs = self.max_blobs
        none = np.arange(blobs) >= draw("blobs", 1) * blobs
        nearest_first = np.sort(draw("distance", blobs), axis=1)
        bearing = (draw("bearing", blobs) * 2.0 - 1.0) * np.pi
        colour = np.floor(draw("colour", blobs) * WHITE)
        return tuple(np.where(none, np.nan, column) for column in (nearest_first, bearing, colour))


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
    def from_columns(cls, distance_m: FloatArray, bearing_rad: FloatArray, colour: FloatArray) -> "CameraReading":
        """The reading of these columns (max_blobs,), nan where there is no blob."""
        columns = (column.tolist() for column in (distance_m, bearing_rad, colour))
        return cls([Blob(d, bearing, int(rgb)) for d, bearing, rgb in zip(*columns, strict=True) if isfinite(d)])


@dataclass(frozen=True)
class CameraReadings:
    """The blobs in view of n robots' cameras, a column per blob, by true distance; nan where there is none."""

    distance_m: FloatArray  # (n, max_blobs) over the floor, from the body's centre
    bearing_rad: FloatArray  # (n, max_blobs) in the body's frame, (-pi, pi], 0 ahead, positive to the left
    colour: FloatArray  # (n, max_blobs) 0xRRGGBB

    @property
    def count(self) -> IntArray:
        """Number of blobs in view of each robot, (n,)."""
        return np.count_nonzero(np.isfinite(self.distance_m), axis=1)
