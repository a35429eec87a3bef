"""Stages that delay reception: latency with jitter, varying delay by a distribution, and propagation delay.

Each varying delay is a quantile of one uniform draw.
"""

# pyright: basic, reportUnknownMemberType=false

import math
from typing import NamedTuple

import numpy as np

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.clock import NS_PER_S, to_ns
from swarmwire.comms.base.draws import purpose
from swarmwire.comms.base.draws_compiled import normal_quantile, uniform
from swarmwire.comms.base.kernels import njit
from swarmwire.comms.radio.config.impairments import DISTRIBUTIONS, Delays
from swarmwire.comms.radio.links import RECEIVED, Links
from swarmwire.comms.radio.stages.measurements import to_sender_m
from swarmwire.comms.radio.stages.stage import ChannelContext, Stage

UNIFORM, NORMAL, LOGNORMAL, PARETO = range(4)
MAX_NS = 86_400 * NS_PER_S  # a day: a heavy tail's time still fits an integer
SMALLEST_TAIL = 2.0**-54  # half a step of a draw, so that no quantile is infinite
DELAY, DELAYS = purpose("delay"), purpose("delays")


class DelayDistribution(NamedTuple):
    """Parameters of a delay distribution, as input of kernels."""

    distribution: int
    first: float
    second: float
    third: float


def delay_distribution(delays: Delays) -> DelayDistribution:
    """The distribution with this mean and deviation.

    Uniform: lowest (s) and width (s). Normal: mean (s), deviation (s), share that is cut off. Lognormal: mean and
    deviation of ln(delay / s). Pareto: least delay (s) and -1 / shape, with shape 1 + sqrt(1 + mean^2 / variance).
    """
    mean_s, deviation_s = delays.mean_s, delays.deviation_s
    kind = DISTRIBUTIONS.index(delays.distribution)
    if kind == UNIFORM:
        half_s = math.sqrt(3.0) * deviation_s
        return DelayDistribution(kind, mean_s - half_s, 2.0 * half_s, 0.0)
    if kind == NORMAL:
        return DelayDistribution(kind, mean_s, deviation_s, 0.5 * math.erfc(mean_s / (deviation_s * math.sqrt(2.0))))
    if kind == LOGNORMAL:
        variance = math.log1p((deviation_s / mean_s) ** 2)
        return DelayDistribution(kind, math.log(mean_s) - 0.5 * variance, math.sqrt(variance), 0.0)
    shape = 1.0 + math.sqrt(1.0 + (mean_s / deviation_s) ** 2)
    return DelayDistribution(kind, mean_s * (shape - 1.0) / shape, -1.0 / shape, 0.0)


@njit()
def varying_delay_ns(params, u):
    """The delay in whole ns (rounded down, at most a day) of a uniform draw u in [0, 1); it never falls with u."""
    if params.distribution == UNIFORM:
        delay_s = params.first + params.second * u
    elif params.distribution == NORMAL:
        # From the nearer tail: 1 - p would lose the digits of a small one.
        above = max((1.0 - params.third) * (1.0 - u), SMALLEST_TAIL)
        below = params.third + (1.0 - params.third) * u
        z = -normal_quantile(above) if above < 0.5 else normal_quantile(max(below, SMALLEST_TAIL))
        delay_s = max(params.first + params.second * z, 0.0)
    elif params.distribution == LOGNORMAL:
        delay_s = math.exp(params.first + params.second * normal_quantile(u + SMALLEST_TAIL))
    else:
        delay_s = params.first * (1.0 - u) ** params.second
    return int(min(delay_s * NS_PER_S, MAX_NS))


class Latency(Stage):
    """`received_at = off_air_at + latency + U[0, jitter)`, in integer ns."""

    name = "latency"
    keys = ("latency_s", "jitter_s")

    @classmethod
    def of(cls, context: ChannelContext) -> Stage | None:
        """The stage, where the radio has latency or jitter."""
        return Latency(context) if context.radio.latency_s > 0.0 or context.radio.jitter_s > 0.0 else None

    def __init__(self, context: ChannelContext) -> None:
        self._latency_ns, self._jitter_ns = to_ns(context.radio.latency_s), to_ns(context.radio.jitter_s)
        self._keys, self._robots = context.keys, context.robots

    def decide(self, links: Links, pose: FloatArray) -> None:
        """Links that are received become final later."""
        delays_ns = delay_ns(
            self._keys,
            self._robots,
            links.sender,
            links.receiver,
            links.sequence,
            links.fate,
            self._latency_ns,
            self._jitter_ns,
        )
        np.add(links.final_at_ns, delays_ns, out=links.final_at_ns)


