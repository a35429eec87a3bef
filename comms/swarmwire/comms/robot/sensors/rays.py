"""Infrared rays from the rim of the body: the sensors `proximity` (active) and `infrared` (passive).

A `ResponseCurve` maps the distance from the rim to the response. Angles of a spec are in degrees, counter-clockwise
from ahead; `angle_rad` has them in (-pi, pi]. `RadialSpec` and `RadialReading` serve the light sensor too.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, ClassVar, Generic, Self, TypeVar, cast

import numpy as np

from swarmwire.comms.base import math as portable
from swarmwire.comms.base.angles import wrap_by_atan2
from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.config import parameter
from swarmwire.comms.robot.sensors.sensor import Draw, Field, LazyArray, N, Noise, RangedSensorSpec

FORMS = ("rational", "inverse_square", "quadratic")  # compiled code uses the index in this tuple
MIN_DIVISOR = 1e-9  # lower bound of values and distances that a curve divides by


def ray_directions(angle_rad: FloatArray) -> FloatArray:
    """Wrap directions in a body's frame to (-pi, pi]; the array is read-only, since all robots share it."""
    wrapped = wrap_by_atan2(angle_rad)
    wrapped.setflags(write=False)
    return wrapped


@dataclass(frozen=True)
class RadialSpec(RangedSensorSpec):
    """Sensors around the body that look outwards."""

    angles_deg: tuple[float, ...] = parameter(help="direction of each sensor, counter-clockwise from ahead", unit="deg")

    @cached_property
    def angle_rad(self) -> FloatArray:
        """The directions of the sensors in the body's frame, in (-pi, pi], (sensors,)."""
        return ray_directions(np.deg2rad(np.array(self.angles_deg, np.float64)))

    @cached_property
    def direction(self) -> FloatArray:
        """Cosine and sine of `angle_rad`, (sensors, 2)."""
        return np.stack([portable.cos(self.angle_rad), portable.sin(self.angle_rad)], 1)

    @cached_property
    def direction_lists(self) -> tuple[list[float], list[float]]:
        """`direction` as lists."""
        cosine, sine = self.direction.T.tolist()
        return cosine, sine


S = TypeVar("S", bound=RadialSpec)


@dataclass(frozen=True)
class RadialReading(Generic[N, S]):
    """A reading of sensors around the body, in the order of the spec (use the angles, never the indices)."""

    value: FloatArray  #: (…, sensors) the response, 0 to 1
    spec: S
    if not TYPE_CHECKING:
        value = LazyArray()

    @property
    def angle_rad(self) -> FloatArray:
        """Directions of the sensors in the body's frame, in (-pi, pi], 0 ahead, positive to the left, (sensors,)."""
        return self.spec.angle_rad

    def vector_sum(self) -> tuple[N, N]:
        """X and y of the vector sum: each sensor is a vector of length `value` towards its `angle_rad`."""
        value: FloatArray | memoryview = self.__dict__["value"]
        if value.ndim == 1:  # called once per robot and tick: plain floats are faster than arrays of a few numbers
            values = cast("list[float]", value.tolist())
            cosines, sines = self.spec.direction_lists
            x = lane_sum([length * cosine for length, cosine in zip(values, cosines, strict=True)])
            y = lane_sum([length * sine for length, sine in zip(values, sines, strict=True)])
            return cast("tuple[N, N]", (x, y))
        columns, direction = np.ascontiguousarray(self.value.T), self.spec.direction
        if columns.size < SMALL:
            x, y = weighted_lane_sum(columns[:, None, :], direction[:, :, None])
        else:
            x, y = (weighted_lane_sum(columns, direction[:, k, None]) for k in range(2))
        return cast("tuple[N, N]", (x, y))


LANES = 8  # running sums of `lane_sum`
SMALL = 4096  # values; x and y of so few are summed together in half the time, of more in twice the time


def lane_sum(terms: list[float]) -> float:
    """Return the sum in an order of our own, which does not depend on numpy or Python.

    Up to seven terms are added from left to right. More go in turn into eight running sums, which are added in pairs.
    """
    if len(terms) < LANES:
        total = 0.0
        for term in terms:  # `sum` compensates for rounding from Python 3.12 on
            total = total + term
        return total
    lanes = terms[:LANES]
    for k, term in enumerate(terms[LANES:]):
        lanes[k % LANES] = lanes[k % LANES] + term
    a, b, c, d, e, f, g, h = lanes
    return 0.0 + (((a + b) + (c + d)) + ((e + f) + (g + h)))  # 0.0: a sum of zeros is not negative


def weighted_lane_sum(rows: FloatArray, weights: FloatArray) -> FloatArray:
    """Return the sum of `rows` (k, …) times `weights` (k, …), in the order and rounding of `lane_sum`.

    Eight rows at a time stay in the processor's cache, which is a third faster than the product of all.
    """
    if len(rows) < LANES:
        total = np.array(0.0)
        for row, weight in zip(rows, weights, strict=True):
            total = total + row * weight
        return total
    if (compiled := portable.COMPILED.get("weighted_sum")) and rows.ndim == 2 and weights.shape[1] == 1:
        out = np.empty(rows.shape[1])
        compiled(np.ascontiguousarray(rows), np.ascontiguousarray(weights[:, 0]), out)
        return out
    lanes = rows[:LANES] * weights[:LANES]
    for first in range(LANES, len(rows), LANES):
        terms = rows[first : first + LANES] * weights[first : first + LANES]
        lanes[: len(terms)] += terms
    pairs = lanes[::2] + lanes[1::2]
    quads = pairs[::2] + pairs[1::2]
    return 0.0 + (quads[0] + quads[1])


