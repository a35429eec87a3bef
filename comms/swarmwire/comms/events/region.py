"""Region: a disc or a rectangle of the arena."""

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.arrays import BoolArray, FloatArray
from swarmwire.comms.errors import BadInput
from swarmwire.comms.parameters import parameter


@dataclass(frozen=True)
class Region:
    """{ at, radius_m } is a disc, { at, size_m } a rectangle; the edge belongs to it."""

    at: tuple[float, float] = parameter((0.0, 0.0), help="its centre, in the arena's frame", unit="m")
    radius_m: float | None = parameter(None, help="radius of the disc", unit="m", above=0, at_most=10_000)
    size_m: tuple[float, float] | None = parameter(None, help="full extents of the rectangle along x and y", unit="m")

    def check(self) -> None:
        """Raise BadInput, with a key within this table, unless it is just one of the two."""
        if (self.radius_m is None) == (self.size_m is None):
            raise BadInput("", "", "expected either radius_m or size_m")
        if self.size_m is not None and min(self.size_m) <= 0.0:
            raise BadInput("", "size_m", f"expected two numbers above 0 (m), got {list(self.size_m)}")

    def holds(self, pose: FloatArray) -> BoolArray:
        """Which robots that stand at `pose` (rows, 3) have their centre in it, (rows,)."""
        from_centre_m = pose[:, :2] - self.at
        if self.radius_m is not None:
            return np.hypot(from_centre_m[:, 0], from_centre_m[:, 1]) <= self.radius_m
        inside = np.abs(from_centre_m) <= 0.5 * np.array(self.size_m)
        return inside[:, 0] & inside[:, 1]
