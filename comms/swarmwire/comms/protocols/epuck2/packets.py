"""The packets of the e-puck2, little-endian: commands of 21 bytes, and answers in a byte stream.

Clockwise from ahead the lights are LED1 (red), LED2 (any colour), LED3 (red), and so on to LED8; then the front LED
(red) and the body LED (green). The body's spec has them in that order. The LEDs of one colour are on or off. The
firmware of the radio module shows the state of the WiFi with LED2, whether or not a command sets them.
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
from swarmwire.comms.robot.sensors.light import LightSpec
from swarmwire.comms.robot.sensors.rays import ProximitySpec
from swarmwire.comms.robot.sensors.scan import ScanSpec
from swarmwire.comms.robot.sensors.simple import GroundSpec

PORT = 1000  # of TCP, on the robot
COMMAND_BYTES = 21
COMMAND_HEADER = 0x80
STEPS_PER_TURN = 1000
M_PER_STEP = pi * 0.04 / STEPS_PER_TURN  # wheels of 40 mm
MAX_STEPS_PER_S = 1100  # the firmware's limit of a wheel
RING = 8  # LEDs of the ring, every other one of any colour
RED, GREEN = 0xFF0000, 0x00FF00
FRONT_LED, BODY_LED = 8, 9  # by index in the body's spec
# The LEDs of one colour: their bits in `Lights.switched`, and their colours.
SWITCHED = {0: (1, RED), 2: (2, RED), 4: (4, RED), 6: (8, RED), FRONT_LED: (32, RED), BODY_LED: (16, GREEN)}
COUNT = 10  # LEDs
BRIGHTEST = 100  # of red, green and blue on the wire; above it a component keeps its value
# Sensors of a body that an e-puck2 can read.
READABLE_SENSORS = frozenset({"proximity", "scan", "ground", "light", "odometry", "imu", "compass", "battery"})
_LAYOUT = Struct("<BBBhhB12sB")  # header, request, settings, left and right, red LEDs, RGB LEDs, sound


class Header(ExplainedEnum):
    """What the first byte of an answer announces."""

    IMAGE = 1, "an image, 160 x 120 points of 2 bytes"
    SENSORS = 2, "the sensors"
    EMPTY = 3, "nothing: the command asked for nothing"


class PacketRequest(IntFlag):
    """What a command asks for; the image is answered first."""

    NOTHING = 0
    IMAGE = 1
    SENSORS = 2


class RobotSettingsBits(IntFlag):
    """The flags of a command, beside speeds and lights."""

    NONE = 0
    CALIBRATE = 1  # of the proximity sensors: takes a second, with nothing near
    AVOID = 2  # the robot steers commands away from obstacles
    SET_STEPS = 4  # the two numbers are what the step counters are to show, not speeds


# The answer to a command that asks for the sensors.
SENSORS = np.dtype(
    [
        ("acceleration", "<i2", 3),  # about 800 = 1 g: to the left, ahead, up
        ("acceleration_size", "<f4"),  # in the same unit
        ("orientation_deg", "<f4"),  # to where it leans: 0 ahead, 90 to the left
        ("inclination_deg", "<f4"),  # 0 upright
        ("gyro", "<i2", 3),  # 32768 = 250 degrees/s; the last one is positive to the left
        ("magnetic_field", "<f4", 3),  # in the magnetometer's own axes
        ("temperature_c", "i1"),
        ("proximity", "<u2", 8),  # reflected light above that of the calibration; higher is nearer
        ("ambient", "<u2", 8),  # about 4000 is dark, less is brighter
        ("distance_mm", "<u2"),  # of the time-of-flight sensor; 8190 and more: it sees nothing
        ("microphones", "<u2", 4),
        ("steps", "<i2", 2),  # left and right; they wrap
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
# Bytes of an answer, behind its first one.
PAYLOAD_BYTES = {Header.IMAGE: 160 * 120 * 2, Header.SENSORS: SENSORS.itemsize, Header.EMPTY: 0}


def wheel_steps(linear_mps: float, angular_radps: float, wheel_base_m: float) -> tuple[int, int]:
    """Steps/s of the left and the right wheel; where one is too fast both slow down, so that the curve stays.

    >>> wheel_steps(0.1, 0.0, 0.053), wheel_steps(0.0, 1.0, 0.053), wheel_steps(0.1, 50.0, 0.053)
    ((796, 796), (-211, 211), (-946, 1100))
    """
    left, right = (mps / M_PER_STEP for mps in wheels_of_twist(linear_mps, angular_radps, wheel_base_m))
    scale = min(1.0, MAX_STEPS_PER_S / max(abs(left), abs(right), 1.0))
    return round(left * scale), round(right * scale)


def limited(steps_per_s: int) -> int:
    """The speed of a wheel within the firmware's limit."""
    return max(-MAX_STEPS_PER_S, min(MAX_STEPS_PER_S, steps_per_s))


def body_speeds(left: int, right: int, wheel_base_m: float) -> tuple[float, float]:
    """Speed in m/s and turn rate to the left in rad/s at these steps/s, within the firmware's limit."""
    left, right = limited(left), limited(right)
    return 0.5 * (left + right) * M_PER_STEP, (right - left) * M_PER_STEP / wheel_base_m


