"""Infrared sensors at the body's rim, and how they answer to distance."""

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.parameters import parameter
from swarmwire.comms.sheets.ring import Ring

FORMS = ("rational", "inverse_square", "quadratic")  # compiled code knows them by their places here
SMALLEST = 1e-9  # values and distances that a curve is asked for, so that nothing is divided by 0


@dataclass(frozen=True)
class ResponseCurve:
    """How an infrared sensor answers to distance d in m from the rim: a falling curve, clipped to [0, 1].

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
        """The distance at which an ideal sensor answers `value`; `reach_m` where nothing is seen (any shape)."""
        seen = np.maximum(value, SMALLEST)
        if self.kind == "rational":
            distance = self.a / seen - self.b
        elif self.kind == "inverse_square":
            distance = np.sqrt(self.a / seen) - self.b
        elif self.a == 0.0:
            distance = (seen - self.c) / self.b
        else:
            root = np.sqrt(np.maximum(self.b * self.b - 4.0 * self.a * (self.c - seen), 0.0))
            distance = (-self.b - root) / (2.0 * self.a)
        return np.where(value > 0.0, np.clip(distance, 0.0, self.reach_m), self.reach_m)


@dataclass(frozen=True)
class Rim(Ring):
    """Rays that start at the body's rim and answer to the nearest thing that they see."""

    range_m: float = parameter(help="length of a ray from the rim", unit="m", above=0)
    response: ResponseCurve = parameter(help="answer to distance")
    noise: float = parameter(0.0, help="half width of the uniform noise added to the response", at_least=0, at_most=1)

    def fault(self, radius_m: float) -> tuple[str, str] | None:
        """As `Sheet.fault`."""
        told = self.response.value(np.linspace(0.0, self.response.reach_m, 100))
        if np.any(np.diff(told) > 0.0) or told[0] <= told[-1]:
            return "response", "expected a curve that falls from the rim to reach_m"
        return None
