"""Trace replay: measured delivery ratios as a loss, and measured delays.

Measured strengths replace the modelled ones of a PHY (`phy/pairs.py`).
"""

from typing import Any, ClassVar

import numpy as np

from swarmwire.comms.base.arrays import FloatArray, IntArray
from swarmwire.comms.base.clock import NS_PER_S
from swarmwire.comms.base.draws import purpose
from swarmwire.comms.base.kernels import kernel
from swarmwire.comms.base.sentinels import UNDER_WAY
from swarmwire.comms.radio.context import ChannelContext
from swarmwire.comms.radio.stages.link_draws import loss_uniform
from swarmwire.comms.radio.stages.loss import FrameLoss
from swarmwire.comms.radio.stages.stage import Stage
from swarmwire.comms.radio.traces import DELAY, FIRST, RATIO, LinkTraces, value_at
from swarmwire.comms.robot.packets import Fate

TRACE, ACK_TRACE = purpose("trace"), purpose("trace of an acknowledgement")
RECEIVED, LOST, OUT_OF_RANGE = int(Fate.RECEIVED), int(Fate.LOST), int(Fate.OUT_OF_RANGE)


@kernel()
def measured_at(values: Any, quantity: int, robots: int, frame: Any, at_ns: int):
    """Return a quantity of `LinkTraces.values` on the frame's link at a time; NaN if it was not measured."""
    return value_at(values, (quantity * robots + frame.s) * robots + frame.r, at_ns)


@kernel()
def trace_loss(params: Any, values: Any, frame: Any):
    """Return OUT_OF_RANGE for a link without a value, unless the model serves it; LOST if u >= ratio."""
    if not params.is_used:
        return UNDER_WAY
    if params.others_end and np.isnan(measured_at(values, FIRST, params.robots, frame, frame.trace_ns)):
        return OUT_OF_RANGE
    ratio = measured_at(values, RATIO, params.robots, frame, frame.trace_ns)
    if ratio < 1.0 and loss_uniform(frame, TRACE, ACK_TRACE) >= ratio:  # False for NaN: no ratio was measured
        return LOST
    return UNDER_WAY


class TraceLoss(FrameLoss):
    """A Bernoulli trial with the measured delivery ratio for each packet and receiver.

    A unit disk takes the values at the end of the airtime. Links without values are out of range, unless `others` is
    "model".
    """

    name = "trace_loss"
    keys = ("trace",)
    varies = True
    FIELDS: ClassVar = [
        ("is_used", np.bool_),
        ("others_end", np.bool_),  # True: links without a value are out of range
        ("robots", np.int64),  # robots per arena
    ]

    @classmethod
    def create(cls, context: ChannelContext) -> FrameLoss | None:
        """Return the loss if the radio has a trace."""
        if context.traces is None or context.radio.trace is None:
            return None
        return TraceLoss(context.traces, context.radio.trace.others == "none", context.robots)

    def __init__(self, traces: LinkTraces, others_end: bool, robots: int) -> None:
        self._traces, self._others_end, self._robots = traces, others_end, robots

    def write(self, params: Any) -> None:
        """Set the number of robots, and what happens to other links."""
        params.is_used, params.others_end, params.robots = True, self._others_end, self._robots

    def delivery(self, sender: IntArray, receiver: IntArray, at_ns: int) -> FloatArray:
        """Return the ratio, 1 if none was measured; 0 for links without a value, unless `others` is "model"."""
        s, r, times_ns = sender % self._robots, receiver % self._robots, np.full(len(sender), at_ns)
        trace, ratio = self._traces.delivery_ratio, np.ones(len(sender))
        if trace is not None:
            ratio = np.nan_to_num(trace.values_at(s, r, times_ns), nan=1.0)
        return ratio * self._traces.has_values(s, r, times_ns) if self._others_end else ratio


@kernel()
def trace_delay_ns(params: Any, values: Any, frame: Any, at_ns: int):
    """Return the delay measured on the frame's link at a time, rounded to ns; 0 if none was measured."""
    if not params.is_used:
        return 0
    delay_s = measured_at(values, DELAY, params.robots, frame, at_ns)
    return 0 if np.isnan(delay_s) else np.int64(np.rint(delay_s * NS_PER_S))


class TraceDelay(Stage):
    """Adds the measured delay of the link at the end of the airtime to `received_at`."""

    name = "trace_delay"
    keys = ("trace",)
    FIELDS: ClassVar = [("is_used", np.bool_), ("robots", np.int64)]

    @classmethod
    def create(cls, context: ChannelContext) -> Stage | None:
        """Return the stage if the radio has a trace; without delays it has no effect."""
        return None if context.traces is None else TraceDelay(context.robots)

    def __init__(self, robots: int) -> None:
        self._robots = robots

    def write(self, params: Any) -> None:
        """Set the number of robots."""
        params.is_used, params.robots = True, self._robots
