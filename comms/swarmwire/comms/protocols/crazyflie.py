"""Sensors and log variables of the Crazyflie, in their units, for its driver and its gateway.

Ranges are in mm, angles in degrees, accelerations in g. Facts are from Bitcraze's crazyflie-firmware
(docs/functional-areas/crtp, src/modules) and crazyflie-lib-python (cflib); no code of either is used here.
"""

from math import atan2, cos, sin

import numpy as np

from swarmwire.comms.base.angles import wrap_angles
from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.robot.bodies.body import Body
from swarmwire.comms.robot.bodies.drives import Holonomic

# Sensors of a body that the log variables report; the positioned sensors need the frame of a positioning system.
LOGGED_SENSORS = frozenset({"scan", "proximity", "flow", "imu", "battery"})
POSITIONED_SENSORS = frozenset({"positioning", "compass"})
DIRECTIONS_DEG = {"front": 0.0, "left": 90.0, "back": 180.0, "right": -90.0}  # level sensors of the multi-ranger
NO_RANGE_MM = 32767  # multiranger.c: nothing in range, or no good measurement
G_MPS2 = 9.81
MAX_OFF_RAD = 0.1  # largest error of a ray's direction
LOCKED_BIT, ARMED_BIT, CAN_FLY_BIT, FLYING_BIT, CRASHED_BIT = 6, 1, 3, 4, 7  # bits of the log variable supervisor.info
LOW_POWER = 3  # value of the log variable pm.state for a battery that is nearly empty
SOLID_COLOUR = 7  # effect of the LED ring


def check_fits(body: Body) -> None:
    """Raise BadInput unless the body flies, holds its position by flow or positioning, and has a Crazyflie's decks."""
    _check(body, "drive.kind", isinstance(body.drive, Holonomic), "holonomic")
    _check(body, "altitude_m", body.altitude_m > 0.0, "a height at which it hovers")
    _check(body, "sensors", bool({"flow", "positioning"} & body.sensors.keys()), "flow or positioning")
    for name, spec in (("scan", body.scan), ("proximity", body.proximity)):
        if spec is not None:
            directions = np.deg2rad(list(DIRECTIONS_DEG.values()))
            fits = len(spec.angle_rad) == 4 and bool(
                np.all(np.abs(wrap_angles(spec.angle_rad - directions)) < MAX_OFF_RAD)
            )
            _check(body, f"sensors.{name}", fits, "4 rays: ahead, left, behind, right")
    _check(body, "leds", body.led_count <= 1, "at most one LED: the ring shows one colour")


def _check(body: Body, key: str, fits: bool, expected: str) -> None:
    if not fits:
        raise BadInput(f"body {body.name}", key, f"expected {expected}, as a Crazyflie has")


def to_mm(range_m: FloatArray) -> list[int]:
    """Convert ranges (rays,) to the numbers that the multi-ranger logs.

    >>> to_mm(np.array([0.1234, np.inf]))
    [123, 32767]
    """
    return [round(1000.0 * m) if np.isfinite(m) else NO_RANGE_MM for m in range_m.tolist()]


def from_mm(range_mm: list[float], range_m: float) -> FloatArray:
    """Convert logged ranges to m, (rays,); inf beyond `range_m`."""
    metres = np.array(range_mm) / 1000.0
    return np.where(metres > range_m, np.inf, metres)


def turned(x: float, y: float, by_rad: float) -> tuple[float, float]:
    """Turn a vector counter-clockwise."""
    return x * cos(by_rad) - y * sin(by_rad), x * sin(by_rad) + y * cos(by_rad)


def yaw_of(quaternion: tuple[float, float, float, float]) -> float:
    """Return the yaw of an attitude (x, y, z, w).

    >>> round(yaw_of((0.0, 0.0, 0.70710678, 0.70710678)), 4)
    1.5708
    """
    x, y, z, w = quaternion
    return atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
