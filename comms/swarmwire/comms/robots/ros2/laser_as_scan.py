"""LaserScan messages of any scanner as the readings of the sheet's scanner."""

from typing import Any

import numpy as np

from swarmwire.comms.arrays import FloatArray, IntArray
from swarmwire.comms.robots.ros2.laser import Geometry, angles_rad, geometry_of, returns_m
from swarmwire.comms.robots.ros2.nearest_angle import nearest_angle
from swarmwire.comms.sheets import Scan

SLACK = 1.001  # of half the angle between two rays: angles come as float32


class LaserAsScan:
    """Gives each ray of the sheet the return on the message's ray of the nearest angle.

    Where that one is further away than half the angle between two rays (of the coarser of both), the scanner does not
    look there, and the ray meets nothing.
    """

    def __init__(self, sheet: Scan, scanner_rad: float) -> None:
        """`scanner_rad` is where the scanner's angle 0 looks in the body's frame."""
        self._sheet, self._scanner_rad = sheet, scanner_rad
        self._geometry: Geometry | None = None
        self._ray: IntArray = np.empty(0, np.int64)
        self._unseen = np.empty(0, np.bool_)

    def range_m(self, message: Any) -> FloatArray:
        """The reading (rays,), from the sheet's `range_min_m` to its range, inf where nothing is within it.

        BadFrame if the message's rays cannot lie as it says.
        """
        geometry = geometry_of(message)
        if geometry != self._geometry:
            self._fit(geometry)
        range_m = returns_m(message)[self._ray]
        range_m[self._unseen | (range_m > np.float32(self._sheet.range_m))] = np.inf
        return np.maximum(range_m, self._sheet.range_min_m)

    def _fit(self, geometry: Geometry) -> None:
        self._ray, apart_rad = nearest_angle(self._sheet.angle_rad, angles_rad(geometry, self._scanner_rad))
        self._unseen = apart_rad > SLACK * 0.5 * max(self._sheet.step_rad, abs(geometry.step_rad))
        self._geometry = geometry
