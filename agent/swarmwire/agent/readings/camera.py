"""Readings of the omnidirectional camera."""

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.arrays import FloatArray, IntArray


@dataclass(frozen=True)
class Blob:
    """A LED of another robot."""

    distance_m: float  # over the floor, from the body's centre
    bearing_rad: float  # in the body's frame, (-pi, pi], 0 ahead, positive to the left
    colour: int  # 0xRRGGBB


@dataclass(frozen=True)
class CameraReading:
    """What one robot's camera sees."""

    blobs: list[Blob]  # by true distance, the nearest first

    @classmethod
    def of(cls, distance_m: FloatArray, bearing_rad: FloatArray, colour: FloatArray) -> "CameraReading":
        """The reading of these columns (most_blobs,), nan where there is no blob."""
        seen = np.isfinite(distance_m)
        columns = (column[seen].tolist() for column in (distance_m, bearing_rad, colour))
        return cls([Blob(d, bearing, int(rgb)) for d, bearing, rgb in zip(*columns, strict=True)])


@dataclass(frozen=True)
class CameraReadings:
    """What the cameras of n robots see, a column per blob, by true distance; nan where there is none."""

    distance_m: FloatArray  # (n, most_blobs) over the floor, from the body's centre
    bearing_rad: FloatArray  # (n, most_blobs) in the body's frame, (-pi, pi], 0 ahead, positive to the left
    colour: FloatArray  # (n, most_blobs) 0xRRGGBB

    @property
    def count(self) -> IntArray:
        """How many blobs each robot sees, (n,)."""
        return np.count_nonzero(np.isfinite(self.distance_m), axis=1)
