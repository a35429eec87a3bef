"""The packets of the e-puck2, little-endian: commands of 21 bytes, and answers in a byte stream.

The lights are, clockwise from ahead and in the order of the body's spec, LED1 (red), LED2 (any colour), LED3 (red) and
so on to LED8, then the front LED (red) and the body LED (green). LEDs of one colour are on or off. The firmware of the
radio module shows the state of the WiFi with LED2, even if a command sets it.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from enum import IntFlag
from math import pi
from struct import Struct
from typing import NamedTuple

import numpy as np

from swarmwire.comms.base.config import ExplainedEnum
from swarmwire.comms.base.errors import BadFrame, BadInput
from swarmwire.comms.robot.bodies.body import Body
from swarmwire.comms.robot.bodies.drives import Wheels, wheels_of_twist

PORT = 1000  # TCP port on the robot
COMMAND_BYTES = 21
COMMAND_HEADER = 0x80
STEPS_PER_TURN = 1000
M_PER_STEP = pi * 0.04 / STEPS_PER_TURN  # wheels of 40 mm
MAX_STEPS_PER_S = 1100  # the firmware's limit for a wheel
RING = 8  # number of LEDs in the ring, of which every other LED has any colour
RED, GREEN = 0xFF0000, 0x00FF00
FRONT_LED, BODY_LED = 8, 9  # indices in the body's spec
# Index of each LED of one colour: its bit in `Lights.switched`, and its colour.
SWITCHED = {0: (1, RED), 2: (2, RED), 4: (4, RED), 6: (8, RED), FRONT_LED: (32, RED), BODY_LED: (16, GREEN)}
COUNT = 10  # number of LEDs
BRIGHTEST = 100  # largest red, green and blue on the wire; a larger value leaves a component as it is
# Sensors of a body that an e-puck2 can read.
READABLE_SENSORS = frozenset({"proximity", "scan", "ground", "light", "odometry", "imu", "compass", "battery"})
_LAYOUT = Struct("<BBBhhB12sB")  # header, request, settings, left and right, red LEDs, RGB LEDs, sound


class Header(ExplainedEnum):
    """The first byte of an answer, which announces its content."""

    IMAGE = 1, "an image, 160 x 120 points of 2 bytes"
    SENSORS = 2, "the sensors"
    EMPTY = 3, "nothing: the command asked for nothing"


class PacketRequest(IntFlag):
    """The content that a command requests; the image is answered first."""

    NOTHING = 0
    IMAGE = 1
    SENSORS = 2


class RobotSettingsBits(IntFlag):
    """The flags of a command."""

    NONE = 0
    CALIBRATE = 1  # calibrate the proximity sensors, which takes a second; nothing may be near
    AVOID = 2  # the robot steers around obstacles
    SET_STEPS = 4  # the two numbers are new values of the step counters, not speeds


# The content of an answer with the sensors.
SENSORS = np.dtype(
    [
        ("acceleration", "<i2", 3),  # about 800 = 1 g: to the left, ahead, up
        ("acceleration_size", "<f4"),  # 800 = 1 g
        ("orientation_deg", "<f4"),  # direction in which it leans: 0 ahead, 90 to the left
        ("inclination_deg", "<f4"),  # 0 upright
        ("gyro", "<i2", 3),  # 32768 = 250 degrees/s; the last one is positive to the left
        ("magnetic_field", "<f4", 3),  # uT, axes of the magnetometer
        ("temperature_c", "i1"),
        ("proximity", "<u2", 8),  # reflected light above the calibration; higher is nearer
        ("ambient", "<u2", 8),  # about 4000 is dark, less is brighter
        ("distance_mm", "<u2"),  # time-of-flight sensor; 8190 and more: nothing in range
        ("microphones", "<u2", 4),
        ("steps", "<i2", 2),  # counters of the left and right wheel, which wrap
        ("battery", "<u2"),
        ("memory_card", "u1"),
        ("remote_control", "u1", 3),  # toggle, address, data
        ("selector", "u1"),
        ("ground", "<u2", 3),  # reflected light: 0 black to about 1000 white; left, middle, right
        ("ground_ambient", "<u2", 3),
        ("button", "u1"),
        ("reserved", "u1"),
    ]
)
# Size of an answer without its header.
PAYLOAD_BYTES = {Header.IMAGE: 160 * 120 * 2, Header.SENSORS: SENSORS.itemsize, Header.EMPTY: 0}


def wheel_steps(linear_mps: float, angular_radps: float, wheel_base_m: float) -> tuple[int, int]:
    """Return steps/s of the left and right wheel; both slow down if one is too fast, which keeps the curve.

    >>> wheel_steps(0.1, 0.0, 0.053), wheel_steps(0.0, 1.0, 0.053), wheel_steps(0.1, 50.0, 0.053)
    ((796, 796), (-211, 211), (-946, 1100))
    """
    left, right = (mps / M_PER_STEP for mps in wheels_of_twist(linear_mps, angular_radps, wheel_base_m))
    scale = min(1.0, MAX_STEPS_PER_S / max(abs(left), abs(right), 1.0))
    return round(left * scale), round(right * scale)


def limited(steps_per_s: int) -> int:
    """Limit the speed of a wheel to the firmware's range."""
    return max(-MAX_STEPS_PER_S, min(MAX_STEPS_PER_S, steps_per_s))


def body_speeds(left: int, right: int, wheel_base_m: float) -> tuple[float, float]:
    """Return speed in m/s and turn rate to the left in rad/s at these steps/s, within the firmware's limit."""
    left, right = limited(left), limited(right)
    return 0.5 * (left + right) * M_PER_STEP, (right - left) * M_PER_STEP / wheel_base_m


