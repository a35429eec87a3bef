"""Odometry: what the wheels have rolled."""

from dataclasses import dataclass

from swarmwire.comms.parameters import parameter
from swarmwire.comms.sheets.sheet import Sheet


@dataclass(frozen=True)
class Odometry(Sheet):
    """Encoders on the two wheels. Sense: left_m, right_m (n,), travelled since the start, in whole encoder steps.

    Each wheel has an error of its own that stays (its diameter), and slips anew in each tick. What heading and place
    follow from it is the agent's to work out.
    """

    slip: float = parameter(0.0, help="standard deviation of a tick's relative error", at_least=0, at_most=1)
    wheel_error_std: float = parameter(
        0.0, help="standard deviation of each wheel's relative error, drawn once per robot", at_least=0, at_most=1
    )
    step_m: float = parameter(0.0, help="travel per encoder step; 0: not quantised", unit="m", at_least=0)
