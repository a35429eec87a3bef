"""Sensors around a body."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.parameters import parameter
from swarmwire.comms.sheets.sheet import RangedSheet


def within_a_turn(angle_rad: FloatArray) -> FloatArray:
    """These angles in (-pi, pi], not to be written to."""
    wrapped = np.arctan2(np.sin(angle_rad), np.cos(angle_rad))
    wrapped.setflags(write=False)
    return wrapped


@dataclass(frozen=True)
class Ring(RangedSheet):
    """Sensors around the body that look outwards."""

    angles_deg: tuple[float, ...] = parameter(help="where each sensor looks, counter-clockwise from ahead", unit="deg")

    @cached_property
    def angle_rad(self) -> FloatArray:
        """Where the sensors look in the body's frame, in (-pi, pi], (sensors,)."""
        return within_a_turn(np.deg2rad(np.array(self.angles_deg, np.float64)))

    @cached_property
    def direction(self) -> tuple[FloatArray, FloatArray]:
        """Cosine and sine of `angle_rad`, (sensors,) each."""
        return np.cos(self.angle_rad), np.sin(self.angle_rad)