@dataclass(frozen=True, slots=True)
class Lights:
    """The lights in a command."""

    switched: int = 0  # bits: LED1, LED3, LED5, LED7, body LED, front LED
    colours: bytes = bytes(12)  # red, green and blue, 0 to 100, of LED2, LED4, LED6 and LED8; more: unchanged

    def with_changed(self, leds: Mapping[int, int]) -> "Lights":
        """Return a copy with other colours 0xRRGGBB of some LEDs, by index in the body's spec.

        An LED of one colour is on if its component of the colour is at least half of the maximum. ValueError for an
        index without an LED.
        """
        switched, colours = self.switched, bytearray(self.colours)
        for led, rgb in leds.items():
            if not 0 <= led < COUNT:
                raise ValueError(f"expected LEDs from 0 to {COUNT - 1}, got {led}")
            if led in SWITCHED:
                bit, led_rgb = SWITCHED[led]
                switched = switched | bit if (rgb & led_rgb) > led_rgb // 2 else switched & ~bit
            else:
                start = 3 * (led // 2)
                colours[start : start + 3] = _to_wire(rgb)
        return Lights(switched, bytes(colours))

    def shown(self, before: Mapping[int, int]) -> dict[int, int]:
        """Return the colour 0xRRGGBB of each LED in `before`, by index in the body's spec, from its colour before."""
        switched = {led: rgb if self.switched & bit else 0 for led, (bit, rgb) in SWITCHED.items()}
        coloured = {led: self.colours[3 * (led // 2) :][:3] for led in range(1, RING, 2)}
        return {
            led: switched[led] if led in switched else _from_wire(coloured[led], rgb) for led, rgb in before.items()
        }


ALL_DARK = Lights()


def _to_wire(rgb: int) -> bytes:
    return bytes(round((rgb >> shift & 0xFF) * BRIGHTEST / 0xFF) for shift in (16, 8, 0))


def _from_wire(colour: bytes, before: int) -> int:
    rgb = 0
    for level, shift in zip(colour, (16, 8, 0), strict=True):
        component = before >> shift & 0xFF if level > BRIGHTEST else round(level * 0xFF / BRIGHTEST)
        rgb |= component << shift
    return rgb


@dataclass(frozen=True, slots=True)
class RobotCommand:
    """A command: speeds, lights and sound in 21 bytes."""

    left: int = 0  # steps/s, or the new value of the step counter; -32768 to 32767
    right: int = 0
    lights: Lights = ALL_DARK
    request: PacketRequest = PacketRequest.NOTHING
    settings: RobotSettingsBits = RobotSettingsBits.NONE
    sound: int = 0  # bits: three melodies, two sounds, and silence

    def encoded(self) -> bytes:
        """Encode the command to its 21 bytes."""
        return _LAYOUT.pack(
            COMMAND_HEADER,
            self.request,
            self.settings,
            self.left,
            self.right,
            self.lights.switched,
            self.lights.colours,
            self.sound,
        )

    @classmethod
    def decoded(cls, packet: bytes) -> "RobotCommand":
        """Decode a command; BadFrame if the bytes hold none."""
        if len(packet) != COMMAND_BYTES or packet[0] != COMMAND_HEADER:
            expected = f"expected {COMMAND_BYTES} bytes from {COMMAND_HEADER:#x} on"
            raise BadFrame("malformed_commands", f"{expected}, got {packet[:COMMAND_BYTES].hex()}")
        _, request, settings, left, right, switched, colours, sound = _LAYOUT.unpack(packet)
        return cls(
            left, right, Lights(switched, colours), PacketRequest(request & 3), RobotSettingsBits(settings & 7), sound
        )


def check_fits(body: Body) -> None:
    """Raise BadInput unless the body has two wheels, and as many sensors and LEDs of each kind as an e-puck2."""
    _check(body, "drive.kind", isinstance(body.drive, Wheels), "wheels")
    if body.proximity:
        _check(body, "sensors.proximity.angles_deg", len(body.proximity.angles_deg) == 8, "8 angles")
    if body.light:
        _check(body, "sensors.light.angles_deg", len(body.light.angles_deg) == 8, "8 angles")
    if body.scan:
        _check(body, "sensors.scan.rays", body.scan.rays == 1, "1 ray")
    if body.ground:
        _check(body, "sensors.ground.points_m", len(body.ground.points_m) == 3, "3 points")
    _check(body, "leds", body.led_count in {0, RING, COUNT}, f"{COUNT} LEDs, or the {RING} of the ring")


def _check(body: Body, key: str, fits: bool, expected: str) -> None:
    if not fits:
        raise BadInput(f"body {body.name}", key, f"expected {expected}, as an e-puck2 has")


class Answer(NamedTuple):
    """An answer of a robot."""

    header: Header
    payload: bytes


class Answers:
    """A parser of the answers in a robot's byte stream, which may be cut anywhere; it does no I/O."""

    def __init__(self) -> None:
        self._buffer = bytearray()

    def fed(self, data: bytes) -> Iterator[Answer]:
        """Yield the answers that these bytes complete; BadFrame for an invalid header, which ends the stream."""
        buffer = self._buffer
        buffer += data
        while buffer:
            header = _header(buffer[0])
            end = 1 + PAYLOAD_BYTES[header]
            if len(buffer) < end:
                return
            payload = bytes(buffer[1:end])
            del buffer[:end]
            yield Answer(header, payload)


def _header(byte: int) -> Header:
    try:
        return Header(byte)
    except ValueError:
        raise BadFrame("garbage", f"expected an answer of 1, 2 or 3, got {byte}") from None
