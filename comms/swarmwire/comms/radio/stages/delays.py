"""Stages that delay reception: latency with jitter, varying delay by a distribution, and propagation delay.

Each varying delay is a quantile of one uniform draw.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from swarmwire.comms.base import math as portable
from swarmwire.comms.base.arrays import AnyArray, FloatArray
from swarmwire.comms.base.clock import NS_PER_S, to_ns
from swarmwire.comms.base.draws import purpose
from swarmwire.comms.base.draws_compiled import normal_quantile
from swarmwire.comms.base.kernels import kernel, njit
from swarmwire.comms.base.math import compiled as math_compiled
from swarmwire.comms.radio.config.impairments import DISTRIBUTIONS, Delays
from swarmwire.comms.radio.context import ChannelContext
from swarmwire.comms.radio.links import RECEIVED, Links
from swarmwire.comms.radio.stages.link_draws import LinkDraws, uniform_of_link
from swarmwire.comms.radio.stages.measurements import to_sender_m
from swarmwire.comms.radio.stages.stage import Stage

UNIFORM, NORMAL, LOGNORMAL, PARETO = range(4)
MAX_NS = 86_400 * NS_PER_S  # a day, so that the delays of a heavy tail fit an integer
SMALLEST_TAIL = 2.0**-54  # half of a draw's smallest step, so that no quantile is infinite
DELAY, DELAYS = purpose("delay"), purpose("delays")


class DelayDistribution(NamedTuple):
    """Parameters of a delay distribution, as input of kernels."""

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


class Latency(Stage):
    """`received_at = off_air_at + latency + U[0, jitter)`, in integer ns."""

    name = "latency"
    keys = ("latency_s", "jitter_s")

    @classmethod
    def create(cls, context: ChannelContext) -> Stage | None:
        """Return the stage if the radio has latency or jitter."""
        return Latency(context) if context.radio.latency_s > 0.0 or context.radio.jitter_s > 0.0 else None

    def __init__(self, context: ChannelContext) -> None:
        self._latency_ns, self._jitter_ns = to_ns(context.radio.latency_s), to_ns(context.radio.jitter_s)
        self._draws = LinkDraws(context.keys, context.robots)

    def decide(self, links: Links, pose: FloatArray) -> None:
        """Delay received links."""
        add_latency(links.final_at_ns, self._draws, links.columns, self._latency_ns, self._jitter_ns)


@kernel(from_python=True)
def add_latency(at_ns: AnyArray, draws: Any, links: Any, latency_ns: int, jitter_ns: int):
    """Add latency + floor(u x jitter) to the times `at_ns` (k,) of received links, u keyed by link."""
    for i in range(len(at_ns)):
        if links.fate[i] == RECEIVED:
            at_ns[i] += latency_ns
            if jitter_ns > 0:
                at_ns[i] += np.int64(uniform_of_link(draws, links, i, DELAY) * jitter_ns)


class VaryingDelay(Stage):
    """Adds a delay from a distribution to `received_at`."""

    name = "varying_delay"
    keys = ("delays",)

    @classmethod
    def create(cls, context: ChannelContext) -> Stage | None:
        """Return the stage if the radio has such delays."""
        return VaryingDelay(context) if context.radio.delays is not None else None

    def __init__(self, context: ChannelContext) -> None:
        assert context.radio.delays is not None
        self._params, self._draws = delay_distribution(context.radio.delays), LinkDraws(context.keys, context.robots)

    def decide(self, links: Links, pose: FloatArray) -> None:
        """Delay received links."""
        add_varying_delay(links.final_at_ns, self._params, self._draws, links.columns)


@kernel(from_python=True)
def add_varying_delay(at_ns: AnyArray, params: Any, draws: Any, links: Any):
    """Add a delay by the distribution to the times `at_ns` (k,) of received links, u keyed by link."""
    for i in range(len(at_ns)):
        if links.fate[i] == RECEIVED:
            at_ns[i] += varying_delay_ns(params, uniform_of_link(draws, links, i, DELAYS))


class PropagationDelay(Stage):
    """Adds distance / speed to `received_at`: the distance of the centres when the packet went on air."""

    name = "propagation_delay"
    keys = ("propagation_mps",)

    @classmethod
    def create(cls, context: ChannelContext) -> Stage | None:
        """Return the stage if the radio sets a propagation speed."""
        speed_mps = context.radio.propagation_mps
        return None if speed_mps is None else PropagationDelay(speed_mps, context.wrap_m)

    def __init__(self, speed_mps: float, wrap_m: tuple[float, float]) -> None:
        self._speed_mps, self._wrap_m = speed_mps, wrap_m

    def decide(self, links: Links, pose: FloatArray) -> None:
        """Delay received links."""
        add_propagation_delay(links.final_at_ns, pose, links.columns, self._speed_mps, self._wrap_m)


@kernel(from_python=True)
def add_propagation_delay(at_ns: AnyArray, pose: Any, links: Any, speed_mps: float, wrap_m: tuple[float, float]):
    """Add the time of propagation in whole ns (rounded down) to the times `at_ns` (k,) of received links."""
    for i in range(len(at_ns)):
        if links.fate[i] == RECEIVED:
            dx, dy = to_sender_m(pose, links.sender[i], links.receiver[i], wrap_m)
            at_ns[i] += np.int64(np.sqrt(dx * dx + dy * dy) / speed_mps * NS_PER_S)
