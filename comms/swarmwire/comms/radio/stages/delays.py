"""Delays that vary from packet to packet, by distribution: each is a quantile of one uniform draw."""

# pyright: basic, reportUnknownMemberType=false

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.clock import NS_PER_S, to_ns
from swarmwire.comms.draws import purpose
from swarmwire.comms.draws_compiled import normal_quantile, uniform
from swarmwire.comms.radio.config.impairments import DISTRIBUTIONS, Delays
from swarmwire.comms.radio.links import RECEIVED, Links
from swarmwire.comms.radio.stages.measurements import to_sender_m
from swarmwire.comms.radio.stages.stage import ChannelContext, Stage

UNIFORM, NORMAL, LOGNORMAL, PARETO = range(4)
MAX_NS = 86_400 * NS_PER_S  # a day: a heavy tail's time still fits an integer
SMALLEST_TAIL = 2.0**-54  # half a step of a draw, so that no quantile is infinite


class DelayDistribution(NamedTuple):
    """A distribution's numbers, as kernels take them."""

    distribution: int
    first: float
    second: float
    third: float


def delay_distribution(delays: Delays) -> DelayDistribution:
    """The law with this mean and deviation.

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
    return int(min(delay_s * NS_PER_S, MAX_NS))


# --- Latency and jitter: what passes between the end of the airtime and the moment at which a receiver has the packet.


DELAY = purpose("delay")


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
        late_ns = delay_ns(
            self._keys,
            self._robots,
            links.sender,
            links.receiver,
            links.sequence,
            links.fate,
            self._latency_ns,
            self._jitter_ns,
        )
        np.add(links.final_at_ns, late_ns, out=links.final_at_ns)


@njit(cache=True)
def delay_ns(keys, robots, sender, receiver, sequence, fate, latency_ns, jitter_ns):
    """What `received_at` adds, in ns, (k,): latency + floor(u x jitter), u keyed by (sender, receiver, sequence).

    0 for links that ended.
    """
    late_ns = np.zeros(len(sender), np.int64)
    for i in range(len(late_ns)):
        if fate[i] == RECEIVED:
            late_ns[i] = latency_ns
            if jitter_ns > 0:
                key = keys[sender[i] // robots]
                u = uniform(key, sender[i] % robots, receiver[i] % robots, sequence[i], DELAY)
                late_ns[i] += np.int64(u * jitter_ns)
    return late_ns


# --- Varying delay: a further delay with a distribution of its own, before a receiver has the packet.


DELAYS = purpose("delays")


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
        self._law, self._keys, self._robots = delay_distribution(context.radio.delays), context.keys, context.robots

    def decide(self, links: Links, pose: FloatArray) -> None:
        """Links that are received become final later."""
        late_ns = drawn_ns(
            self._law, self._keys, self._robots, links.sender, links.receiver, links.sequence, links.fate
        )
        np.add(links.final_at_ns, late_ns, out=links.final_at_ns)


@njit(cache=True)
def drawn_ns(law, keys, robots, sender, receiver, sequence, fate):
    """What `received_at` adds, in ns, (k,); u keyed by (sender, receiver, sequence). 0 for links that ended."""
    late_ns = np.zeros(len(sender), np.int64)
    for i in range(len(late_ns)):
        if fate[i] == RECEIVED:
            s, r = sender[i], receiver[i]
            late_ns[i] = varying_delay_ns(law, uniform(keys[s // robots], s % robots, r % robots, sequence[i], DELAYS))
    return late_ns


# --- Propagation delay: what a slow wave needs on its way.


class PropagationDelay(Stage):
    """`received_at` is later by distance / speed, with the distance between the centres when the packet went on air."""

    name = "propagation_delay"
    keys = ("propagation_mps",)

    @classmethod
    def of(cls, context: ChannelContext) -> Stage | None:
        """The stage, where the radio says how fast its waves are."""
        speed_mps = context.radio.propagation_mps
        return None if speed_mps is None else PropagationDelay(speed_mps, context.wrap_m)

    def __init__(self, speed_mps: float, wrap_m: tuple[float, float]) -> None:
        self._speed_mps, self._wrap_m = speed_mps, wrap_m

    def decide(self, links: Links, pose: FloatArray) -> None:
        """Links that are received become final later."""
        late_ns = travel_ns(pose, links.sender, links.receiver, links.fate, self._speed_mps, self._wrap_m)
        np.add(links.final_at_ns, late_ns, out=links.final_at_ns)


@njit(cache=True)
def travel_ns(pose, sender, receiver, fate, speed_mps, wrap_m):
    """What `received_at` adds, in whole ns (rounded down), (k,); 0 for links that ended."""
    late_ns = np.zeros(len(sender), np.int64)
    for i in range(len(late_ns)):
        if fate[i] == RECEIVED:
            dx, dy = to_sender_m(pose, sender[i], receiver[i], wrap_m)
            late_ns[i] = np.int64(np.sqrt(dx * dx + dy * dy) / speed_mps * NS_PER_S)
    return late_ns
