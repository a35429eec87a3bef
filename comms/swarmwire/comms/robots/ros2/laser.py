"""LaserScan messages: what they say, whatever the scanner, and those that an emulated one sends."""

from typing import Any, NamedTuple

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.errors import BadFrame
from swarmwire.comms.robots.ros2.kinds import LASER_SCAN
from swarmwire.comms.robots.ros2.messages import Messages
from swarmwire.comms.sheets import Scan

MOST_RAYS = 100_000
FRAME = "base_scan"


class Geometry(NamedTuple):
    """How the rays of a scanner lie, in its own frame."""

    first_rad: float
    step_rad: float  # negative: clockwise
    rays: int


def geometry_of(message: Any) -> Geometry:
    """How the rays of a message lie; BadFrame if they cannot.

    `angle_max` is not looked at: scanners disagree on whether it is the last ray's or the one after it.
    """
    first_rad, step_rad, rays = float(message.angle_min), float(message.angle_increment), len(message.ranges)
    if not (np.isfinite(first_rad) and np.isfinite(step_rad)) or not 1 <= rays <= MOST_RAYS:
        raise BadFrame("malformed", f"{rays} rays from {first_rad!r} rad in steps of {step_rad!r} rad")
    return Geometry(first_rad, step_rad, rays)


def angles_rad(geometry: Geometry, scanner_rad: float) -> FloatArray:
    """Where the rays look in the frame of a body on which the scanner's angle 0 looks to `scanner_rad`, (rays,)."""
    return scanner_rad + geometry.first_rad + geometry.step_rad * np.arange(geometry.rays, dtype=np.float64)


def returns_m(message: Any) -> FloatArray:
    """The distance of the return on each ray, (rays,); inf: none.

    Nearer than the scanner's `range_min` it is `range_min`, as -inf is (REP 117): something is there. Beyond
    `range_max`, 0 (which TurtleBot3's scanner tells for no return) and nan are none.
    """
    with np.errstate(invalid="ignore"):  # a nan may be a signalling one
        range_m = np.asarray(message.ranges, np.float64)
    near = (range_m < message.range_min) & (range_m != 0.0)
    none = (range_m > message.range_max) | (range_m == 0.0) | np.isnan(range_m)
    return np.where(none, np.inf, np.where(near, float(message.range_min), range_m))


def laser_scan(messages: Messages, sheet: Scan, range_m: FloatArray, stamp_ns: int) -> Any:
    """The message of a reading (rays,) of the sheet's scanner, all of whose rays were taken at once."""
    first_rad = float(np.deg2rad(sheet.first_deg))
    return messages.make(
        LASER_SCAN,
        messages.header(stamp_ns, FRAME),
        first_rad,
        first_rad + (sheet.rays - 1) * sheet.step_rad,
        sheet.step_rad,
        0.0,
        1.0 / sheet.rate_hz if sheet.rate_hz else 0.0,
        sheet.range_min_m,
        sheet.range_m,
        range_m.astype(np.float32),
        np.empty(0, np.float32),
    )
