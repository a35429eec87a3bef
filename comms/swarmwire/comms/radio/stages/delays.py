"""Stages that delay reception: latency with jitter, varying delay by a distribution, and propagation delay.

Each varying delay is a quantile of one uniform draw.
"""

import math
from typing import Any, ClassVar, NamedTuple

import numpy as np

from swarmwire.comms.base import math as portable
from swarmwire.comms.base.clock import NS_PER_S, to_ns
from swarmwire.comms.base.draws import purpose
from swarmwire.comms.base.draws_compiled import normal_quantile
from swarmwire.comms.base.kernels import kernel, njit
from swarmwire.comms.base.math import compiled as math_compiled
from swarmwire.comms.radio.config.impairments import DISTRIBUTIONS, Delays
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.context import ChannelContext
from swarmwire.comms.radio.stages.link_draws import link_uniform
from swarmwire.comms.radio.stages.stage import Stage

UNIFORM, NORMAL, LOGNORMAL, PARETO = range(4)
MAX_NS = 86_400 * NS_PER_S  # a day, so that the delays of a heavy tail fit an integer
SMALLEST_TAIL = 2.0**-54  # half of a draw's smallest step, so that no quantile is infinite
DELAY, DELAYS = purpose("delay"), purpose("delays")


class DelayDistribution(NamedTuple):
    """Parameters of a delay distribution."""

    distribution: int
    first: float
    second: float
    third: float


def delay_distribution(delays: Delays) -> DelayDistribution:
    """Return the distribution with this mean and deviation.

    Uniform: lowest (s) and width (s). Normal: mean (s), deviation (s), share below 0, which is cut off. Lognormal: mean
    and deviation of ln(delay / s). Pareto: least delay (s) and -1 / shape, with shape 1 + sqrt(1 + mean^2 / variance).
    """
    mean_s, deviation_s = delays.mean_s, delays.deviation_s
    kind = DISTRIBUTIONS.index(delays.distribution)
    if kind == UNIFORM:
        half_s = math.sqrt(3.0) * deviation_s
        return DelayDistribution(kind, mean_s - half_s, 2.0 * half_s, 0.0)
    if kind == NORMAL:
        return DelayDistribution(
            kind, mean_s, deviation_s, 0.5 * portable.erfc(mean_s / (deviation_s * math.sqrt(2.0)))
        )
    if kind == LOGNORMAL:
        variance = portable.log1p((deviation_s / mean_s) * (deviation_s / mean_s))
        return DelayDistribution(kind, portable.log(mean_s) - 0.5 * variance, math.sqrt(variance), 0.0)
    shape = 1.0 + math.sqrt(1.0 + (mean_s / deviation_s) * (mean_s / deviation_s))
    return DelayDistribution(kind, mean_s * (shape - 1.0) / shape, -1.0 / shape, 0.0)


@njit()
def varying_delay_ns(params: Any, u: float):
    """Return the delay in whole ns (rounded down, at most a day) of a uniform draw u in [0, 1); rises with u."""
    if params.distribution == UNIFORM:
        delay_s = params.first + params.second * u
    elif params.distribution == NORMAL:
        # From the nearer tail, since 1 - p loses the digits of a small p.
        above = max((1.0 - params.third) * (1.0 - u), SMALLEST_TAIL)
        below = params.third + (1.0 - params.third) * u
        z = -normal_quantile(above) if above < 0.5 else normal_quantile(max(below, SMALLEST_TAIL))
        delay_s = max(params.first + params.second * z, 0.0)
    elif params.distribution == LOGNORMAL:
        delay_s = math_compiled.exp(params.first + params.second * normal_quantile(u + SMALLEST_TAIL))
    else:
        delay_s = params.first * math_compiled.power(1.0 - u, params.second)
    return int(min(delay_s * NS_PER_S, MAX_NS))


@kernel()
def latency_ns(params: Any, frame: Any):
    """Return latency + floor(u x jitter) in ns."""
    if params.jitter_ns == 0:
        return params.latency_ns
    return params.latency_ns + np.int64(link_uniform(frame, DELAY) * params.jitter_ns)


class Latency(Stage):
    """`received_at = off_air_at + latency + U[0, jitter)`, in integer ns."""

    name = "latency"
    keys = ("latency_s", "jitter_s")
    FIELDS: ClassVar = [("latency_ns", np.int64), ("jitter_ns", np.int64)]

    @classmethod
    def create(cls, context: ChannelContext) -> Stage | None:
        """Return the stage if the radio has latency or jitter."""
        return Latency(context.radio) if context.radio.latency_s > 0.0 or context.radio.jitter_s > 0.0 else None

    def __init__(self, radio: Radio) -> None:
        self._latency_ns, self._jitter_ns = to_ns(radio.latency_s), to_ns(radio.jitter_s)

    def write(self, params: Any) -> None:
        """Set latency and jitter."""
        params.latency_ns, params.jitter_ns = self._latency_ns, self._jitter_ns


@kernel()
def frame_delay_ns(params: Any, frame: Any):
    """Return a delay by the distribution, in ns; 0 without one."""
    return varying_delay_ns(params, link_uniform(frame, DELAYS)) if params.is_used else 0


class VaryingDelay(Stage):
    """Adds a delay from a distribution to `received_at`."""

    name = "varying_delay"
    keys = ("delays",)
    FIELDS: ClassVar = [
        ("is_used", np.bool_),
        ("distribution", np.int64),
        *((name, np.float64) for name in DelayDistribution._fields[1:]),
    ]

    @classmethod
    def create(cls, context: ChannelContext) -> Stage | None:
        """Return the stage if the radio has such delays."""
        delays = context.radio.delays
        return None if delays is None else VaryingDelay(delay_distribution(delays))

    def __init__(self, distribution: DelayDistribution) -> None:
        self._distribution = distribution

    def write(self, params: Any) -> None:
        """Set the distribution."""
        params.is_used = True
        params.distribution, params.first, params.second, params.third = self._distribution


@kernel()
def propagation_delay_ns(params: Any, distance_m: float):
    """Return distance / speed in whole ns (rounded down); 0 without a speed."""
    return np.int64(distance_m / params.speed_mps * NS_PER_S) if params.speed_mps > 0.0 else 0


class PropagationDelay(Stage):
    """Adds distance / speed to `received_at`: the distance of the centres when the packet went on air."""

    name = "propagation_delay"
    keys = ("propagation_mps",)
    FIELDS: ClassVar = [("speed_mps", np.float64)]

    @classmethod
    def create(cls, context: ChannelContext) -> Stage | None:
        """Return the stage if the radio sets a propagation speed."""
        speed_mps = context.radio.propagation_mps
        return None if speed_mps is None else PropagationDelay(speed_mps)

    def __init__(self, speed_mps: float) -> None:
        self._speed_mps = speed_mps

    def write(self, params: Any) -> None:
        """Set the speed."""
        params.speed_mps = self._speed_mps
