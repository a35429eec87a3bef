"""Readings of sensors around a body. Arrays have a leading axis n for a VectorAgent."""

from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.sheets import Ring

S = TypeVar("S", bound=Ring)


@dataclass(frozen=True)
class Around(Generic[S]):
    """Sensors around a body, in the data sheet's order (use the angles, never the indices)."""

    value: FloatArray  # (…, sensors) the response, 0 to 1
    sheet: S

    @property
    def angle_rad(self) -> FloatArray:
        """Where the sensors look in the body's frame, (sensors,)."""
        return self.sheet.angle_rad


class AroundOne(Around[S]):
    """Those of one robot."""

    def vector_sum(self) -> tuple[float, float]:
        """X and y of the sum of the sensors as vectors, `value` long towards `angle_rad`: where most of it is."""
        cosine, sine = self.sheet.direction
        return float(np.add.reduce(self.value * cosine)), float(np.add.reduce(self.value * sine))


class AroundMany(Around[S]):
    """Those of n robots."""

    def vector_sum(self) -> tuple[FloatArray, FloatArray]:
        """X and y, (n,) each, of the sum of each robot's sensors as vectors, `value` long towards `angle_rad`."""
        cosine, sine = self.sheet.direction
        return np.add.reduce(self.value * cosine, 1), np.add.reduce(self.value * sine, 1)
