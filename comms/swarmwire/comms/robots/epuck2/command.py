"""The command of the e-puck2: speeds, lights and sound in 21 bytes."""

from dataclasses import dataclass
from struct import Struct

from swarmwire.comms.errors import BadFrame
from swarmwire.comms.robots.epuck2.leds import ALL_DARK, Lights
from swarmwire.comms.robots.epuck2.packets import COMMAND_BYTES, COMMAND_HEADER, Request, Settings

_LAYOUT = Struct("<BBBhhB12sB")  # header, request, settings, left and right, red LEDs, RGB LEDs, sound


@dataclass(frozen=True, slots=True)
class RobotCommand:
    """One command, as it goes over the wire."""

    left: int = 0  # steps/s, or what the counter is to show; -32768 to 32767
    right: int = 0
    lights: Lights = ALL_DARK
    request: Request = Request.NOTHING
    settings: Settings = Settings.NONE
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
        return cls(left, right, Lights(switched, colours), Request(request & 3), Settings(settings & 7), sound)
