"""Drives and LEDs of a body: the tables `drive` and `leds` of a body file. `kind` in the table `drive` names the drive.

Colours of LEDs are numbers 0xRRGGBB.
"""

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike

from swarmwire.comms.base import math as portable
from swarmwire.comms.base.arrays import FloatArray, IntArray
from swarmwire.comms.base.config import parameter

N = TypeVar("N", float, FloatArray)
BRIGHTEST = 0xFFFFFF  # white; a byte each for red, green and blue


@dataclass(frozen=True)
class WheelNoise:
    """Actuation noise of wheels, the model of ARGoS: a wheel with the command w runs at f (w + b).

    The bias b is drawn once per wheel, the factor f in each tick for each wheel; both are normal. A robot with commands
    of 0 for both wheels stands still.
    """

    bias_mps: float = parameter(0.0, help="mean of the bias b", unit="m/s", at_least=-0.1, at_most=0.1)
    bias_std_mps: float = parameter(0.0, help="standard deviation of the bias b", unit="m/s", at_least=0, at_most=0.1)
    factor: float = parameter(1.0, help="mean of the factor f", at_least=0, at_most=2)
    factor_std: float = parameter(0.0, help="standard deviation of the factor f", at_least=0, at_most=0.5)


NO_WHEEL_NOISE = WheelNoise()


@dataclass(frozen=True)
class Wheels:
    """Two wheels on one axle; a command that is too fast for a wheel is scaled down, which keeps the curve."""

    wheel_base_m: float = parameter(help="distance between the wheels", unit="m", above=0)
    max_wheel_mps: float = parameter(help="fastest speed of a wheel", unit="m/s", above=0)
    max_force_n: float = parameter(help="largest force along the body, or across it before it slips", unit="N", above=0)
    max_torque_nm: float = parameter(help="largest turning moment", unit="N m", above=0)
    wheel_radius_m: float = parameter(0.0, help="radius of a wheel; 0: unknown", unit="m", at_least=0)
    noise: WheelNoise = parameter(NO_WHEEL_NOISE, help="deviation of the wheels from their commands")
    kind: str = parameter("wheels", help="kind of drive", choices=("wheels",))

    @property
    def max_linear_mps(self) -> float:
        """Largest forward speed."""
        return self.max_wheel_mps

    @property
    def max_angular_radps(self) -> float:
        """Largest turn rate on the spot."""
        return 2.0 * self.max_wheel_mps / self.wheel_base_m


@dataclass(frozen=True)
class Twist:
    """Two wheels on one axle behind a controller that limits forward speed and turn rate separately."""

    wheel_base_m: float = parameter(help="distance between the wheels", unit="m", above=0)
    max_linear_mps: float = parameter(help="fastest forward speed", unit="m/s", above=0)
    max_angular_radps: float = parameter(help="fastest turn", unit="rad/s", above=0)
    max_force_n: float = parameter(help="largest force along the body, or across it before it slips", unit="N", above=0)
    max_torque_nm: float = parameter(help="largest turning moment", unit="N m", above=0)
    wheel_radius_m: float = parameter(0.0, help="radius of a wheel; 0: unknown", unit="m", at_least=0)
    noise: WheelNoise = parameter(NO_WHEEL_NOISE, help="deviation of the wheels from their commands")
    kind: str = parameter("twist", help="kind of drive", choices=("twist",))


@dataclass(frozen=True)
class Holonomic:
    """A drive in every direction of the plane that turns at the same time; it has no wheel slip and no noise."""

    max_speed_mps: float = parameter(help="fastest speed in any direction of the plane", unit="m/s", above=0)
    max_angular_radps: float = parameter(help="fastest turn", unit="rad/s", above=0)
    max_force_n: float = parameter(help="largest force in any direction of the plane", unit="N", above=0)
    max_torque_nm: float = parameter(help="largest turning moment", unit="N m", above=0)
    kind: str = parameter("holonomic", help="kind of drive", choices=("holonomic",))

    @property
    def max_linear_mps(self) -> float:
        """Largest forward speed."""
        return self.max_speed_mps


