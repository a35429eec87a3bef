"""Trace replay: measured delivery ratios as a loss, and measured delays.

Measured strengths replace the modelled ones of a PHY (`phy/pairs.py`).
"""

# pyright: basic, reportUnknownMemberType=false

from typing import NamedTuple

import numpy as np

from swarmwire.comms.base.arrays import FloatArray, IntArray
from swarmwire.comms.base.clock import NS_PER_S
from swarmwire.comms.base.draws import purpose
from swarmwire.comms.base.draws_compiled import uniform
from swarmwire.comms.base.kernels import kernel
from swarmwire.comms.base.sentinels import UNDER_WAY
from swarmwire.comms.radio.links import Links
from swarmwire.comms.radio.stages.loss import LossModel
from swarmwire.comms.radio.stages.stage import ChannelContext, Stage
from swarmwire.comms.radio.traces import NO_VALUES, LinkTrace, LinkTraces, TraceValues, value_at
from swarmwire.comms.robot.packets import Fate

TRACE, ACK_TRACE = purpose("trace"), purpose("trace of an acknowledgement")
RECEIVED, LOST, OUT_OF_RANGE = int(Fate.RECEIVED), int(Fate.LOST), int(Fate.OUT_OF_RANGE)


class TraceParams(NamedTuple):
    """The measured links of each arena, as input of the kernel."""

    robots: int  # in each arena
    others_end: bool  # whether links without a value are out of range
    ratio: TraceValues  # delivery ratio
    known: TraceValues  # `LinkTraces.first_values`


@kernel()
def trace_loss(params, frame):
    """OUT_OF_RANGE without a value, unless the model serves such links; LOST if u >= ratio; values at `hold_ns`."""
    link = frame.s * params.robots + frame.r
    if params.others_end and np.isnan(value_at(params.known, link, frame.hold_ns)):
        return OUT_OF_RANGE
    ratio = value_at(params.ratio, link, frame.hold_ns)
    if ratio < 1.0:  # not where it was not measured: NaN
        trace = ACK_TRACE if frame.is_ack else TRACE
        if uniform(frame.key, frame.s, frame.r, frame.sequence, trace + frame.attempt) >= ratio:
            return LOST
    return UNDER_WAY


class TraceLoss(LossModel):
    """A Bernoulli trial with the measured delivery ratio for each packet and receiver.

    A unit disk takes the values at the end of the airtime. Links without values are out of range, unless `others` is
    "model".
    """

    name = "trace_loss"
    keys = ("trace",)
    kernel = trace_loss
    no_params = TraceParams(0, False, NO_VALUES, NO_VALUES)
    varies = True

    @classmethod
    def of(cls, context: ChannelContext) -> LossModel | None:
        """The loss, where the radio has a trace."""
        if context.traces is None or context.radio.trace is None:
            return None
        return TraceLoss(context.traces, context.radio.trace.others == "none", context.robots)

    def __init__(self, traces: LinkTraces, others_end: bool, robots: int) -> None:
        self._traces, self._others_end, self._robots = traces, others_end, robots
        ratio = traces.delivery_ratio
        self._params = TraceParams(
            robots, others_end, NO_VALUES if ratio is None else ratio.values, traces.first_values
        )

    def params(self, from_ns: int, links: int) -> TraceParams:
        """The measured values of all times."""
        return self._params

    def delivery(self, sender: IntArray, receiver: IntArray, at_ns: int) -> FloatArray:
        """The ratio, 1 where none was measured; 0 for links without a value, unless `others` is "model"."""
        at = sender % self._robots, receiver % self._robots, np.full(len(sender), at_ns)
        measured = self._traces.delivery_ratio
        ratio = np.ones(len(sender)) if measured is None else np.nan_to_num(measured.at(*at), nan=1.0)
        return ratio * self._traces.known(*at) if self._others_end else ratio


class TraceDelay(Stage):
    """`received_at` is later by the measured delay of the link at the end of the airtime."""

    name = "trace_delay"
    keys = ("trace",)

    @classmethod
    def of(cls, context: ChannelContext) -> Stage | None:
        """The stage, where the radio has a trace with delays."""
        traces = context.traces
        return None if traces is None or traces.delay_s is None else TraceDelay(traces.delay_s, context.robots)

    def __init__(self, delay_s: LinkTrace, robots: int) -> None:
        self._delay_s, self._robots = delay_s, robots

    def decide(self, links: Links, pose: FloatArray) -> None:
        """Links that are received become final later."""
        sender, receiver = links.sender % self._robots, links.receiver % self._robots
        delay_s = np.nan_to_num(self._delay_s.at(sender, receiver, links.final_at_ns))
        delays_ns = np.where(links.fate == RECEIVED, np.round(delay_s * NS_PER_S), 0.0)
        np.add(links.final_at_ns, delays_ns.astype(np.int64), out=links.final_at_ns)
