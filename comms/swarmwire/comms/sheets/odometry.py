"""Odometry: what the wheels have rolled."""

from dataclasses import dataclass

from swarmwire.comms.parameters import parameter
from swarmwire.comms.sheets.sheet import Sheet


@dataclass(frozen=True)
class Odometry(Sheet):
    """Encoders on the two wheels. Sense: left_m, right_m (n,), travelled since the start, with slip and quantised."""

    slip: float = parameter(0.0, help="standard deviation of a tick's relative error", at_least=0, at_most=1)
    step_m: float = parameter(0.0, help="travel per encoder step; 0: not quantised", unit="m", at_least=0)
