"""Readings of the laser scanner."""

from dataclasses import dataclass

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.sheets import Scan


@dataclass(frozen=True)
class _Scanned:
    range_m: FloatArray  # (…, rays) from the scanner; inf where nothing is within its range
    sheet: Scan

    @property
    def angle_rad(self) -> FloatArray:
        """Where the rays look in the body's frame, (rays,)."""
        return self.sheet.angle_rad


class ScanReading(_Scanned):
    """One robot's rays, (rays,)."""


class ScanReadings(_Scanned):
    """The rays of n robots, (n, rays)."""
