"""LaserScan messages: decoding for any scanner, encoding for an emulated one, and readings of a body's sensors.

`LaserAsProximity` turns a scan into readings of proximity sensors at the body's rim, `LaserAsScan` into readings of the
scanner in the body's spec.
"""

from typing import Any, NamedTuple

import numpy as np

from swarmwire.comms.base.arrays import FloatArray, IntArray
from swarmwire.comms.base.errors import BadFrame
from swarmwire.comms.protocols.ros2.keys import LASER_SCAN
from swarmwire.comms.protocols.ros2.messages import Messages
from swarmwire.comms.robot.bodies.ros2_names import Ros2Names
from swarmwire.comms.robot.sensors.rays import ProximitySpec
from swarmwire.comms.robot.sensors.scan import ScanSpec

TURN_RAD = 2.0 * np.pi
MAX_RAYS = 100_000
WIDEST_RAD = np.pi / 4.0  # largest angle between a return and the direction of its sensor
SLACK = 1.001  # factor on half the angle between two rays, since angles are float32 in messages


def nearest_angle(angle_rad: FloatArray, candidates_rad: FloatArray) -> tuple[IntArray, FloatArray]:
    """Return for each angle (n,) the index of the nearest candidate (m,) on the circle, and the distance."""
    candidates = np.mod(candidates_rad, TURN_RAD)
    order = np.argsort(candidates, kind="stable")
    first, last = order[:1], order[-1:]
    circle = np.concatenate([candidates[last] - TURN_RAD, candidates[order], candidates[first] + TURN_RAD])
    angle = np.mod(angle_rad, TURN_RAD)
    after = np.clip(np.searchsorted(circle, angle), 1, len(circle) - 1)
    before_rad, after_rad = angle - circle[after - 1], circle[after] - angle
    nearest = np.where(before_rad <= after_rad, after - 2, after - 1) % len(order)
    return order[nearest].astype(np.int64), np.minimum(before_rad, after_rad)


class Geometry(NamedTuple):
    """Directions of a scanner's rays in its own frame."""

    first_rad: float
    step_rad: float  # negative: clockwise
    rays: int


def geometry_of(message: Any) -> Geometry:
    """Return the directions of the rays of a message; BadFrame if they are invalid.

    `angle_max` is ignored: scanners disagree whether it belongs to the last ray or to the ray after it.
    """
    first_rad, step_rad, rays = float(message.angle_min), float(message.angle_increment), len(message.ranges)
    if not (np.isfinite(first_rad) and np.isfinite(step_rad)) or not 1 <= rays <= MAX_RAYS:
        raise BadFrame("malformed", f"{rays} rays from {first_rad!r} rad in steps of {step_rad!r} rad")
    return Geometry(first_rad, step_rad, rays)


def angles_rad(geometry: Geometry, scanner_rad: float) -> FloatArray:
    """Return the rays' directions (rays,) in a body's frame, where the scanner's angle 0 is `scanner_rad`."""
    return scanner_rad + geometry.first_rad + geometry.step_rad * np.arange(geometry.rays, dtype=np.float64)


def returns_m(message: Any) -> FloatArray:
    """Return the distance of the return on each ray, (rays,); inf: no return.

    A return nearer than the scanner's `range_min` has the distance `range_min`; so has -inf (REP 117). Readings beyond
    `range_max`, 0 (TurtleBot3's scanner's reading for no return) and nan are no return.
    """
    with np.errstate(invalid="ignore"):  # a nan may be a signalling one
        range_m = np.asarray(message.ranges, np.float64)
    too_near = (range_m < message.range_min) & (range_m != 0.0)
    no_return = (range_m > message.range_max) | (range_m == 0.0) | np.isnan(range_m)
    return np.where(no_return, np.inf, np.where(too_near, float(message.range_min), range_m))


def laser_scan(messages: Messages, spec: ScanSpec, names: Ros2Names, range_m: FloatArray, stamp_ns: int) -> Any:
    """Return the message of a reading (rays,) of the spec's scanner, with all rays measured at once, in its frame."""
    first_rad = float(np.deg2rad(spec.first_deg - names.scan_frame_deg))
    return messages.make(
        LASER_SCAN,
        messages.header(stamp_ns, names.scan_frame),
        first_rad,
        first_rad + (spec.rays - 1) * spec.step_rad,
        spec.step_rad,
        0.0,
        1.0 / spec.rate_hz if spec.rate_hz else 0.0,
        spec.range_min_m,
        spec.range_m,
        range_m.astype(np.float32),
        np.empty(0, np.float32),
    )


