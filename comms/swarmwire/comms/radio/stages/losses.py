"""All loss models, and the compiled function by which both radio models apply them to a frame."""

import math
from typing import Any, NamedTuple

import numpy as np

from swarmwire.comms.base.arrays import FloatArray, IntArray, Table, record_type
from swarmwire.comms.base.kernels import kernel
from swarmwire.comms.base.sentinels import UNDER_WAY
from swarmwire.comms.radio.context import ChannelContext
from swarmwire.comms.radio.links import RECEIVED
from swarmwire.comms.radio.stages.burst_loss import NO_STATES, BurstLoss, burst_loss
from swarmwire.comms.radio.stages.loss import FixedLoss, FrameLoss, fixed_loss
from swarmwire.comms.radio.stages.trace import TraceLoss, trace_loss
from swarmwire.comms.radio.traces import NO_VALUES, TraceValues

# The order of the tests in a unit disk, see `loss_fate`.
LOSS_MODELS: tuple[type[FrameLoss], ...] = (FixedLoss, BurstLoss, TraceLoss)

AT_FRAME_NS = -1  # `trace_ns` of a unit disk: traces are read at the time of each frame


LOSS_PARAMS = record_type(
    [
        *((kind.name, record_type(kind.FIELDS)) for kind in LOSS_MODELS),
        ("trace_ns", np.int64),  # start of the current poses, see `ReceivedFrame`; or AT_FRAME_NS
        ("has_any", np.bool_),
    ]
)


class Losses(NamedTuple):
    """The losses of a radio as input of kernels; one type for all radios, so that event loops compile once."""

    params: Table  # one record of type LOSS_PARAMS
    burst_links: Table  # states of links, of type LINK_STATE
    measured: TraceValues  # `LinkTraces.values`


@kernel()
def loss_fate(losses: Any, frame: Any):
    """Return the fate of the first loss that ends the frame, or UNDER_WAY.

    Bursts come last in a PHY: they see no frame that another loss ends. A unit disk tests them before the trace.
    """
    params = losses.params[0]
    is_disk = params.trace_ns == AT_FRAME_NS
    fate = fixed_loss(params.fixed_loss, frame)
    if fate == UNDER_WAY and not is_disk:
        fate = trace_loss(params.trace_loss, losses.measured, frame)
    if fate == UNDER_WAY:
        fate = burst_loss(params.burst_loss, losses.burst_links, frame)
    if fate == UNDER_WAY and is_disk:
        fate = trace_loss(params.trace_loss, losses.measured, frame)
    return fate


@kernel()
def stateless_loss_fate(losses: Any, frame: Any):
    """Return the fate in a unit disk without the losses that have state: the frame never goes on air."""
    params = losses.params[0]
    fate = fixed_loss(params.fixed_loss, frame)
    return trace_loss(params.trace_loss, losses.measured, frame) if fate == UNDER_WAY else fate


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

    def __init__(self, models: list[FrameLoss], measured: TraceValues = NO_VALUES) -> None:
        self._use(models, measured)

    @classmethod
    def create(cls, context: ChannelContext) -> "LossChain":
        """Return the losses of this medium."""
        models = (kind.create(context) for kind in LOSS_MODELS)
        return LossChain([model for model in models if model is not None], context.measured)

    def tune(self, context: ChannelContext, at_ns: int) -> None:
        """Use the radio parameters of `context` from `at_ns` on; losses keep their state."""
        previous = {type(model): model for model in self.models}
        self._use(LossChain.create(context).models, context.measured)
        for model in self.models:
            if type(model) in previous:
                model.continue_from(previous[type(model)], at_ns)

    def losses(self, trace_ns: int, from_ns: int, links: int) -> Losses:
        """Return the input of kernels, for frames at `from_ns` or later on at most `links` links.

        In a PHY the robots have been at their poses since `trace_ns`; a unit disk has AT_FRAME_NS.
        """
        self._losses.params["trace_ns"] = trace_ns
        if self._bursts is not None:
            self._losses = self._losses._replace(burst_links=self._bursts.reserve(from_ns, links))
        return self._losses

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

    def _use(self, models: list[FrameLoss], measured: TraceValues) -> None:
        self.models, params = models, np.zeros(1, LOSS_PARAMS)
        params[0].has_any = bool(models)
        for model in models:
            model.write(params[0][model.name])
        self._losses = Losses(params, NO_STATES, measured)
        self._bursts = next((model for model in models if isinstance(model, BurstLoss)), None)
        self.passing = math.prod((model.passing for model in models), start=1.0)
        self.has_state = any(model.has_state for model in models)
