"""All loss models, and the compiled function by which both radio models apply them to a frame."""

import math
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from swarmwire.comms.base.arrays import AnyArray, FloatArray, IntArray, KeyArray
from swarmwire.comms.base.kernels import kernel
from swarmwire.comms.base.sentinels import UNDER_WAY
from swarmwire.comms.radio.context import ChannelContext
from swarmwire.comms.radio.links import OUT_OF_RANGE, RECEIVED, Links
from swarmwire.comms.radio.stages.burst_loss import BurstLoss, BurstParams, burst_loss
from swarmwire.comms.radio.stages.link_draws import LinkDraws, draw_key
from swarmwire.comms.radio.stages.loss import FixedLoss, FixedLossParams, FrameLoss, ReceivedFrame, fixed_loss
from swarmwire.comms.radio.stages.stage import Stage
from swarmwire.comms.radio.stages.trace import TraceLoss, TraceParams, trace_loss

# The order of the tests in a unit disk; a PHY tests those with state last.
LOSS_MODELS: tuple[type[FrameLoss], ...] = (FixedLoss, BurstLoss, TraceLoss)

FIXED_INDEX, BURST_INDEX, TRACE_INDEX = range(len(LOSS_MODELS))

NO_TRACE_NS = -1  # `Losses.trace_ns` of a unit disk, which reads traces at the time of each frame
NO_ORDER = np.empty(0, np.int64)


class Losses(NamedTuple):
    """The losses of a radio as input of kernels."""

    order: IntArray  # indices in LOSS_MODELS of the losses that the radio has, in the order of the tests
    trace_ns: int  # start of the current poses, see `ReceivedFrame`; or NO_TRACE_NS
    fixed: FixedLossParams
    burst: BurstParams
    trace: TraceParams


@kernel()
def frame_fate(losses: Any, frame: Any):
    """Return the fate of a frame that was received without errors: RECEIVED, or that of the first loss that ends it."""
    for i in range(len(losses.order)):
        fate = _fate_by(losses.order[i], losses, frame)
        if fate != UNDER_WAY:
            return fate
    return RECEIVED


@kernel()
def _fate_by(model: Any, losses: Any, frame: Any):
    """Return the fate of a frame by one loss model: UNDER_WAY if it passes."""
    if model == FIXED_INDEX:
        return fixed_loss(losses.fixed, frame)
    if model == BURST_INDEX:
        return burst_loss(losses.burst, frame)
    return trace_loss(losses.trace, frame)


