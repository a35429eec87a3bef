"""Commands and sensor packets of a group of emulated e-puck2s.

`ReceivedCommands` stores the commands of programs for the loop. `SensorPackets` encodes the readings of a group as its
robots' answers.
"""

from collections import Counter
from collections.abc import Callable, Mapping
from threading import Lock

import numpy as np

from swarmwire.comms.base.arrays import AnyArray, FloatArray, IntArray
from swarmwire.comms.protocols.epuck2 import readings
from swarmwire.comms.protocols.epuck2.packets import (
    BODY_LED,
    COUNT,
    FRONT_LED,
    MAX_STEPS_PER_S,
    SENSORS,
    SWITCHED,
    PacketRequest,
    RobotCommand,
    RobotSettingsBits,
    body_speeds,
    limited,
)
from swarmwire.comms.protocols.epuck2.readings import Compass
from swarmwire.comms.robot.bodies.body import Body
from swarmwire.comms.robot.tick_io import SparseTable
from swarmwire.world.gateways.gateway import ForeignCommands

Fields = dict[str, FloatArray]  # "sensor.field" -> (n,) or (n, width)

WIFI_SELECTOR = 15  # selector position for answers over WiFi
ROOM_C = 25
QUIET = 30  # volume of a quiet room, of 4095; the robots' own sounds are not emulated
LEVEL_UT, DOWN_UT = 22.0, 42.0  # the earth's field in central Europe
UPRIGHT_DEG, OVER_DEG = 5.0, 160.0  # the firmware reports no orientation for a smaller or greater tilt


class ReceivedCommands:
    """The newest speeds of each robot, its LEDs, and its step counters; any thread may add commands.

    Attributes:
        steps_per_s: (n, 2) speeds of the left and the right wheel at the last `pop`.
        watched: robots whose last command requests the image.
    """

    def __init__(self, robots: int, body: Body, counts: Counter[str]) -> None:
        self._robots, self._wheel_base_m, self._counts = robots, body.wheels.wheel_base_m, counts
        self._lock = Lock()
        self.steps_per_s = np.zeros((robots, 2))
        self.watched: frozenset[int] = frozenset()
        self._speeds: dict[int, tuple[int, int]] = {}  # steps/s
        self._refused: set[tuple[int, str]] = set()  # robot and name of a refused request
        self._leds: dict[tuple[int, int], int] = {}  # robot and LED -> 0xRRGGBB
        self._counters: dict[int, tuple[int, int]] = {}
        self._shown = [dict.fromkeys(range(body.led_count), 0) for _ in range(robots)]

    def add(self, robot: int, command: RobotCommand) -> None:
        """Store a command for a robot."""
        with self._lock:
            refused = {(robot, name) for name in _refused(command, len(self._shown[robot]))}
            self._counts.update(name for _, name in refused - self._refused)
            self._refused |= refused
            others = self.watched - {robot}
            self.watched = others | {robot} if command.request & PacketRequest.IMAGE else others
            if command.settings & RobotSettingsBits.SET_STEPS:
                self._counters[robot] = command.left, command.right
            else:
                if max(abs(command.left), abs(command.right)) > MAX_STEPS_PER_S:
                    self._counts["speeds_clipped"] += 1
                self._speeds[robot] = limited(command.left), limited(command.right)
            before = self._shown[robot]
            if before:
                shown = command.lights.shown(before)
                self._leds.update({(robot, led): rgb for led, rgb in shown.items() if rgb != before[led]})
                self._shown[robot] = shown

    def halt(self, robot: int) -> None:
        """Stop a robot that was switched on, and switch its LEDs off."""
        self.add(robot, RobotCommand())

    def pop_counters(self) -> dict[int, tuple[int, int]]:
        """Remove and return new values of the step counters, by robot."""
        with self._lock:
            counters, self._counters = self._counters, {}
        return counters

    def pop(self) -> ForeignCommands:
        """Remove and return the commands."""
        with self._lock:
            speeds, self._speeds = self._speeds, {}
            leds, self._leds = self._leds, {}
        drive, linear_mps, angular_radps = np.zeros(self._robots, bool), *np.zeros((2, self._robots))
        for robot, steps in speeds.items():
            self.steps_per_s[robot], drive[robot] = steps, True
            linear_mps[robot], angular_radps[robot] = body_speeds(*steps, self._wheel_base_m)
        rows, led, rgb = np.array([(*key, rgb) for key, rgb in leds.items()], np.int64).reshape(-1, 3).T.copy()
        lateral_mps = np.zeros(self._robots)
        return ForeignCommands(drive, linear_mps, angular_radps, lateral_mps, SparseTable(rows, led, rgb.astype(float)))


