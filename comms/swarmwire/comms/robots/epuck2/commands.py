"""How fast the e-puck2 goes: steps of its wheels, and the speeds of its body."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from math import pi
from struct import Struct
from typing import NamedTuple

from swarmwire.comms.bodies.body import Body
from swarmwire.comms.bodies.drives import Wheels
from swarmwire.comms.bodies.ranging_specs import LightSpec, ProximitySpec, ScanSpec
from swarmwire.comms.bodies.sensor_specs import GroundSpec
from swarmwire.comms.errors import BadFrame, BadInput
from swarmwire.comms.robots.epuck2.packets import (
    COMMAND_BYTES,
    COMMAND_HEADER,
    PAYLOAD_BYTES,
    Header,
    PacketRequest,
    RobotSettingsBits,
)

STEPS_PER_TURN = 1000
M_PER_STEP = pi * 0.04 / STEPS_PER_TURN  # wheels of 40 mm
FASTEST = 1100  # steps/s; the firmware goes no faster, whatever it is told


def wheel_steps(linear_mps: float, angular_radps: float, wheel_base_m: float) -> tuple[int, int]:
    """Steps/s of the left and the right wheel, slowed down together where one would be too fast, so the curve stays.

    >>> wheel_steps(0.1, 0.0, 0.053), wheel_steps(0.0, 1.0, 0.053), wheel_steps(0.1, 50.0, 0.053)
    ((796, 796), (-211, 211), (-946, 1100))
    """
    apart_mps = 0.5 * wheel_base_m * angular_radps
    left, right = (linear_mps - apart_mps) / M_PER_STEP, (linear_mps + apart_mps) / M_PER_STEP
    slower = min(1.0, FASTEST / max(abs(left), abs(right), 1.0))
    return round(left * slower), round(right * slower)


def body_speeds(left: int, right: int, wheel_base_m: float) -> tuple[float, float]:
    """How fast in m/s, and turning how fast to the left in rad/s, the robot goes at these steps/s.

    Each wheel goes no faster than the firmware lets it.
    """
    left, right = (max(-FASTEST, min(FASTEST, steps)) for steps in (left, right))
    return 0.5 * (left + right) * M_PER_STEP, (right - left) * M_PER_STEP / wheel_base_m


# --- The lights of the e-puck2: four red LEDs that are on or off, and four of any colour between them.
#
# Clockwise from ahead they are LED1 (red), LED2 (any colour), LED3 (red), and so on to LED8, and the body's sheet has
# them in that order. The firmware of the radio module shows with LED2 what the WiFi does, whatever a command says.


COUNT = 8
RED = 0xFF0000
BRIGHTEST = 100  # of red, green and blue; above it a colour stays as it is


@dataclass(frozen=True, slots=True)
class Lights:
    """What a command says of the lights."""

    switched: int = 0  # a bit each: LED1, LED3, LED5, LED7, the body's LED, the one ahead
    colours: bytes = bytes(12)  # red, green and blue, 0 to 100, of LED2, LED4, LED6 and LED8; more: as it is

    def with_changed(self, leds: Mapping[int, int]) -> "Lights":
        """These, with some LEDs (place in the body's sheet) in another colour 0xRRGGBB.

        A red LED is on if the colour has at least half of all red. ValueError if there is no such LED.
        """
        switched, colours = self.switched, bytearray(self.colours)
        for which, rgb in leds.items():
            if not 0 <= which < COUNT:
                raise ValueError(f"expected LEDs from 0 to {COUNT - 1}, got {which}")
            place, coloured = divmod(which, 2)
            if coloured:
                colours[3 * place : 3 * place + 3] = _to_wire(rgb)
            else:
                on = (rgb >> 16 & 0xFF) >= 0x80
                switched = switched | 1 << place if on else switched & ~(1 << place)
        return Lights(switched, bytes(colours))

    def shown(self, before: Mapping[int, int]) -> dict[int, int]:
        """What each LED shows, place in the body's sheet -> 0xRRGGBB, if before it showed that."""
        shown = dict(before)
        for place in range(COUNT // 2):
            shown[2 * place] = RED if self.switched >> place & 1 else 0
            colour = self.colours[3 * place : 3 * place + 3]
            shown[2 * place + 1] = _from_wire(colour, before.get(2 * place + 1, 0))
        return shown


ALL_DARK = Lights()


def _to_wire(rgb: int) -> bytes:
    return bytes(round((rgb >> shift & 0xFF) * BRIGHTEST / 0xFF) for shift in (16, 8, 0))


def _from_wire(colour: bytes, before: int) -> int:
    rgb = 0
    for part, shift in zip(colour, (16, 8, 0), strict=True):
        shown = before >> shift & 0xFF if part > BRIGHTEST else round(part * 0xFF / BRIGHTEST)
        rgb |= shown << shift
    return rgb


# --- The command of the e-puck2: speeds, lights and sound in 21 bytes.


_LAYOUT = Struct("<BBBhhB12sB")  # header, request, settings, left and right, red LEDs, RGB LEDs, sound


@dataclass(frozen=True, slots=True)
class RobotCommand:
    """One command, as it goes over the wire."""

    left: int = 0  # steps/s, or what the counter is to show; -32768 to 32767
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
        """The command in these bytes; BadFrame if they are none."""
        if len(packet) != COMMAND_BYTES or packet[0] != COMMAND_HEADER:
            expected = f"expected {COMMAND_BYTES} bytes from {COMMAND_HEADER:#x} on"
            raise BadFrame("malformed_commands", f"{expected}, got {packet[:COMMAND_BYTES].hex()}")
        _, request, settings, left, right, switched, colours, sound = _LAYOUT.unpack(packet)
        return cls(
            left, right, Lights(switched, colours), PacketRequest(request & 3), RobotSettingsBits(settings & 7), sound
        )


# --- Which bodies an e-puck2 can be.


# Senses of a body that an e-puck2 can tell.
READABLE_SENSORS = frozenset({"proximity", "scan", "ground", "light", "odometry", "imu", "compass", "battery"})


def check_fits(body: Body) -> None:
    """BadInput if the sheet is not one of an e-puck2: two wheels, and as many sensors and LEDs of a kind as it has."""
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
    _check(body, "leds", body.led_count in {0, COUNT}, f"{COUNT} LEDs")


def _check(body: Body, key: str, fits: bool, expected: str) -> None:
    if not fits:
        raise BadInput(f"body {body.name}", key, f"expected {expected}, as an e-puck2 has")


# --- Packets out of the bytes of a connection, however they are cut; no I/O.


class Answer(NamedTuple):
    """One answer of a robot."""

    header: Header
    payload: bytes


class Answers:
    """What a robot answers, out of its bytes."""

    def __init__(self) -> None:
        self._rest = bytearray()

    def fed(self, data: bytes) -> Iterator[Answer]:
        """Answers that are whole with these bytes; BadFrame where none can begin: the rest cannot be told apart."""
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


class Commands:
    """What a program tells a robot, out of its bytes."""

    def __init__(self) -> None:
        self._rest = bytearray()

    @property
    def begun(self) -> bool:
        """Whether a part of a command has come."""
        return bool(self._rest)

    def fed(self, data: bytes) -> Iterator[RobotCommand]:
        """Commands that are whole with these bytes; BadFrame at one that is none: the rest cannot be told apart."""
        rest = self._rest
        rest += data
        while len(rest) >= COMMAND_BYTES:
            packet = bytes(rest[:COMMAND_BYTES])
            del rest[:COMMAND_BYTES]
            try:
                command = RobotCommand.decoded(packet)
            except BadFrame:
                rest.clear()
                raise
            yield command


def _header(first: int) -> Header:
    try:
        return Header(first)
    except ValueError:
        raise BadFrame("garbage", f"expected an answer of 1, 2 or 3, got {first}") from None
