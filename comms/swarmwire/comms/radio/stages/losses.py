"""All loss models, and the compiled function by which both radio models apply them to a frame."""

import math
from typing import Any, NamedTuple

from swarmwire.comms.base.arrays import FloatArray, IntArray
from swarmwire.comms.base.kernels import kernel
from swarmwire.comms.base.sentinels import UNDER_WAY
from swarmwire.comms.radio.context import ChannelContext
from swarmwire.comms.radio.links import RECEIVED
from swarmwire.comms.radio.stages.burst_loss import NO_BURSTS, BurstLoss, BurstParams, burst_loss
from swarmwire.comms.radio.stages.loss import FixedLoss, FrameLoss, fixed_loss
from swarmwire.comms.radio.stages.trace import NO_TRACE, TraceLoss, TraceParams, trace_loss

# The order of the tests in a unit disk, see `loss_fate`.
LOSS_MODELS: tuple[type[FrameLoss], ...] = (FixedLoss, BurstLoss, TraceLoss)

AT_FRAME_NS = -1  # `Losses.trace_ns` of a unit disk: traces are read at the time of each frame


class Losses(NamedTuple):
    """The losses of a radio as input of kernels; one type for all radios, so that event loops compile once."""

    trace_ns: int  # start of the current poses, see `ReceivedFrame`; or AT_FRAME_NS
    has_any: bool
    fixed: float
    burst: BurstParams
    trace: TraceParams


@kernel()
def loss_fate(losses: Any, frame: Any):
    """Return the fate of the first loss that ends the frame, or UNDER_WAY.

    Bursts come last in a PHY: they see no frame that another loss ends. A unit disk tests them before the trace.
    """
    is_disk = losses.trace_ns == AT_FRAME_NS
    fate = fixed_loss(losses.fixed, frame)
    if fate == UNDER_WAY and not is_disk:
        fate = trace_loss(losses.trace, frame)
    if fate == UNDER_WAY:
        fate = burst_loss(losses.burst, frame)
    if fate == UNDER_WAY and is_disk:
        fate = trace_loss(losses.trace, frame)
    return fate


@kernel()
def stateless_loss_fate(losses: Any, frame: Any):
    """Return the fate in a unit disk without the losses that have state: the frame never goes on air."""
    fate = fixed_loss(losses.fixed, frame)
    return trace_loss(losses.trace, frame) if fate == UNDER_WAY else fate


@kernel()
def frame_fate(losses: Any, frame: Any):
    """Return the fate of a frame that was received without errors: RECEIVED, or that of the first loss that ends it."""
    fate = loss_fate(losses, frame)
    return RECEIVED if fate == UNDER_WAY else fate


class LossChain:
    """The losses that a radio has.

    Attributes:
        models: the losses, in the order of LOSS_MODELS.
        passing: long-run share of frames that pass all losses on every link; losses that vary by link are extra.
        has_state: True if frames of a link must be tested in the order of time.
    """

    def __init__(self, models: list[FrameLoss]) -> None:
        self._use(models)

    @classmethod
    def create(cls, context: ChannelContext) -> "LossChain":
        """Return the losses of this medium."""
        models = (kind.create(context) for kind in LOSS_MODELS)
        return LossChain([model for model in models if model is not None])

    def tune(self, context: ChannelContext, at_ns: int) -> None:
        """Use the radio parameters of `context` from `at_ns` on; losses keep their state."""
        previous = {type(model): model for model in self.models}
        self._use(LossChain.create(context).models)
        for model in self.models:
            if type(model) in previous:
                model.continue_from(previous[type(model)], at_ns)

    def losses(self, trace_ns: int, from_ns: int, links: int) -> Losses:
        """Return the input of kernels, for frames at `from_ns` or later on at most `links` links.

        In a PHY the robots have been at their poses since `trace_ns`; a unit disk has AT_FRAME_NS.
        """
        if self._unchanging is not None and self._unchanging.trace_ns == trace_ns:
            return self._unchanging
        params = {type(model): model.params(from_ns, links) for model in self.models}
        fixed, burst = params.get(FixedLoss, 0.0), params.get(BurstLoss, NO_BURSTS)
        losses = Losses(trace_ns, bool(self.models), fixed, burst, params.get(TraceLoss, NO_TRACE))
        self._unchanging = None if self.has_state else losses
        return losses

    def delivery(self, sender: IntArray, receiver: IntArray, at_ns: int) -> FloatArray | float:
        """Return the part of the delivery that depends on the link between robot rows, (k,); `passing` is the other."""
        share: FloatArray | float = 1.0
        for model in self.models:
            share = share * model.delivery(sender, receiver, at_ns)
        return share

    @property
    def varies(self) -> bool:
        """True if `delivery` depends on the link."""
        return any(model.varies for model in self.models)

    def _use(self, models: list[FrameLoss]) -> None:
        self.models, self._unchanging = models, None
        self.passing = math.prod((model.passing for model in models), start=1.0)
        self.has_state = any(model.has_state for model in models)
