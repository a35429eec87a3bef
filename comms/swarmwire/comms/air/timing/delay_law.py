"""Delays that vary from packet to packet, by distribution: each is a quantile of one uniform draw."""

# pyright: basic, reportUnknownMemberType=false

import math
from typing import NamedTuple

from numba import njit

from swarmwire.comms.air.parameters.delays import DISTRIBUTIONS, Delays
from swarmwire.comms.clock import NS_PER_S
from swarmwire.comms.draws_compiled import normal_quantile

UNIFORM, NORMAL, LOGNORMAL, PARETO = range(4)
LONGEST_NS = 86_400 * NS_PER_S  # a day: a heavy tail's time still fits an integer
SMALLEST_TAIL = 2.0**-54  # half a step of a draw, so that no quantile is infinite


class DelayLaw(NamedTuple):
    """A distribution's numbers, as kernels take them."""

    distribution: int
    first: float
    second: float
    third: float


def delay_law(delays: Delays) -> DelayLaw:
    """The law with this mean and deviation.

    Uniform: lowest (s) and width (s). Normal: mean (s), deviation (s), share that is cut off. Lognormal: mean and
    deviation of ln(delay / s). Pareto: least delay (s) and -1 / shape, with shape 1 + sqrt(1 + mean^2 / variance).
    """
    mean_s, deviation_s = delays.mean_s, delays.deviation_s
    kind = DISTRIBUTIONS.index(delays.distribution)
    if kind == UNIFORM:
        half_s = math.sqrt(3.0) * deviation_s
        return DelayLaw(kind, mean_s - half_s, 2.0 * half_s, 0.0)
    if kind == NORMAL:
        return DelayLaw(kind, mean_s, deviation_s, 0.5 * math.erfc(mean_s / (deviation_s * math.sqrt(2.0))))
    if kind == LOGNORMAL:
        variance = math.log1p((deviation_s / mean_s) ** 2)
        return DelayLaw(kind, math.log(mean_s) - 0.5 * variance, math.sqrt(variance), 0.0)
    shape = 1.0 + math.sqrt(1.0 + (mean_s / deviation_s) ** 2)
    return DelayLaw(kind, mean_s * (shape - 1.0) / shape, -1.0 / shape, 0.0)


@njit(cache=True)
def varying_delay_ns(law, u):
    """The delay in whole ns (rounded down, at most a day) of a uniform draw u in [0, 1); it never falls with u."""
    if law.distribution == UNIFORM:
        delay_s = law.first + law.second * u
    elif law.distribution == NORMAL:
        # From the nearer tail: 1 - p would lose the digits of a small one.
        above = max((1.0 - law.third) * (1.0 - u), SMALLEST_TAIL)
        below = law.third + (1.0 - law.third) * u
        z = -normal_quantile(above) if above < 0.5 else normal_quantile(max(below, SMALLEST_TAIL))
        delay_s = max(law.first + law.second * z, 0.0)
    elif law.distribution == LOGNORMAL:
        delay_s = math.exp(law.first + law.second * normal_quantile(u + SMALLEST_TAIL))
    else:
        delay_s = law.first * (1.0 - u) ** law.second
    return int(min(delay_s * NS_PER_S, LONGEST_NS))
