"""What the numbers of the e-puck2's sensors mean, and which numbers stand for what it senses.

Each function pair works on arrays of any shape; what goes to the robot's numbers is rounded to whole ones and clipped.
"""

import numpy as np

from swarmwire.comms.arrays import AnyArray, FloatArray
from swarmwire.comms.sheets import Battery, Scan

PROXIMITY_FULL = 4095  # 12 bits
AMBIENT_DARK = 4000  # what the proximity sensors tell of ambient light in the dark
GROUND_BLACK, GROUND_WHITE = 0, 1000  # of robots whose ground sensors nobody has measured
SEES_NOTHING_MM = 8190  # what the time-of-flight sensor tells then
DISTANCE_AHEAD_M = 0.035  # of the body's centre: where the time-of-flight sensor sits
PER_G = 800  # of the accelerometer
PER_MPS2 = PER_G / 9.80665
MOST_ACCELERATION = 1536  # 2 g, in the same numbers
PER_RADPS = 32768 / np.deg2rad(250.0)  # of the gyro
PER_V = 4096 * 0.6 / 3.0  # of the battery: 12 bits of 3 V, behind a divider


def proximity(raw: AnyArray) -> FloatArray:
    """What the sheet's response curve answers, 0 to 1."""
    return np.minimum(raw / PROXIMITY_FULL, 1.0)


def to_proximity(value: FloatArray) -> AnyArray:
    """The inverse of `proximity`."""
    return _whole(value * PROXIMITY_FULL, 0, PROXIMITY_FULL)


def light(raw: AnyArray) -> FloatArray:
    """Brightness, 0 dark to 1."""
    return np.clip(1.0 - raw / AMBIENT_DARK, 0.0, 1.0)


def to_light(value: FloatArray) -> AnyArray:
    """The inverse of `light`."""
    return _whole(AMBIENT_DARK * (1.0 - value), 0, AMBIENT_DARK)


def shade(raw: AnyArray, black: float, white: float) -> FloatArray:
    """The floor's shade, 0 black to 1 white, of sensors that tell `black` and `white` there."""
    return np.clip((raw - black) / (white - black), 0.0, 1.0)


def to_shade(value: FloatArray) -> AnyArray:
    """The inverse of `shade`, of sensors that nobody has measured."""
    return _whole(GROUND_BLACK + value * (GROUND_WHITE - GROUND_BLACK), GROUND_BLACK, GROUND_WHITE)


def distance_m(raw: AnyArray, sheet: Scan) -> FloatArray:
    """The distance from where the sheet has the scanner; inf beyond its range."""
    range_m = raw / 1000.0 + (DISTANCE_AHEAD_M - sheet.at_m)
    return np.where(range_m > sheet.range_m, np.inf, np.maximum(range_m, sheet.range_min_m))


def to_distance(range_m: FloatArray, sheet: Scan) -> AnyArray:
    """The inverse of `distance_m`; inf: what the sensor tells that sees nothing."""
    seen_m = np.minimum(range_m, 0.001 * SEES_NOTHING_MM) - (DISTANCE_AHEAD_M - sheet.at_m)
    return np.where(np.isinf(range_m), SEES_NOTHING_MM, _whole(1000.0 * seen_m, 0, SEES_NOTHING_MM))


def to_acceleration(value_mps2: FloatArray) -> AnyArray:
    """The accelerometer's number; it reads two g at most."""
    return _whole(value_mps2 * PER_MPS2, -MOST_ACCELERATION, MOST_ACCELERATION)


def to_turn(value_radps: FloatArray) -> AnyArray:
    """The gyro's number; it reads 250 degrees/s at most."""
    return _whole(value_radps * PER_RADPS, -32768, 32767)


def to_voltage(value_v: FloatArray) -> AnyArray:
    """The battery's number."""
    return _whole(value_v * PER_V, 0, 4095)


def charge(voltage_v: FloatArray, sheet: Battery) -> FloatArray:
    """The share that is left in a battery of this voltage, which falls evenly with it."""
    return np.clip((voltage_v - sheet.empty_v) / max(sheet.full_v - sheet.empty_v, 1e-9), 0.0, 1.0)


def _whole(value: FloatArray, low: float, high: float) -> AnyArray:
    return np.clip(np.rint(value), low, high)
