"""Sensors around a body."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.parameters import parameter
from swarmwire.comms.sheets.sheet import RangedSheet


@dataclass(frozen=True)
class Ring(RangedSheet):
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
