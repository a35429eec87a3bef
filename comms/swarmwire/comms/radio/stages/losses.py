"""Stages that lose packets, independently for each receiver: fixed loss, burst loss and trace replay."""

# pyright: basic, reportUnknownMemberType=false

import numpy as np

from swarmwire.comms.arrays import FloatArray, IntArray
from swarmwire.comms.clock import NS_PER_S
from swarmwire.comms.draws import purpose
from swarmwire.comms.draws_compiled import uniform
from swarmwire.comms.kernels import njit
from swarmwire.comms.packets import Fate
from swarmwire.comms.radio.links import RECEIVED, Links
from swarmwire.comms.radio.reception.bursts import BurstStates
from swarmwire.comms.radio.stages.stage import ChannelContext, Stage
from swarmwire.comms.radio.traces import LinkTrace

LOSS, TRACE = purpose("fixed loss"), purpose("trace")


class FixedLoss(Stage):
    """A Bernoulli trial with probability `loss` for each packet and receiver."""

    name = "fixed_loss"
    keys = ("loss",)

    @classmethod
    def of(cls, context: ChannelContext) -> Stage | None:
        """The stage, where the radio loses anything."""
        return FixedLoss(context) if context.radio.loss > 0.0 else None

    def __init__(self, context: ChannelContext) -> None:
        self._loss, self._keys, self._robots = context.radio.loss, context.keys, context.robots

    def decide(self, links: Links, pose: FloatArray) -> None:
        """Lost links end; they were in range."""
        ends = lost(self._keys, self._robots, links.sender, links.receiver, links.sequence, links.fate, self._loss)
        links.fate[ends] = Fate.LOST

    def delivery(self, links: Links, pose: FloatArray) -> float:
        """1 - loss."""
        return 1.0 - self._loss


@njit()
def lost(keys, robots, sender, receiver, sequence, fate, loss):
    """Whether each link under way is lost: u < loss, u keyed by (sender, receiver, sequence), (k,)."""
    ends = np.zeros(len(sender), np.bool_)
    for i in range(len(ends)):
        if fate[i] == RECEIVED:
            key = keys[sender[i] // robots]
            ends[i] = uniform(key, sender[i] % robots, receiver[i] % robots, sequence[i], LOSS) < loss
    return ends


class BurstLoss(Stage):
    """The Gilbert-Elliott chain for each directed link, in continuous time."""

    name = "burst_loss"
    keys = ("bursts",)

    @classmethod
    def of(cls, context: ChannelContext) -> Stage | None:
        """The stage, where a unit disk has bursts; in a PHY they are part of reception."""
        return BurstLoss(context) if context.radio.bursts is not None and not context.radio.is_phy else None

    remembers = True

    def __init__(self, context: ChannelContext) -> None:
        assert context.radio.bursts is not None
        self._bursts, self._loss = context.radio.bursts, context.radio.bursts.loss
        self._states = BurstStates(context.radio.bursts, context.keys, context.robots)

    def go_on_from(self, previous: Stage, at_ns: int) -> None:
        """Keep the state of all links."""
        assert isinstance(previous, BurstLoss)
        previous._states.change(self._bursts, at_ns)
        self._states = previous._states

    def decide(self, links: Links, pose: FloatArray) -> None:
        """End links lost in a burst; they were in range. Packets of a link are handled in the order of time."""
        index = np.flatnonzero(links.fate == RECEIVED)
        index = index[np.argsort(links.final_at_ns[index], kind="stable")]
        sender, receiver, at_ns = links.sender[index], links.receiver[index], links.final_at_ns[index]
        ends = self._states.lost(sender, receiver, links.sequence[index], at_ns)
        links.fate[index[ends]] = Fate.BURST

    def delivery(self, links: Links, pose: FloatArray) -> float:
        """1 - loss, in the long run."""
        return 1.0 - self._loss


class TraceReplay(Stage):
    """A Bernoulli trial with the measured delivery ratio for each packet and receiver, then the measured delay.

    Values are those at the end of the airtime. Links without values are out of range, unless `others` is "model".
    """

    name = "trace"
    keys = ("trace",)

    @classmethod
    def of(cls, context: ChannelContext) -> Stage | None:
        """The stage, where the radio has a trace; in a PHY it applies the delays alone."""
        return None if context.traces is None else TraceReplay(context)

    def __init__(self, context: ChannelContext) -> None:
        assert context.traces is not None
        assert context.radio.trace is not None
        self._traces, self._keys, self._robots = context.traces, context.keys, context.robots
        self._others_end = context.radio.trace.others == "none"
        self._only_delays = context.radio.is_phy

    def decide(self, links: Links, pose: FloatArray) -> None:
        """End links that are lost or without measurement; received ones become final later."""
        sender, receiver = links.sender % self._robots, links.receiver % self._robots
        if not self._only_delays:
            self._end(links, sender, receiver)
        if self._traces.delay_s is not None:
            delay_s = np.nan_to_num(self._traces.delay_s.at(sender, receiver, links.final_at_ns))
            delays_ns = np.where(links.fate == RECEIVED, np.round(delay_s * NS_PER_S), 0.0)
            np.add(links.final_at_ns, delays_ns.astype(np.int64), out=links.final_at_ns)

    def delivery(self, links: Links, pose: FloatArray) -> FloatArray:
        """The ratio of the worse direction at the time of the links."""
        a, b = links.sender % self._robots, links.receiver % self._robots
        return np.minimum(self._ratio(a, b, links.final_at_ns), self._ratio(b, a, links.final_at_ns))

    def _end(self, links: Links, sender: IntArray, receiver: IntArray) -> None:
        under_way, at_ns = links.fate == RECEIVED, links.final_at_ns
        if self._others_end:
            ends = under_way & ~self._traces.known(sender, receiver, at_ns)
            links.fate[ends] = Fate.OUT_OF_RANGE
            links.in_range[ends] = 0
        ratio = _measured(self._traces.delivery_ratio, sender, receiver, at_ns)
        ends = trace_lost(self._keys, self._robots, links.sender, links.receiver, links.sequence, links.fate, ratio)
        links.fate[ends] = Fate.LOST

    def _ratio(self, sender: IntArray, receiver: IntArray, at_ns: IntArray) -> FloatArray:
        ratio = _measured(self._traces.delivery_ratio, sender, receiver, at_ns)
        return ratio * self._traces.known(sender, receiver, at_ns) if self._others_end else ratio


def _measured(trace: LinkTrace | None, sender: IntArray, receiver: IntArray, at_ns: IntArray) -> FloatArray:
    """The delivery ratio, (k,); 1 where none was measured."""
    return np.ones(len(sender)) if trace is None else np.nan_to_num(trace.at(sender, receiver, at_ns), nan=1.0)


@njit()
def trace_lost(keys, robots, sender, receiver, sequence, fate, ratio):
    """Whether each link under way is lost: u >= ratio, u keyed by (sender, receiver, sequence), (k,)."""
    ends = np.zeros(len(sender), np.bool_)
    for i in range(len(ends)):
        if fate[i] == RECEIVED and ratio[i] < 1.0:
            key = keys[sender[i] // robots]
            ends[i] = uniform(key, sender[i] % robots, receiver[i] % robots, sequence[i], TRACE) >= ratio[i]
    return ends
