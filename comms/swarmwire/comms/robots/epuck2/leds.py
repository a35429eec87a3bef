"""The lights of the e-puck2: four red LEDs that are on or off, and four of any colour between them.

Clockwise from ahead they are LED1 (red), LED2 (any colour), LED3 (red), and so on to LED8, and the body's sheet has
them in that order. The firmware of the radio module shows with LED2 what the WiFi does, whatever a command says.
"""

from collections.abc import Mapping
from dataclasses import dataclass

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
