"""Conversions between the numbers in the e-puck2's sensor packet and the readings of a body's sensors.

A function `to_…` is the inverse of a reading; it rounds to integers and clips. All work on arrays of any shape. The
magnetometer becomes a compass, the step counters lose their wrap, and `Epuck2Readings` reads a complete packet.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from swarmwire.comms.base.angles import wrap_angles
from swarmwire.comms.base.arrays import AnyArray, FloatArray
from swarmwire.comms.protocols.epuck2.packets import M_PER_STEP, MAX_STEPS_PER_S
from swarmwire.comms.robot.bodies.body import Body
from swarmwire.comms.robot.sensors.scan import ScanSpec
from swarmwire.comms.robot.sensors.simple import BatterySpec

PROXIMITY_FULL = 4095  # 12 bits
AMBIENT_DARK = 4000  # reading of ambient light in the dark
GROUND_BLACK, GROUND_WHITE = 0, 1000  # readings of uncalibrated ground sensors
SEES_NOTHING_MM = 8190  # reading of the time-of-flight sensor with nothing in range
DISTANCE_AHEAD_M = 0.035  # position of the time-of-flight sensor ahead of the body's centre
PER_G = 800  # accelerometer
PER_MPS2 = PER_G / 9.80665
MAX_ACCELERATION = 1536  # reading of the accelerometer at its limit of 2 g
PER_RADPS = 32768 / np.deg2rad(250.0)  # gyro
PER_V = 4096 * 0.6 / 3.0  # battery: 12 bits of 3 V, behind a divider
CHIPS = ("mpu9250", "icm20948")  # magnetometers; robots from about 2025 on have the second
_WRAP = 1 << 16  # number of values of a step counter
_SLACK_STEPS = 200  # margin for errors of the measured time, and for wheels that are pushed

Fields = dict[str, FloatArray]  # "sensor.field" -> (1,) or (1, width)


def proximity(raw: AnyArray) -> FloatArray:
    """Convert to the value of the spec's response curve, 0 to 1."""
    return np.minimum(raw / PROXIMITY_FULL, 1.0)


def to_proximity(value: FloatArray) -> AnyArray:
    """Invert `proximity`."""
    return _clipped(value * PROXIMITY_FULL, 0, PROXIMITY_FULL)


def light(raw: AnyArray) -> FloatArray:
    """Convert to brightness, 0 dark to 1."""
    return np.clip(1.0 - raw / AMBIENT_DARK, 0.0, 1.0)


def to_light(value: FloatArray) -> AnyArray:
    """Invert `light`."""
    return _clipped(AMBIENT_DARK * (1.0 - value), 0, AMBIENT_DARK)


def shade(raw: AnyArray, black: float, white: float) -> FloatArray:
    """Convert to the floor's shade, 0 black to 1 white, for sensors that read `black` and `white` over such floors."""
    return np.clip((raw - black) / (white - black), 0.0, 1.0)


def to_shade(value: FloatArray) -> AnyArray:
    """Invert `shade` of uncalibrated sensors."""
    return _clipped(GROUND_BLACK + value * (GROUND_WHITE - GROUND_BLACK), GROUND_BLACK, GROUND_WHITE)


def distance_m(raw: AnyArray, spec: ScanSpec) -> FloatArray:
    """Convert to the distance from the scanner of the spec; inf beyond its range."""
    range_m = raw / 1000.0 + (DISTANCE_AHEAD_M - spec.at_m)
    return np.where(range_m > spec.range_m, np.inf, np.maximum(range_m, spec.range_min_m))


def to_distance(range_m: FloatArray, spec: ScanSpec) -> AnyArray:
    """Invert `distance_m`; inf becomes the reading of a sensor that sees nothing."""
    seen_m = np.minimum(range_m, 0.001 * SEES_NOTHING_MM) - (DISTANCE_AHEAD_M - spec.at_m)
    return np.where(np.isinf(range_m), SEES_NOTHING_MM, _clipped(1000.0 * seen_m, 0, SEES_NOTHING_MM))


def to_acceleration(value_mps2: FloatArray) -> AnyArray:
    """Convert to the accelerometer's number, which is at most 2 g."""
    return _clipped(value_mps2 * PER_MPS2, -MAX_ACCELERATION, MAX_ACCELERATION)


def to_turn(value_radps: FloatArray) -> AnyArray:
    """Convert to the gyro's number, which is at most 250 degrees/s."""
    return _clipped(value_radps * PER_RADPS, -32768, 32767)


def to_voltage(value_v: FloatArray) -> AnyArray:
    """Convert to the battery's number."""
    return _clipped(value_v * PER_V, 0, 4095)


def charge(voltage_v: FloatArray, spec: BatterySpec) -> FloatArray:
    """Return the charge of a battery with this voltage, which falls linearly with the charge."""
    return np.clip((voltage_v - spec.empty_v) / max(spec.full_v - spec.empty_v, 1e-9), 0.0, 1.0)


def _clipped(value: FloatArray, low: float, high: float) -> AnyArray:
    """Round values to integers and clip them."""
    return np.clip(np.rint(value), low, high)