class LossChain:
    """The losses that a radio has.

    Attributes:
        models: the losses, in the order of LOSS_MODELS.
        passing: long-run share of frames that pass all losses on every link; losses that vary by link are extra.
        varies: True if `delivery` depends on the link.
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
        """Return the input of `frame_fate` in a PHY, for frames at `from_ns` or later on at most `links` links.

        The robots have been at their poses since `trace_ns`. Losses with state come last: they see no frame that
        another loss ends.
        """
        if not self.models:
            return NO_LOSSES
        return _losses_of(self._stateless + self._stateful, trace_ns, from_ns, links)

    def decide(self, links: Links, robots: int, keys: KeyArray, *, count_only: bool) -> None:
        """Set the fates of links of a unit disk that a loss ends; in place.

        `count_only` leaves out losses with state. Each arena has `robots` robots and one of the `keys` (arenas,).
        """
        models = self._stateless if count_only else self.models
        if not models or not len(links.fate):
            return
        index = NO_ORDER
        if self._stateful and not count_only:  # frames of a link are tested in the order of time
            index = np.argsort(links.final_at_ns, kind="stable")
        losses = _losses_of(models, NO_TRACE_NS, int(links.final_at_ns.min()), len(links.fate))
        _decide(losses, LinkDraws(keys, robots), index, links.columns, links.final_at_ns, links.in_range)

    def delivery(self, sender: IntArray, receiver: IntArray, at_ns: int) -> FloatArray | float:
        """Return the part of the delivery that depends on the link between robot rows, (k,); `passing` is the other."""
        share: FloatArray | float = 1.0
        for model in self.models:
            share = share * model.delivery(sender, receiver, at_ns)
        return share

    def _use(self, models: list[FrameLoss]) -> None:
        self.models = models
        self._stateless = [model for model in models if not model.has_state]
        self._stateful = [model for model in models if model.has_state]
        self.passing = math.prod((model.passing for model in models), start=1.0)
        self.varies = any(model.varies for model in models)


def _losses_of(models: list[FrameLoss], trace_ns: int, from_ns: int, links: int) -> Losses:
    params = {type(model): model.params(from_ns, links) for model in models}
    by_model = (params.get(kind, kind.no_params) for kind in LOSS_MODELS)
    return Losses._make([_order_of(tuple(params)), trace_ns, *by_model])


NO_LOSSES = Losses._make([NO_ORDER, NO_TRACE_NS, *(kind.no_params for kind in LOSS_MODELS)])


@cache
def _order_of(kinds: tuple[type[FrameLoss], ...]) -> IntArray:
    return np.array([LOSS_MODELS.index(kind) for kind in kinds], np.int64)


@kernel(from_python=True)
def _decide(losses: Any, draws: Any, index: AnyArray, links: Any, at_ns: AnyArray, in_range: AnyArray):
    """Set the fates of links under way, one loss after the other, in the order of `index` (k,), if it is not empty.

    A lost frame was in range, unless it is OUT_OF_RANGE.
    """
    for k in range(len(losses.order)):
        for n in range(len(links.fate)):
            i = index[n] if len(index) > 0 else n
            if links.fate[i] == UNDER_WAY:
                key, s, r, sequence = draw_key(draws, links, i)
                a, b, now_ns = links.sender[i], links.receiver[i], at_ns[i]
                frame = ReceivedFrame(key, a, b, s, r, sequence, 0, False, now_ns, now_ns)
                links.fate[i] = _fate_by(losses.order[k], losses, frame)
                in_range[i] *= links.fate[i] != OUT_OF_RANGE


class LossStage(Stage):
    """All losses as a stage of the unit disk."""

    name = "losses"
    keys = tuple(key for kind in LOSS_MODELS for key in kind.keys)

    @classmethod
    def create(cls, context: ChannelContext) -> Stage | None:
        """Return the stage if the radio has any loss."""
        losses = LossChain.create(context)
        return LossStage(context, losses) if losses.models else None

    def __init__(self, context: ChannelContext, losses: LossChain) -> None:
        self._context, self._losses = context, losses

    def continue_from(self, previous: Stage, at_ns: int) -> None:
        """Keep the state of the losses."""
        assert isinstance(previous, LossStage)
        previous._losses.tune(self._context, at_ns)
        self._losses = previous._losses

    def decide(self, links: Links, pose: FloatArray) -> None:
        """End lost links."""
        self._losses.decide(links, self._context.robots, self._context.keys, count_only=False)

    def count_in_range(self, links: Links, pose: FloatArray) -> None:
        """Count receivers in range of packets that never go on air; losses with state are left out."""
        self._losses.decide(links, self._context.robots, self._context.keys, count_only=True)

    def delivery(self, links: Links, pose: FloatArray) -> FloatArray | float:
        """Return the probability of the worse direction."""
        losses = self._losses
        if not losses.varies:
            return losses.passing
        at_ns = int(links.final_at_ns.max(initial=0))
        forward = losses.delivery(links.sender, links.receiver, at_ns)
        return losses.passing * np.minimum(forward, losses.delivery(links.receiver, links.sender, at_ns))


class ReceptionStage(Stage):
    """The end of the unit disk's losses: every link that is still under way is received."""

    name = "reception"
    keys = ()

    @classmethod
    def create(cls, context: ChannelContext) -> Stage | None:
        """Return the stage; every unit disk has it."""
        return ReceptionStage()

    def decide(self, links: Links, pose: FloatArray) -> None:
        """Set the fate RECEIVED."""
        _receive(links.fate)

    def count_in_range(self, links: Links, pose: FloatArray) -> None:
        """Leave the links as they are, since these packets never go on air."""


@kernel(from_python=True)
def _receive(fate: AnyArray):
    for i in range(len(fate)):
        if fate[i] == UNDER_WAY:
            fate[i] = RECEIVED
