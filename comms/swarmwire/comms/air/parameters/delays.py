"""What a scenario says of delays. No kernels here: a scenario is read without a compiler."""

import math
from dataclasses import dataclass

from swarmwire.comms.errors import BadInput
from swarmwire.comms.parameters import parameter

DISTRIBUTIONS = ("uniform", "normal", "lognormal", "pareto")


@dataclass(frozen=True)
class Delays:
    """Mean and spread of a delay; a normal one is cut off below 0, which lifts a mean of less than 3 deviations."""

    distribution: str = parameter("lognormal", help="how delays are spread", choices=DISTRIBUTIONS)
    mean_s: float = parameter(0.01, help="mean delay", unit="s", above=0, at_most=3600)
    deviation_s: float = parameter(0.005, help="standard deviation of the delay", unit="s", above=0, at_most=3600)
    keep_order: bool = parameter(
        False, help="a packet waits for those that its sender had on air before and that its receiver still has to hear"
    )


def refuse_negative(delays: Delays, where: str, key: str) -> None:
    """Raise `BadInput` for a uniform delay that would reach below 0: mean - sqrt(3) deviation."""
    most_s = delays.mean_s / math.sqrt(3.0)
    if delays.distribution == "uniform" and delays.deviation_s > most_s:
        raise BadInput(where, f"{key}.deviation_s", f"expected at most {most_s:g} s for this mean")
