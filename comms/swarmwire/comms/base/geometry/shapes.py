"""Obstacles and the boundary of an arena as plain values."""

from dataclasses import dataclass, replace
from math import inf
from typing import Literal

import numpy as np

from swarmwire.comms.base import math as portable
from swarmwire.comms.base.arrays import FloatArray

Boundary = Literal["walls", "open", "torus"]  # at the arena's edge: walls, nothing, or the opposite edge


@dataclass(frozen=True, slots=True)
class Obstacle:
    """An object that stops bodies and rays; a cylinder has radius_m, a box size_m, a polygon points_m."""

    shape: str  #: "cylinder" | "box" | "polygon"
    x_m: float
    y_m: float
    heading_rad: float = 0.0
    radius_m: float = 0.0
    size_m: tuple[float, float] = (0.0, 0.0)
    points_m: tuple[tuple[float, float], ...] = ()  #: convex, counter-clockwise, around (x_m, y_m) at heading 0
    height_m: float = inf  #: height of its top above the floor; inf: above everything
    mass_kg: float | None = None  #: None: fixed; else robots can push it

    @property
    def movable(self) -> bool:
        """True if robots can push it."""
        return self.mass_kg is not None

    def put_at(self, x_m: float, y_m: float, heading_rad: float) -> "Obstacle":
        """Return the same obstacle at another pose."""
        return replace(self, x_m=x_m, y_m=y_m, heading_rad=heading_rad)

    @property
    def corners_m(self) -> FloatArray:
        """Corners of a box or polygon in the arena's frame, counter-clockwise, (k, 2); a cylinder has none."""
        along, across = 0.5 * self.size_m[0], 0.5 * self.size_m[1]
        box = ((-along, -across), (along, -across), (along, across), (-along, across))
        points = np.array(box if self.shape == "box" else self.points_m, np.float64).reshape(-1, 2)
        c, s = portable.cos(self.heading_rad), portable.sin(self.heading_rad)
        x, y = points[:, 0], points[:, 1]
        return np.stack([self.x_m + (c * x - s * y), self.y_m + (s * x + c * y)], axis=1)

    @property
    def extent_m(self) -> tuple[FloatArray, FloatArray]:
        """The least and the greatest x, y, (2,) each, in the arena's frame."""
        if self.shape == "cylinder":
            centre = np.array([self.x_m, self.y_m])
            return centre - self.radius_m, centre + self.radius_m
        corners_m = self.corners_m
        return corners_m.min(axis=0), corners_m.max(axis=0)