@dataclass(frozen=True)
class ResponseCurve:
    """Response of an infrared sensor to distance d in m from the rim: a falling curve, clipped to [0, 1].

    `rational`: 1 below `full_m`, else a / (d + b), zero beyond `reach_m`.
    `inverse_square`: the same with a / (d + b)^2.
    `quadratic`: a d^2 + b d + c, zero beyond `reach_m`; linear if a is 0.
    """

    kind: str = parameter(help="form of the curve", choices=FORMS)
    a: float = parameter(help="coefficient a")
    b: float = parameter(help="coefficient b")
    reach_m: float = parameter(help="beyond this the response is 0", unit="m", above=0)
    c: float = parameter(0.0, help="coefficient c (quadratic)")
    full_m: float = parameter(0.0, help="below this the response is 1 (not quadratic)", unit="m", at_least=0)

    def value(self, distance_m: FloatArray) -> FloatArray:
        """Return the response, 0 to 1, at these distances (any shape)."""
        if self.kind == "quadratic":
            value = self.a * distance_m * distance_m + self.b * distance_m + self.c
        else:
            beyond_m = np.maximum(distance_m, max(self.full_m, MIN_DIVISOR)) + self.b
            falling = self.a / (beyond_m if self.kind == "rational" else beyond_m * beyond_m)
            value = np.where(distance_m < self.full_m, 1.0, falling)
        return np.where(distance_m <= self.reach_m, np.clip(value, 0.0, 1.0), 0.0)

    def distance_m(self, value: FloatArray) -> FloatArray:
        """Return the distance at which an ideal sensor reads `value`; `reach_m` where the value is 0 (any shape)."""
        positive = np.maximum(value, MIN_DIVISOR)
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
    """Rays that start at the body's rim and respond to the nearest object on them."""

    meaning: ClassVar[str]  #: meaning of a reading's value

    range_m: float = parameter(help="length of a ray from the rim", unit="m", above=0)
    response: ResponseCurve = parameter(help="response to distance")
    noise: float = parameter(0.0, help="half width of the uniform noise added to the response", at_least=0, at_most=1)

    @classmethod
    def example(cls) -> Self:
        """Return a typical ring of rays."""
        curve = ResponseCurve("rational", a=0.01, b=0.001, reach_m=0.5)
        return cls(angles_deg=(0.0, 90.0, 200.0), range_m=0.5, response=curve, noise=0.1)

    def fault(self, radius_m: float) -> tuple[str, str] | None:
        """Return the expectation for a response curve that does not fall with distance."""
        responses = self.response.value(np.linspace(0.0, self.response.reach_m, 100))
        if np.any(np.diff(responses) > 0.0) or responses[0] <= responses[-1]:
            return "response", "expected a curve that falls from the rim to reach_m"
        return None

    def reading_fields(self) -> tuple[Field, ...]:
        """Return the field `value`, with a number per ray."""
        noise, width = Noise("uniform", self.noise), len(self.angle_rad)
        return (Field("value", width, noise, self.step, 0.0, 1.0, blank=0.0, help=self.meaning, per="rays"),)

    def synthetic(self, name: str, tick: int, draw: Draw) -> tuple[FloatArray, ...]:
        """Return random responses; half of the rays meet nothing."""
        return (np.maximum(draw(name, len(self.angles_deg)) * 2.0 - 1.0, 0.0),)


R = TypeVar("R", bound=RayArraySpec)


class RayArrayReading(RadialReading[N, R]):
    """A reading of rays that start at the body's rim."""

    @cached_property
    def distance_m(self) -> FloatArray:
        """Distance from the rim at which an ideal ray reads `value`; the ray's range if it reads 0, (…, rays)."""
        return self.spec.response.distance_m(self.value)


@dataclass(frozen=True)
class ProximitySpec(RayArraySpec):
    """Active infrared: rays from the rim that respond to the nearest robot, obstacle or wall by its reflection.

    Readings: value (n, rays), 0 to 1.
    """

    truth: ClassVar[str] = "swarmwire.world.sensors.rays:ProximitySensor"
    meaning: ClassVar[str] = "response of each ray: 0 nothing, 1 touching"


class ProximityReading(RayArrayReading[N, ProximitySpec]):
    """Proximity rays, (…, rays): 0 for nothing, 1 for touching."""


@dataclass(frozen=True)
class InfraredSpec(RayArraySpec):
    """Passive infrared: rays from the rim that respond to the light of the nearest robot, unless an obstacle hides it.

    Proximity sensors respond to robots and walls, these to robots only; both together distinguish the two.
    Readings: value (n, rays), 0 to 1.
    """

    truth: ClassVar[str] = "swarmwire.world.sensors.rays:InfraredSensor"
    meaning: ClassVar[str] = "response of each ray: 0 no robot, 1 touching one; walls, obstacles and the dead are dark"


class InfraredReading(RayArrayReading[N, InfraredSpec]):
    """Rays of passive infrared, (…, rays): 0 for no robot, 1 for touching one."""
