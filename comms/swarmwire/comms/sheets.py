"""Data sheets of the senses a body may have: what agents may know of their own sensors, and the world emulates."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.parameters import parameter


@dataclass(frozen=True)
class ResponseCurve:
    """How a proximity sensor answers to distance d in m from the rim: a falling curve, clipped to [0, 1].

    `rational`: 1 below `full_m`, else a / (d + b), zero beyond `reach_m`.
    `quadratic`: a d^2 + b d + c, zero beyond `reach_m`.
    """

    kind: str = parameter(help="form of the curve", choices=("rational", "quadratic"))
    a: float = parameter(help="coefficient a")
    b: float = parameter(help="coefficient b")
    reach_m: float = parameter(help="beyond this the answer is 0", unit="m", above=0)
    c: float = parameter(0.0, help="coefficient c (quadratic)")
    full_m: float = parameter(0.0, help="below this the answer is 1 (rational)", unit="m", at_least=0)

    def value(self, distance_m: FloatArray) -> FloatArray:
        """The response, 0 to 1, to these distances (any shape)."""
        if self.kind == "rational":
            value = np.where(distance_m < self.full_m, 1.0, self.a / (np.maximum(distance_m, 0.0) + self.b))
        else:
            value = self.a * distance_m * distance_m + self.b * distance_m + self.c
        return np.where(distance_m <= self.reach_m, np.clip(value, 0.0, 1.0), 0.0)

    def distance_m(self, value: FloatArray) -> FloatArray:
        """The distance at which an ideal sensor answers `value`; `reach_m` where nothing is seen (any shape)."""
        seen = np.maximum(value, 1e-9)
        if self.kind == "rational":
            distance = self.a / seen - self.b
        else:
            root = np.sqrt(np.maximum(self.b * self.b - 4.0 * self.a * (self.c - seen), 0.0))
            distance = (-self.b - root) / (2.0 * self.a)
        return np.where(value > 0.0, np.clip(distance, 0.0, self.reach_m), self.reach_m)


@dataclass(frozen=True)
class Ring:
    """Sensors around the body that look outwards."""

    angles_deg: tuple[float, ...] = parameter(help="where each sensor looks, counter-clockwise from ahead", unit="deg")

    @cached_property
    def angle_rad(self) -> FloatArray:
        """Where the sensors look in the body's frame, in (-pi, pi], (sensors,)."""
        angle = np.deg2rad(np.array(self.angles_deg, np.float64))
        wrapped = np.arctan2(np.sin(angle), np.cos(angle))
        wrapped.setflags(write=False)
        return wrapped

    @cached_property
    def direction(self) -> tuple[FloatArray, FloatArray]:
        """Cosine and sine of `angle_rad`, (sensors,) each."""
        return np.cos(self.angle_rad), np.sin(self.angle_rad)


@dataclass(frozen=True)
class Proximity(Ring):
    """Rays from the body's rim that answer to the nearest thing on them. Sense: value (n, rays), 0 to 1."""

    range_m: float = parameter(help="length of a ray from the rim", unit="m", above=0)
    response: ResponseCurve = parameter(help="answer to distance")
    noise: float = parameter(0.0, help="half width of the uniform noise added to the response", at_least=0, at_most=1)


@dataclass(frozen=True)
class Light(Ring):
    """Photocells that answer to the arena's lights. Sense: value (n, sensors), 0 dark to 1."""

    noise: float = parameter(0.0, help="half width of the uniform noise added to the response", at_least=0, at_most=1)


@dataclass(frozen=True)
class Compass:
    """The heading in the arena's frame. Sense: heading_rad (n,), in (-pi, pi], 0 along the arena's +x."""

    noise_rad: float = parameter(0.0, help="standard deviation of the error, new in each tick", unit="rad", at_least=0)


@dataclass(frozen=True)
class Odometry:
    """Encoders on the two wheels. Sense: left_m, right_m (n,), travelled since the start, with slip and quantised."""

    slip: float = parameter(0.0, help="standard deviation of a tick's relative error", at_least=0, at_most=1)
    step_m: float = parameter(0.0, help="travel per encoder step; 0: not quantised", unit="m", at_least=0)


@dataclass(frozen=True)
class Bumper:
    """A touch-sensitive rim. Sense: pressed (n,), 1 if the body touched anything in the tick before, else 0."""


@dataclass(frozen=True)
class Positioning:
    """The position in the arena's frame, as a tracking camera tells it. Sense: x_m, y_m (n,)."""

    noise_m: float = parameter(
        0.0, help="standard deviation of the error along each axis, new in each tick", unit="m", at_least=0
    )


Sheet = Proximity | Compass | Odometry | Light | Bumper | Positioning
SHEETS: dict[str, type[Any]] = {
    "proximity": Proximity,
    "compass": Compass,
    "odometry": Odometry,
    "light": Light,
    "bumper": Bumper,
    "positioning": Positioning,
}
