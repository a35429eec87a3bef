"""Positioning: where a tracking camera sees the robot."""

from dataclasses import dataclass
from typing import ClassVar

from swarmwire.comms.parameters import parameter
from swarmwire.comms.sheets.sheet import RangedSheet


@dataclass(frozen=True)
class Positioning(RangedSheet):
    """The position in the arena's frame, as a tracking camera tells it. Sense: x_m, y_m (n,)."""

    is_global: ClassVar[bool] = True

    noise_m: float = parameter(
        0.0, help="standard deviation of the error along each axis, new in each tick", unit="m", at_least=0
    )
