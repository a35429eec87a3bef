"""Specs of the sensors that look around a body: proximity, passive infrared, light, laser scanner.

Infrared sensors answer to the distance from the body's rim by a `ResponseCurve`. Angles of a spec are in degrees,
counter-clockwise from ahead; `angle_rad` has them in (-pi, pi].
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from swarmwire.comms.angles import wrap_by_atan2
from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.bodies.spec import RangedSensorSpec
from swarmwire.comms.config import parameter

FORMS = ("rational", "inverse_square", "quadratic")  # compiled code uses the index in this tuple
FULL_DEG = 360.0
SMALLEST = 1e-9  # lower bound of the values and distances that a curve divides by


def _directions(angle_rad: FloatArray) -> FloatArray:
    """Directions in a body's frame, wrapped into one turn; read-only, since all robots share them."""
    wrapped = wrap_by_atan2(angle_rad)
    wrapped.setflags(write=False)
    return wrapped


@dataclass(frozen=True)
class RadialSpec(RangedSensorSpec):
    """Sensors around the body that look outwards."""

    angles_deg: tuple[float, ...] = parameter(help="where each sensor looks, counter-clockwise from ahead", unit="deg")

    @cached_property
    def angle_rad(self) -> FloatArray:
        """The directions of the sensors in the body's frame, in (-pi, pi], (sensors,)."""
        return _directions(np.deg2rad(np.array(self.angles_deg, np.float64)))

    @cached_property
    def direction(self) -> tuple[FloatArray, FloatArray]:
        """Cosine and sine of `angle_rad`, (sensors,) each."""
        return np.cos(self.angle_rad), np.sin(self.angle_rad)


@dataclass(frozen=True)
class ResponseCurve:
    """The answer of an infrared sensor to distance d in m from the rim: a falling curve, clipped to [0, 1].

    `rational`: 1 below `full_m`, else a / (d + b), zero beyond `reach_m`.
    `inverse_square`: the same with a / (d + b)^2.
    `quadratic`: a d^2 + b d + c, zero beyond `reach_m`; linear if a is 0.
    """

    kind: str = parameter(help="form of the curve", choices=FORMS)
    a: float = parameter(help="coefficient a")
    b: float = parameter(help="coefficient b")
    reach_m: float = parameter(help="beyond this the answer is 0", unit="m", above=0)
    c: float = parameter(0.0, help="coefficient c (quadratic)")
    full_m: float = parameter(0.0, help="below this the answer is 1 (not quadratic)", unit="m", at_least=0)

    def value(self, distance_m: FloatArray) -> FloatArray:
        """The response, 0 to 1, to these distances (any shape)."""
        if self.kind == "quadratic":
            value = self.a * distance_m * distance_m + self.b * distance_m + self.c
        else:
            beyond_m = np.maximum(distance_m, max(self.full_m, SMALLEST)) + self.b
            falling = self.a / (beyond_m if self.kind == "rational" else beyond_m * beyond_m)
            value = np.where(distance_m < self.full_m, 1.0, falling)
        return np.where(distance_m <= self.reach_m, np.clip(value, 0.0, 1.0), 0.0)

    def distance_m(self, value: FloatArray) -> FloatArray:
        """The distance at which an ideal sensor answers `value`; `reach_m` where the value is 0 (any shape)."""
        positive = np.maximum(value, SMALLEST)
        if self.kind == "rational":
            distance = self.a / positive - self.b
        elif self.kind == "inverse_square":
            distance = np.sqrt(self.a / positive) - self.b
        elif self.a == 0.0:
            distance = (positive - self.c) / self.b
        else:
            root = np.sqrt(np.maximum(self.b * self.b - 4.0 * self.a * (self.c - positive), 0.0))
            distance = (-self.b - root) / (2.0 * self.a)
        return np.where(value > 0.0, np.clip(distance, 0.0, self.reach_m), self.reach_m)


@dataclass(frozen=True)
class RayArraySpec(RadialSpec):
    """Rays that start at the body's rim and answer to the nearest object on them."""

    range_m: float = parameter(help="length of a ray from the rim", unit="m", above=0)
    response: ResponseCurve = parameter(help="answer to distance")
    noise: float = parameter(0.0, help="half width of the uniform noise added to the response", at_least=0, at_most=1)

    def fault(self, radius_m: float) -> tuple[str, str] | None:
        """As `SensorSpec.fault`."""
        answers = self.response.value(np.linspace(0.0, self.response.reach_m, 100))
        if np.any(np.diff(answers) > 0.0) or answers[0] <= answers[-1]:
            return "response", "expected a curve that falls from the rim to reach_m"
        return None


@dataclass(frozen=True)
class ProximitySpec(RayArraySpec):
    """Active infrared: rays from the rim that answer to the nearest robot, obstacle or wall by its reflection.

    Readings: value (n, rays), 0 to 1.
    """


@dataclass(frozen=True)
class InfraredSpec(RayArraySpec):
    """Passive infrared: rays from the rim that answer to the light of the nearest robot, unless an obstacle hides it.

    Proximity sensors answer to robots and walls, these to robots only: both together distinguish them. Readings: value
    (n, rays), 0 to 1.
    """


@dataclass(frozen=True)
class LightSpec(RadialSpec):
    """Photocells that answer to the arena's lights. Readings: value (n, sensors), 0 dark to 1."""

    noise: float = parameter(0.0, help="half width of the uniform noise added to the response", at_least=0, at_most=1)


@dataclass(frozen=True)
class ScanSpec(RangedSensorSpec):
    """A laser scanner: the distance to the nearest object on each ray, all at one height.

    Readings: range_m (n, rays), inf where nothing is within the range.
    """

    rays: int = parameter(help="how many rays", at_least=1, at_most=10_000)
    range_m: float = parameter(help="length of a ray from the scanner", unit="m", above=0)
    range_min_m: float = parameter(0.0, help="what is nearer than this reads as if it were there", unit="m", at_least=0)
    first_deg: float = parameter(0.0, help="where the first ray looks, counter-clockwise from ahead", unit="deg")
    span_deg: float = parameter(
        FULL_DEG,
        help="angle from the first ray to the last; 360: rays all around, the last one step before the first",
        unit="deg",
        above=0,
        at_most=FULL_DEG,
    )
    at_m: float = parameter(0.0, help="how far ahead of the body's centre the scanner stands", unit="m")
    noise_m: float = parameter(0.0, help="standard deviation of the error", unit="m", at_least=0)
    noise_relative: float = parameter(0.0, help="and that share of the distance", at_least=0, at_most=1)

    def fault(self, radius_m: float) -> tuple[str, str] | None:
        """As `SensorSpec.fault`."""
        if self.range_min_m >= self.range_m:
            return "range_min_m", f"expected less than range_m, got {self.range_min_m!r}"
        if abs(self.at_m) > radius_m:
            return "at_m", f"expected a place on the body, whose radius is {radius_m:g} m; got {self.at_m!r}"
        return None

    @property
    def step_rad(self) -> float:
        """The angle between two rays."""
        gaps = self.rays if self.span_deg == FULL_DEG else max(self.rays - 1, 1)
        return float(np.deg2rad(self.span_deg) / gaps)

    @cached_property
    def angle_rad(self) -> FloatArray:
        """The directions of the rays in the body's frame, in (-pi, pi], (rays,)."""
        return _directions(np.deg2rad(self.first_deg) + self.step_rad * np.arange(self.rays))

    @cached_property
    def direction(self) -> tuple[FloatArray, FloatArray]:
        """Cosine and sine of `angle_rad`, (rays,) each."""
        return np.cos(self.angle_rad), np.sin(self.angle_rad)