@dataclass(frozen=True, slots=True)
class Compass:
    """A robot's magnetometer, and the direction of magnetic north in its arena.

    The axes depend on the chip. The x of the chip's accelerometer is to the left, its y to the back (e_lsm330.c); the
    firmware reverses y in the packet (mpu9250.c, e_acc.c). The older magnetometer has x and y swapped, as the
    firmware's compass confirms (main.c, selector 14: the LED to the north is lit). The newer magnetometer has the x of
    the accelerometer, and the opposite y (data sheets).
    """

    chip: str
    north_rad: float  # heading of magnetic north in the arena, counter-clockwise from its +x
    offset_x_ut: float = 0.0  # reading without a magnetic field (hard iron)
    offset_y_ut: float = 0.0

    def heading_rad(self, field_ut: AnyArray) -> FloatArray:
        """Return the robot's heading (n,) in the arena, in (-pi, pi], from readings of its magnetometer (n, 3)."""
        with np.errstate(invalid="ignore"):  # a nan may be a signalling one
            field = field_ut.astype(np.float64)  # float32 on the wire
        x, y = field[..., 0] - self.offset_x_ut, field[..., 1] - self.offset_y_ut
        ahead, left = (-x, y) if self.chip == CHIPS[0] else (y, x)
        return wrap_angles(self.north_rad - np.arctan2(left, ahead))

    def field_ut(self, heading_rad: FloatArray, level_ut: float, down_ut: float) -> FloatArray:
        """Return the magnetometer's readings (n, 3) at headings (n,) in a field of this level and downward part."""
        north = self.north_rad - heading_rad
        ahead, left = level_ut * np.cos(north), level_ut * np.sin(north)
        x, y = (-ahead, left) if self.chip == CHIPS[0] else (left, ahead)
        return np.stack([x + self.offset_x_ut, y + self.offset_y_ut, np.full_like(x, down_ut)], axis=-1)


class Odometer:
    """Steps of both wheels since the first reading, without the counters' wrap.

    Readings must come before a counter has gone half its range, which takes half a minute at full speed.
    """

    def __init__(self) -> None:
        self.left, self.right = 0, 0
        self._before: tuple[int, int] | None = None

    def update(self, left: int, right: int) -> None:
        """Add the steps up to these values of the counters."""
        more_left, more_right = self._since(left, right)
        self.left, self.right = self.left + more_left, self.right + more_right
        self._before = left, right

    def resume(self, left: int, right: int, elapsed_s: float) -> bool:
        """Continue after a lost connection; False if the counters were reset, and nothing is added.

        A robot that was switched off and on counts from 0 again: more steps than are possible in `elapsed_s` mean a
        reset.
        """
        max_steps = MAX_STEPS_PER_S * elapsed_s + _SLACK_STEPS
        continues = max_steps < _WRAP // 2 and max(map(abs, self._since(left, right))) <= max_steps
        if not continues:
            self._before = left, right
        self.update(left, right)
        return continues

    def _since(self, left: int, right: int) -> tuple[int, int]:
        before = self._before or (left, right)
        return _signed(left - before[0]), _signed(right - before[1])


def _signed(steps: int) -> int:
    """Return the steps between two readings, the shorter way round."""
    return (steps + _WRAP // 2) % _WRAP - _WRAP // 2


@dataclass(frozen=True, slots=True)
class Calibration:
    """Calibration of a robot's sensors."""

    compass: Compass
    turn_offset_radps: float = 0.0
    ground_black: float = GROUND_BLACK
    ground_white: float = GROUND_WHITE


class Epuck2Readings:
    """Readings of a robot's sensors, from its packets and its odometer."""

    def __init__(self, body: Body, calibration: Calibration, odometer: Odometer) -> None:
        self._body, self._calibration, self._odometer = body, calibration, odometer
        self._readers: dict[str, Callable[[AnyArray], Fields]] = {
            "proximity": lambda packet: {"proximity.value": proximity(packet["proximity"])},
            "light": lambda packet: {"light.value": light(packet["ambient"])},
            "ground": self._ground,
            "scan": self._scan,
            "odometry": self._odometry,
            "imu": self._imu,
            "compass": lambda packet: {
                "compass.heading_rad": calibration.compass.heading_rad(packet["magnetic_field"])
            },
            "battery": self._battery,
        }

    def read(self, packet: AnyArray, sensors: frozenset[str]) -> Fields:
        """Return the readings of these sensors in a packet, `SENSORS` (1,)."""
        fields: Fields = {}
        for name in sensors:
            fields |= self._readers[name](packet)
        return fields

    def _ground(self, packet: AnyArray) -> Fields:
        calibration = self._calibration
        return {"ground.shade": shade(packet["ground"], calibration.ground_black, calibration.ground_white)}

    def _scan(self, packet: AnyArray) -> Fields:
        spec = self._body.scan
        assert spec is not None
        return {"scan.range_m": distance_m(packet["distance_mm"], spec)[:, None]}

    def _odometry(self, packet: AnyArray) -> Fields:
        steps = self._odometer.left, self._odometer.right
        left_m, right_m = (np.array([M_PER_STEP * wheel]) for wheel in steps)
        return {"odometry.left_m": left_m, "odometry.right_m": right_m}

    def _imu(self, packet: AnyArray) -> Fields:
        # The accelerometer's first axis is to the left and its second ahead; GCtronic's driver swaps them, too.
        acceleration, turn = packet["acceleration"] / PER_MPS2, packet["gyro"][:, 2] / PER_RADPS
        return {
            "imu.forward_mps2": acceleration[:, 1].copy(),
            "imu.left_mps2": acceleration[:, 0].copy(),
            "imu.turn_radps": turn - self._calibration.turn_offset_radps,
        }

    def _battery(self, packet: AnyArray) -> Fields:
        spec = self._body.battery
        assert spec is not None
        voltage_v = packet["battery"] / PER_V
        return {"battery.charge": charge(voltage_v, spec), "battery.voltage_v": voltage_v}