@njit()
def delay_ns(keys, robots, sender, receiver, sequence, fate, latency_ns, jitter_ns):
    """The delay in ns, (k,): latency + floor(u x jitter), u keyed by (sender, receiver, sequence).

    0 for links that ended.
    """
    delays_ns = np.zeros(len(sender), np.int64)
    for i in range(len(delays_ns)):
        if fate[i] == RECEIVED:
            delays_ns[i] = latency_ns
            if jitter_ns > 0:
                arena = sender[i] // robots
                first = arena * robots
                u = uniform(keys[arena], sender[i] - first, receiver[i] - first, sequence[i], DELAY)
                delays_ns[i] += np.int64(u * jitter_ns)
    return delays_ns


class VaryingDelay(Stage):
    """`received_at` is later by a quantile of the distribution."""

    name = "varying_delay"
    keys = ("delays",)

    @classmethod
    def of(cls, context: ChannelContext) -> Stage | None:
        """The stage, where the radio has such delays."""
        return VaryingDelay(context) if context.radio.delays is not None else None

    def __init__(self, context: ChannelContext) -> None:
        assert context.radio.delays is not None
        self._params, self._keys, self._robots = delay_distribution(context.radio.delays), context.keys, context.robots

    def decide(self, links: Links, pose: FloatArray) -> None:
        """Links that are received become final later."""
        delays_ns = drawn_ns(
            self._params, self._keys, self._robots, links.sender, links.receiver, links.sequence, links.fate
        )
        np.add(links.final_at_ns, delays_ns, out=links.final_at_ns)


@njit()
def drawn_ns(params, keys, robots, sender, receiver, sequence, fate):
    """The delay in ns, (k,); u keyed by (sender, receiver, sequence). 0 for links that ended."""
    delays_ns = np.zeros(len(sender), np.int64)
    for i in range(len(delays_ns)):
        if fate[i] == RECEIVED:
            arena = sender[i] // robots
            first = arena * robots
            u = uniform(keys[arena], sender[i] - first, receiver[i] - first, sequence[i], DELAYS)
            delays_ns[i] = varying_delay_ns(params, u)
    return delays_ns


class PropagationDelay(Stage):
    """`received_at` is later by distance / speed, with the distance between the centres when the packet went on air."""

    name = "propagation_delay"
    keys = ("propagation_mps",)

    @classmethod
    def of(cls, context: ChannelContext) -> Stage | None:
        """The stage, where the radio sets a propagation speed."""
        speed_mps = context.radio.propagation_mps
        return None if speed_mps is None else PropagationDelay(speed_mps, context.wrap_m)

    def __init__(self, speed_mps: float, wrap_m: tuple[float, float]) -> None:
        self._speed_mps, self._wrap_m = speed_mps, wrap_m

    def decide(self, links: Links, pose: FloatArray) -> None:
        """Links that are received become final later."""
        delays_ns = travel_ns(pose, links.sender, links.receiver, links.fate, self._speed_mps, self._wrap_m)
        np.add(links.final_at_ns, delays_ns, out=links.final_at_ns)


@njit()
def travel_ns(pose, sender, receiver, fate, speed_mps, wrap_m):
    """The delay in whole ns (rounded down), (k,); 0 for links that ended."""
    delays_ns = np.zeros(len(sender), np.int64)
    for i in range(len(delays_ns)):
        if fate[i] == RECEIVED:
            dx, dy = to_sender_m(pose, sender[i], receiver[i], wrap_m)
            delays_ns[i] = np.int64(np.sqrt(dx * dx + dy * dy) / speed_mps * NS_PER_S)
    return delays_ns
