"""Infrared sensors at the body's rim, and how they answer to distance."""

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.parameters import parameter
from swarmwire.comms.sheets.ring import Ring


@dataclass(frozen=True)
class ResponseCurve:
    """How an infrared sensor answers to distance d in m from the rim: a falling curve, clipped to [0, 1].

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
class Rim(Ring):
    """Rays that start at the body's rim and answer to the nearest thing that they see."""

    range_m: float = parameter(help="length of a ray from the rim", unit="m", above=0)
    response: ResponseCurve = parameter(help="answer to distance")
    noise: float = parameter(0.0, help="half width of the uniform noise added to the response", at_least=0, at_most=1)
