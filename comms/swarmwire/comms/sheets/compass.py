"""The compass."""

from dataclasses import dataclass
from typing import ClassVar

from swarmwire.comms.parameters import parameter
from swarmwire.comms.sheets.sheet import RangedSheet


@dataclass(frozen=True)
class Compass(RangedSheet):
    """The heading in the arena's frame. Sense: heading_rad (n,), in (-pi, pi], 0 along the arena's +x."""

    is_global: ClassVar[bool] = True

    noise_rad: float = parameter(0.0, help="standard deviation of the error, new in each tick", unit="rad", at_least=0)