class LaserAsProximity:
    """Readings of proximity sensors from a scan: each sensor responds to the nearest return in front of it.

    A return at range r on a ray at angle b, from a scanner `at_m` ahead of the centre of a body of radius R, has this
    distance from the rim:

        d = max(r - s(b), 0),    s(b) = sqrt(R^2 - at_m^2 sin(b)^2) - at_m cos(b)

    s(b) is the distance from the scanner to the rim along the ray. The return belongs to the sensor whose angle is
    nearest to b, if it is within 45 degrees. A sensor responds to its nearest d by the response curve of its spec, with
    0 beyond the spec's range.
    """

    def __init__(self, spec: ProximitySpec, radius_m: float, at_m: float, scanner_rad: float) -> None:
        """Set up the sensors; `scanner_rad` is the direction of the scanner's angle 0 in the body's frame."""
        self._spec, self._radius_m, self._at_m, self._scanner_rad = spec, radius_m, at_m, scanner_rad
        self._geometry: Geometry | None = None
        self._rays: IntArray = np.empty(0, np.int64)  # (k,) indices of the rays in front of a sensor
        self._sensor: IntArray = np.empty(0, np.int64)  # (k,) index of the sensor of each of these rays
        self._to_rim_m: FloatArray = np.empty(0)  # (k,) distance from the scanner to the rim on each of these rays

    def value(self, message: Any) -> FloatArray:
        """Return the sensors' responses (sensors,), 0 to 1; BadFrame if the message's rays are invalid."""
        geometry = geometry_of(message)
        if geometry != self._geometry:
            self._fit(geometry)
        nearest_m = np.full(len(self._spec.angle_rad), np.inf)
        from_rim_m = np.maximum(returns_m(message)[self._rays] - self._to_rim_m, 0.0)
        np.minimum.at(nearest_m, self._sensor, from_rim_m)
        reach_m = self._spec.range_m
        return np.where(nearest_m <= reach_m, self._spec.response.value(np.minimum(nearest_m, reach_m)), 0.0)

    def _fit(self, geometry: Geometry) -> None:
        angle_rad = angles_rad(geometry, self._scanner_rad)
        sensor, apart_rad = nearest_angle(angle_rad, self._spec.angle_rad)
        self._rays = np.flatnonzero(apart_rad <= WIDEST_RAD)
        self._sensor, angle_rad = sensor[self._rays], angle_rad[self._rays]
        across_m = self._at_m * np.sin(angle_rad)
        self._to_rim_m = np.sqrt(self._radius_m**2 - across_m**2) - self._at_m * np.cos(angle_rad)
        self._geometry = geometry


class LaserAsScan:
    """Readings of the spec's scanner from a scan of any scanner: each ray gets the return on the nearest ray.

    A ray has no return if the nearest ray is further away than half the angle between two rays of the coarser scanner:
    the other scanner does not look there.
    """

    def __init__(self, spec: ScanSpec, scanner_rad: float) -> None:
        """Set up the rays; `scanner_rad` is the direction of the scanner's angle 0 in the body's frame."""
        self._spec, self._scanner_rad = spec, scanner_rad
        self._geometry: Geometry | None = None
        self._ray: IntArray = np.empty(0, np.int64)
        self._unseen = np.empty(0, np.bool_)

    def range_m(self, message: Any) -> FloatArray:
        """Return the reading (rays,), from the spec's `range_min_m` to its range; inf: nothing within the range.

        BadFrame if the message's rays are invalid.
        """
        geometry = geometry_of(message)
        if geometry != self._geometry:
            self._fit(geometry)
        range_m = returns_m(message)[self._ray]
        range_m[self._unseen | (range_m > np.float32(self._spec.range_m))] = np.inf
        return np.maximum(range_m, self._spec.range_min_m)

    def _fit(self, geometry: Geometry) -> None:
        self._ray, apart_rad = nearest_angle(self._spec.angle_rad, angles_rad(geometry, self._scanner_rad))
        self._unseen = apart_rad > SLACK * 0.5 * max(self._spec.step_rad, abs(geometry.step_rad))
        self._geometry = geometry