@dataclass(frozen=True, slots=True)
class Lights:
    """The lights in a command."""

    switched: int = 0  # a bit each: LED1, LED3, LED5, LED7, body LED, front LED
    colours: bytes = bytes(12)  # red, green and blue, 0 to 100, of LED2, LED4, LED6 and LED8; more: as it is

    def with_changed(self, leds: Mapping[int, int]) -> "Lights":
        """A copy with some LEDs (index in the body's spec) in another colour 0xRRGGBB.

        An LED of one colour is on if this colour is at least half as bright as it can be. ValueError if there is no
        such LED.
        """
        switched, colours = self.switched, bytearray(self.colours)
        for which, rgb in leds.items():
            if not 0 <= which < COUNT:
                raise ValueError(f"expected LEDs from 0 to {COUNT - 1}, got {which}")
            if which in SWITCHED:
                bit, own = SWITCHED[which]
                switched = switched | bit if (rgb & own) > own // 2 else switched & ~bit
            else:
                at = 3 * (which // 2)
                colours[at : at + 3] = _to_wire(rgb)
        return Lights(switched, bytes(colours))

    def shown(self, before: Mapping[int, int]) -> dict[int, int]:
        """The colour 0xRRGGBB of each LED in `before`, by index in the body's spec, from the colours before."""
        switched = {which: own if self.switched & bit else 0 for which, (bit, own) in SWITCHED.items()}
        coloured = {which: self.colours[3 * (which // 2) :][:3] for which in range(1, RING, 2)}
        return {
            which: switched[which] if which in switched else _from_wire(coloured[which], rgb)
            for which, rgb in before.items()
        }


ALL_DARK = Lights()


def _to_wire(rgb: int) -> bytes:
    return bytes(round((rgb >> shift & 0xFF) * BRIGHTEST / 0xFF) for shift in (16, 8, 0))


def _from_wire(colour: bytes, before: int) -> int:
    rgb = 0
    for part, shift in zip(colour, (16, 8, 0), strict=True):
        shown = before >> shift & 0xFF if part > BRIGHTEST else round(part * 0xFF / BRIGHTEST)
        rgb |= shown << shift
    return rgb


@dataclass(frozen=True, slots=True)
class RobotCommand:
    """A command: speeds, lights and sound in 21 bytes."""

    left: int = 0  # steps/s, or the new value of the step counter; -32768 to 32767
    right: int = 0
    lights: Lights = ALL_DARK
    request: PacketRequest = PacketRequest.NOTHING
    settings: RobotSettingsBits = RobotSettingsBits.NONE
    sound: int = 0  # a bit each: three melodies, two sounds, and silence

    def encoded(self) -> bytes:
        """The 21 bytes."""
        lights = self.lights
        of_wheels = self.left, self.right
        return _LAYOUT.pack(
            COMMAND_HEADER, self.request, self.settings, *of_wheels, lights.switched, lights.colours, self.sound
        )

    @classmethod
    def decoded(cls, packet: bytes) -> "RobotCommand":
        """The command in these bytes; BadFrame if they hold none."""
        if len(packet) != COMMAND_BYTES or packet[0] != COMMAND_HEADER:
            expected = f"expected {COMMAND_BYTES} bytes from {COMMAND_HEADER:#x} on"
            raise BadFrame("malformed_commands", f"{expected}, got {packet[:COMMAND_BYTES].hex()}")
        _, request, settings, left, right, switched, colours, sound = _LAYOUT.unpack(packet)
        return cls(
            left, right, Lights(switched, colours), PacketRequest(request & 3), RobotSettingsBits(settings & 7), sound
        )


def check_fits(body: Body) -> None:
    """BadInput unless the body has two wheels, and as many sensors and LEDs of each kind as an e-puck2."""
    sensors = body.sensors
    proximity, light, scan, ground = (sensors.get(name) for name in ("proximity", "light", "scan", "ground"))
    _check(body, "drive.kind", isinstance(body.drive, Wheels), "wheels")
    if isinstance(proximity, ProximitySpec):
        _check(body, "sensors.proximity.angles_deg", len(proximity.angles_deg) == 8, "8 angles")
    if isinstance(light, LightSpec):
        _check(body, "sensors.light.angles_deg", len(light.angles_deg) == 8, "8 angles")
    if isinstance(scan, ScanSpec):
        _check(body, "sensors.scan.rays", scan.rays == 1, "1 ray")
    if isinstance(ground, GroundSpec):
        _check(body, "sensors.ground.points_m", len(ground.points_m) == 3, "3 points")
    _check(body, "leds", body.led_count in {0, RING, COUNT}, f"{COUNT} LEDs, or the {RING} of the ring")


def _check(body: Body, key: str, fits: bool, expected: str) -> None:
    if not fits:
        raise BadInput(f"body {body.name}", key, f"expected {expected}, as an e-puck2 has")


class Answer(NamedTuple):
    """One answer of a robot."""

    header: Header
    payload: bytes


class Answers:
    """A parser of the answers in a robot's byte stream, however the stream is cut; no I/O."""

    def __init__(self) -> None:
        self._rest = bytearray()

    def fed(self, data: bytes) -> Iterator[Answer]:
        """The answers that are complete with these bytes; BadFrame where none can begin, the rest is lost."""
        rest = self._rest
        rest += data
        while rest:
            header = _header(rest[0])
            end = 1 + PAYLOAD_BYTES[header]
            if len(rest) < end:
                return
            payload = bytes(rest[1:end])
            del rest[:end]
            yield Answer(header, payload)


def _header(first: int) -> Header:
    try:
        return Header(first)
    except ValueError:
        raise BadFrame("garbage", f"expected an answer of 1, 2 or 3, got {first}") from None
