"""The reading of the laser scanner."""

from dataclasses import dataclass

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.bodies.sensors import Scan


@dataclass(frozen=True)
class ScanReading:
    """The rays of the scanner."""

    range_m: FloatArray  # (…, rays) from the scanner; inf where nothing is within its range
    sheet: Scan

    @property
    def angle_rad(self) -> FloatArray:
        """Where the rays look in the body's frame, (rays,)."""
        return self.sheet.angle_rad
