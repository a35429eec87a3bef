"""Drives: what moves a body and how fast it can go, as tables of its data sheet; `kind` says which."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from swarmwire.comms.arrays import FloatArray, IntArray
from swarmwire.comms.config import parameter


@dataclass(frozen=True)
class WheelNoise:
    """How wheels differ from what they are asked for: asked for w, a wheel runs at f (w + b), as ARGoS has it.

    The bias b is drawn once for each wheel, the factor f for each wheel in each tick, both normal. Where both
    wheels are asked to stand still they do.
    """

    bias_mps: float = parameter(0.0, help="mean of the bias b", unit="m/s", at_least=-0.1, at_most=0.1)
    bias_std_mps: float = parameter(0.0, help="standard deviation of the bias b", unit="m/s", at_least=0, at_most=0.1)
    factor: float = parameter(1.0, help="mean of the factor f", at_least=0, at_most=2)
    factor_std: float = parameter(0.0, help="standard deviation of the factor f", at_least=0, at_most=0.5)


NO_WHEEL_NOISE = WheelNoise()  # wheels do as they are told


@dataclass(frozen=True)
class Wheels:
    """Two wheels on one axle; a command that a wheel cannot follow is slowed down as a whole, so its curve stays."""

    wheel_base_m: float = parameter(help="distance between the wheels", unit="m", above=0)
    max_wheel_mps: float = parameter(help="fastest speed of a wheel", unit="m/s", above=0)
    max_force_n: float = parameter(help="largest force along the body, or across it before it slips", unit="N", above=0)
    max_torque_nm: float = parameter(help="largest turning moment", unit="N m", above=0)
    noise: WheelNoise = parameter(NO_WHEEL_NOISE, help="how the wheels differ from what they are asked for")
    kind: str = parameter("wheels", help="kind of drive", choices=("wheels",))

    @property
    def max_linear_mps(self) -> float:
        """The fastest it can drive straight ahead."""
        return self.max_wheel_mps

    @property
    def max_angular_radps(self) -> float:
        """The fastest it can turn on the spot."""
        return 2.0 * self.max_wheel_mps / self.wheel_base_m


@dataclass(frozen=True)
class Twist:
    """Two wheels on one axle behind a controller that limits forward speed and turn rate apart."""

    wheel_base_m: float = parameter(help="distance between the wheels", unit="m", above=0)
    max_linear_mps: float = parameter(help="fastest forward speed", unit="m/s", above=0)
    max_angular_radps: float = parameter(help="fastest turn", unit="rad/s", above=0)
    max_force_n: float = parameter(help="largest force along the body, or across it before it slips", unit="N", above=0)
    max_torque_nm: float = parameter(help="largest turning moment", unit="N m", above=0)
    noise: WheelNoise = parameter(NO_WHEEL_NOISE, help="how the wheels differ from what they are asked for")
    kind: str = parameter("twist", help="kind of drive", choices=("twist",))


@dataclass(frozen=True)
class Holonomic:
    """Moves in every direction of the plane and turns at the same time; it has no wheels that slip, and no noise."""

    max_speed_mps: float = parameter(help="fastest speed in any direction of the plane", unit="m/s", above=0)
    max_angular_radps: float = parameter(help="fastest turn", unit="rad/s", above=0)
    max_force_n: float = parameter(help="largest force in any direction of the plane", unit="N", above=0)
    max_torque_nm: float = parameter(help="largest turning moment", unit="N m", above=0)
    kind: str = parameter("holonomic", help="kind of drive", choices=("holonomic",))

    @property
    def max_linear_mps(self) -> float:
        """The fastest it can move straight ahead."""
        return self.max_speed_mps


Drive = Wheels | Twist | Holonomic  # what a body has one of
# By `kind` in a body's sheet.
DRIVES: dict[str, type[Drive]] = {"wheels": Wheels, "twist": Twist, "holonomic": Holonomic}


def wheel_base_of(drive: Drive) -> float:
    """The distance between a drive's wheels in m; 0 if it has none."""
    return 0.0 if isinstance(drive, Holonomic) else drive.wheel_base_m


# --- LEDs: where a body has them, and their colours as 0xRRGGBB.


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