def _refused(command: RobotCommand, leds: int) -> list[str]:
    """Return the names of a command's requests that emulated robots refuse; its other requests apply.

    Constant readings count as refused with the first request for the sensors.
    """
    requests = {
        "avoidance_refused": command.settings & RobotSettingsBits.AVOID,
        "calibration_refused": command.settings & RobotSettingsBits.CALIBRATE,
        "sound_refused": command.sound,
        "body_led_refused": leds < COUNT and command.lights.switched & SWITCHED[BODY_LED][0],
        "front_led_refused": leds < COUNT and command.lights.switched & SWITCHED[FRONT_LED][0],
        "constant_readings": command.request & PacketRequest.SENSORS,
    }
    return [name for name, value in requests.items() if value]


class SensorPackets:
    """The present answer of each robot of a group. A lost reading (nan) leaves the number unchanged.

    The step counters count commanded steps, so they continue at a wall.
    """

    def __init__(self, body: Body, robots: int, compass: Compass) -> None:
        self._body, self._compass = body, compass
        self._rows = np.zeros(robots, SENSORS)
        self._steps = np.zeros((robots, 2))  # steps of the left and the right motor, unwrapped
        self._to_wire: dict[str, tuple[str, Callable[[FloatArray], AnyArray]]] = {
            "proximity.value": ("proximity", readings.to_proximity),
            "light.value": ("ambient", readings.to_light),
            "ground.shade": ("ground", readings.to_shade),
            "scan.range_m": ("distance_mm", self._distance),
            "battery.voltage_v": ("battery", readings.to_voltage),
            "compass.heading_rad": ("magnetic_field", self._field_ut),
        }
        self._reset()

    def fill(self, fields: Fields) -> None:
        """Store readings; a body need not have all of them."""
        for name, values in fields.items():
            if name in self._to_wire:
                field, to_wire = self._to_wire[name]
                self._set(field, to_wire(values))
        if "imu.turn_radps" in fields:
            self._set_imu(fields)

    def count(self, steps: FloatArray, counters: Mapping[int, tuple[int, int]]) -> None:
        """Add these steps (n, 2) to the counters; `counters` sets them for some robots."""
        self._steps += steps
        for robot, counter in counters.items():
            self._steps[robot] = counter
        self._rows["steps"] = _wrapped(np.rint(self._steps).astype(np.int64))

    def answers(self) -> list[bytes]:
        """Return the sensors' packet of each robot."""
        data, size = self._rows.tobytes(), SENSORS.itemsize
        return [data[start : start + size] for start in range(0, len(data), size)]

    def _reset(self) -> None:
        """Set the readings of a robot without sensors, or that was just switched on."""
        rows = self._rows
        rows["acceleration"][:, 2] = rows["acceleration_size"] = readings.PER_G
        rows["ambient"], rows["distance_mm"] = readings.AMBIENT_DARK, readings.SEES_NOTHING_MM
        rows["temperature_c"], rows["microphones"], rows["selector"] = ROOM_C, QUIET, WIFI_SELECTOR
        rows["battery"] = round(4.2 * readings.PER_V)

    def _set(self, name: str, value: AnyArray) -> None:
        self._rows[name] = np.where(np.isnan(value), self._rows[name], value)

    def _distance(self, range_m: FloatArray) -> AnyArray:
        spec = self._body.scan
        assert spec is not None
        return readings.to_distance(range_m[:, 0], spec)

    def _field_ut(self, heading_rad: FloatArray) -> FloatArray:
        return self._compass.field_ut(heading_rad, LEVEL_UT, DOWN_UT)

    def _set_imu(self, fields: Fields) -> None:
        """Set the accelerometer, the values that the firmware derives from it, and the gyro."""
        forward, left = fields["imu.forward_mps2"], fields["imu.left_mps2"]
        level = readings.to_acceleration(np.stack([left, forward], axis=1))
        acceleration = np.concatenate([level, self._rows["acceleration"][:, 2:]], axis=1)
        self._set("acceleration", acceleration)
        x, y, z = self._rows["acceleration"].astype(np.float64).T
        inclination = 90.0 - np.degrees(np.arctan2(z, np.hypot(x, y)))
        leans = (inclination >= UPRIGHT_DEG) & (inclination <= OVER_DEG)
        self._rows["acceleration_size"] = np.sqrt(x * x + y * y + z * z)
        self._rows["inclination_deg"] = inclination
        self._rows["orientation_deg"] = np.where(leans, np.degrees(np.arctan2(x, y)) + 180.0, 0.0)
        turn = readings.to_turn(fields["imu.turn_radps"])
        self._set("gyro", np.stack([np.zeros_like(turn), np.zeros_like(turn), turn], axis=1))


def _wrapped(steps: IntArray) -> IntArray:
    return (steps + 0x8000) % 0x10000 - 0x8000
