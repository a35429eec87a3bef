"""The magnetometer of the e-puck2 as a compass.

Its axes depend on the chip, of which there have been two. The x of the chip's accelerometer is to the left, its y to
the back (e_lsm330.c); the firmware turns y round on its way into the packet (mpu9250.c, e_acc.c). The older
magnetometer has x and y swapped, which agrees with the firmware's own compass (main.c, selector 14: the LED to the
north is lit); the newer has x as the accelerometer, and y against it (data sheets).
"""

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.arrays import AnyArray, FloatArray
from swarmwire.comms.sheets.ring import within_a_turn

CHIPS = ("mpu9250", "icm20948")  # the second in robots from about 2025 on


@dataclass(frozen=True, slots=True)
class Compass:
    """One robot's magnetometer, and where magnetic north lies in its arena."""

    chip: str
    north_rad: float  # heading of magnetic north in the arena, counter-clockwise from its +x
    offset_x_ut: float = 0.0  # what it reads in no field (hard iron)
    offset_y_ut: float = 0.0

    def heading_rad(self, field_ut: AnyArray) -> FloatArray:
        """The robot's heading (n,) in the arena, in (-pi, pi], from what its magnetometer reads (n, 3)."""
        with np.errstate(invalid="ignore"):  # a nan may be a signalling one
            wide = field_ut.astype(np.float64)  # the wire has half that
        x, y = wide[..., 0] - self.offset_x_ut, wide[..., 1] - self.offset_y_ut
        ahead, left = (-x, y) if self.chip == CHIPS[0] else (y, x)
        return within_a_turn(self.north_rad - np.arctan2(left, ahead))

    def field_ut(self, heading_rad: FloatArray, level_ut: float, down_ut: float) -> FloatArray:
        """What the magnetometer of a robot that heads there (n,) reads (n, 3) in a field of such strength."""
        north = self.north_rad - heading_rad
        ahead, left = level_ut * np.cos(north), level_ut * np.sin(north)
        x, y = (-ahead, left) if self.chip == CHIPS[0] else (left, ahead)
        return np.stack([x + self.offset_x_ut, y + self.offset_y_ut, np.full_like(x, down_ut)], axis=-1)
