"""LEDs: where a body has them, and their colours as 0xRRGGBB."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from swarmwire.comms.arrays import FloatArray, IntArray
from swarmwire.comms.parameters import parameter

BRIGHTEST = 0xFFFFFF  # white: a byte each for red, green and blue


@dataclass(frozen=True)
class Leds:
    """LEDs in a ring around the body, in the order of `angles_deg`, then a beacon on its axis if it has one."""

    angles_deg: tuple[float, ...] = parameter(help="where each LED sits, counter-clockwise from ahead", unit="deg")
    height_m: float = parameter(help="height of the ring above the body's lower side", unit="m", at_least=0)
    radius_m: float = parameter(0.0, help="radius of the ring; 0: that of the body", unit="m", at_least=0)
    beacon_height_m: float = parameter(
        0.0, help="height of a beacon, the last LED, above the body's lower side; 0: none", unit="m", at_least=0
    )

    @property
    def count(self) -> int:
        """How many LEDs there are."""
        return len(self.angles_deg) + (self.beacon_height_m > 0.0)

    def places_m(self, body_radius_m: float) -> FloatArray:
        """Where they sit: x ahead and y to the left of the body's axis, z above its lower side, (leds, 3)."""
        angle, ring_m = np.deg2rad(self.angles_deg), self.radius_m or body_radius_m
        places = np.zeros((self.count, 3))
        places[: len(angle), 0], places[: len(angle), 1] = ring_m * np.cos(angle), ring_m * np.sin(angle)
        places[: len(angle), 2] = self.height_m
        places[len(angle) :, 2] = self.beacon_height_m
        return places


def rgb_of(red: ArrayLike, green: ArrayLike, blue: ArrayLike) -> IntArray:
    """Colours as 0xRRGGBB of shares from 0 to 1, any shape; ValueError if one is out of range."""
    whole: IntArray = np.zeros((), np.int64)
    for share in (red, green, blue):
        asked = np.asarray(share, np.float64)
        if not ((asked >= 0.0) & (asked <= 1.0)).all():
            raise ValueError(f"led(red, green, blue): expected numbers from 0 to 1, got {share}")
        whole = (whole << 8) + np.round(255.0 * asked).astype(np.int64)
    return whole
