"""LaserScan messages as the readings of proximity sensors at the body's rim.

A return at range r on a ray at angle b, from a scanner that stands `at_m` ahead of the centre of a body of radius R, is

    d = max(r - s(b), 0),    s(b) = sqrt(R^2 - at_m^2 sin(b)^2) - at_m cos(b)

away from the rim, where s(b) is the way from the scanner to the rim along that ray. It belongs to the sensor whose
angle is nearest to b, which is thus within half the angle between two sensors, and must be within 45 degrees. Each
sensor answers to its nearest d as its sheet's response says, or 0 beyond the sheet's range.
"""

from typing import Any

import numpy as np

from swarmwire.comms.arrays import FloatArray, IntArray
from swarmwire.comms.robots.ros2.laser import Geometry, angles_rad, geometry_of, returns_m
from swarmwire.comms.robots.ros2.nearest_angle import nearest_angle
from swarmwire.comms.sheets import Proximity

WIDEST_RAD = np.pi / 4.0  # to either side: further off, a thing is beside a sensor and not before it


class LaserAsProximity:
    """Gives each sensor of the sheet the nearest return before it, measured from the rim."""

    def __init__(self, sheet: Proximity, radius_m: float, at_m: float, scanner_rad: float) -> None:
        """`scanner_rad` is where the scanner's angle 0 looks in the body's frame."""
        self._sheet, self._radius_m, self._at_m, self._scanner_rad = sheet, radius_m, at_m, scanner_rad
        self._geometry: Geometry | None = None
        self._rays: IntArray = np.empty(0, np.int64)  # those before a sensor, sensor by sensor
        self._sensor: IntArray = np.empty(0, np.int64)  # of each of these
        self._to_rim_m: FloatArray = np.empty(0)

    def value(self, message: Any) -> FloatArray:
        """The sensors' answers (sensors,), 0 to 1; BadFrame if the message's rays cannot lie as it says."""
        geometry = geometry_of(message)
        if geometry != self._geometry:
            self._fit(geometry)
        nearest_m = np.full(len(self._sheet.angle_rad), np.inf)
        from_rim_m = np.maximum(returns_m(message)[self._rays] - self._to_rim_m, 0.0)
        np.minimum.at(nearest_m, self._sensor, from_rim_m)
        reach_m = self._sheet.range_m
        return np.where(nearest_m <= reach_m, self._sheet.response.value(np.minimum(nearest_m, reach_m)), 0.0)

    def _fit(self, geometry: Geometry) -> None:
        angle_rad = angles_rad(geometry, self._scanner_rad)
        sensor, apart_rad = nearest_angle(angle_rad, self._sheet.angle_rad)
        self._rays = np.flatnonzero(apart_rad <= WIDEST_RAD)
        self._sensor, angle_rad = sensor[self._rays], angle_rad[self._rays]
        across_m = self._at_m * np.sin(angle_rad)
        self._to_rim_m = np.sqrt(self._radius_m**2 - across_m**2) - self._at_m * np.cos(angle_rad)
        self._geometry = geometry