Drive = Wheels | Twist | Holonomic
DRIVES: dict[str, type[Drive]] = {"wheels": Wheels, "twist": Twist, "holonomic": Holonomic}  # `kind`: class


def wheel_base_of(drive: Drive) -> float:
    """Return the distance between a drive's wheels in m; 0 if it has none."""
    return 0.0 if isinstance(drive, Holonomic) else drive.wheel_base_m


def wheel_radius_of(drive: Drive) -> float:
    """Return the radius of a drive's wheels in m; 0 if it has none or the radius is unknown."""
    return 0.0 if isinstance(drive, Holonomic) else drive.wheel_radius_m


def wheels_of_twist(linear_mps: N, angular_radps: N, wheel_base_m: float) -> tuple[N, N]:
    """Convert forward speed and turn rate (positive to the left) to the speeds of the left and the right wheel.

    It also converts distances. The world compiles this function.
    """
    difference_mps = 0.5 * wheel_base_m * angular_radps
    return linear_mps - difference_mps, linear_mps + difference_mps


def twist_of_wheels(left_mps: N, right_mps: N, wheel_base_m: float) -> tuple[N, N]:
    """Convert wheel speeds to forward speed and turn rate (positive to the left): the inverse of `wheels_of_twist`."""
    return 0.5 * (left_mps + right_mps), (right_mps - left_mps) / wheel_base_m


@dataclass(frozen=True)
class Leds:
    """LEDs in a ring around the body, in the order of `angles_deg`, then an optional beacon on its axis."""

    angles_deg: tuple[float, ...] = parameter(help="angle of each LED, counter-clockwise from ahead", unit="deg")
    height_m: float = parameter(help="height of the ring above the body's lower side", unit="m", at_least=0)
    radius_m: float = parameter(0.0, help="radius of the ring; 0: radius of the body", unit="m", at_least=0)
    beacon_height_m: float = parameter(
        0.0, help="height of a beacon, the last LED, above the body's lower side; 0: none", unit="m", at_least=0
    )

    @property
    def count(self) -> int:
        """Number of LEDs, beacon included."""
        return len(self.angles_deg) + (self.beacon_height_m > 0.0)

    def positions_m(self, body_radius_m: float) -> FloatArray:
        """Positions of the LEDs: x ahead and y to the left of the body's axis, z above its lower side, (leds, 3)."""
        angle, ring_m = np.deg2rad(self.angles_deg), self.radius_m or body_radius_m
        position = np.zeros((self.count, 3))
        ring, beacon = position[: len(angle)], position[len(angle) :]
        ring[:, 0], ring[:, 1], ring[:, 2] = ring_m * portable.cos(angle), ring_m * portable.sin(angle), self.height_m
        beacon[:, 2] = self.beacon_height_m
        return position


def rgb_of_one(red: float, green: float, blue: float) -> int:
    """Return one colour 0xRRGGBB from components in [0, 1]; ValueError if a component is out of range."""
    rgb = 0
    for level in (red, green, blue):
        if not 0.0 <= level <= 1.0:
            raise ValueError(f"led(red, green, blue): expected numbers from 0 to 1, got {level}")
        rgb = (rgb << 8) + round(255.0 * level)
    return rgb


def rgb_of(red: ArrayLike, green: ArrayLike, blue: ArrayLike) -> IntArray:
    """Return colours 0xRRGGBB from components in [0, 1] of any shape; ValueError if a component is out of range."""
    rgb: IntArray = np.zeros((), np.int64)
    for component in (red, green, blue):
        level = np.asarray(component, np.float64)
        if not ((level >= 0.0) & (level <= 1.0)).all():
            raise ValueError(f"led(red, green, blue): expected numbers from 0 to 1, got {component}")
        rgb = (rgb << 8) + np.round(255.0 * level).astype(np.int64)
    return rgb
