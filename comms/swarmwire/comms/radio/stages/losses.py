"""All loss models, and the compiled dispatcher by which both radio models call their kernels."""

# pyright: basic, reportUnknownMemberType=false

import math
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from swarmwire.comms.base.arrays import FloatArray, IntArray, KeyArray
from swarmwire.comms.base.kernels import kernel
from swarmwire.comms.base.sentinels import UNDER_WAY
from swarmwire.comms.radio.links import OUT_OF_RANGE, RECEIVED, Links
from swarmwire.comms.radio.stages.burst_loss import BurstLoss
from swarmwire.comms.radio.stages.loss import FixedLoss, LossModel, ReceivedFrame
from swarmwire.comms.radio.stages.stage import ChannelContext, Stage
from swarmwire.comms.radio.stages.trace import TraceLoss

# The order of the tests in a unit disk; a PHY tests those that remember last.
LOSS_MODELS: tuple[type[LossModel], ...] = (FixedLoss, BurstLoss, TraceLoss)

NO_HOLD = -1
NO_ORDER = np.empty(0, np.int64)


class Losses(NamedTuple):
    """The losses of a radio as input of kernels."""

    order: IntArray  # places in LOSS_MODELS of the losses that the radio has, in the order of the tests
    hold_ns: int  # time of the current poses, see `ReceivedFrame`; NO_HOLD in a unit disk
    params: tuple[Any, ...]  # of each of LOSS_MODELS


@kernel()
def frame_fate(losses, frame):
    """The fate of a frame that was received without errors: RECEIVED, or that of the first loss that ends it."""
    for i in range(len(losses.order)):
        fate = _fate_by(losses.order[i], losses.params, frame)
        if fate != UNDER_WAY:
            return fate
    return RECEIVED


def _dispatcher(models: tuple[type[LossModel], ...]) -> Any:
    """The kernel that calls the kernel of the loss model at a place: one case after the other, unrolled."""
    *others, last = models
    case, at = last.kernel, len(others)
    if not others:

        @kernel(cache=False)  # its callers are cached, with all that they call
        def fate_by(place, params, frame):  # noqa: ARG001 - the only place
            return case(params[at], frame)

        return fate_by
    otherwise = _dispatcher(tuple(others))

    @kernel(cache=False)
    def fate_by_one(place, params, frame):
        if place == at:
            return case(params[at], frame)
        return otherwise(place, params, frame)

    return fate_by_one


_fate_by = _dispatcher(LOSS_MODELS)


class LossChain:
    """The losses that a radio has.

    Attributes:
        models: in the order of LOSS_MODELS.
        passing: long-run share of frames that pass all losses on every link; those that vary by link come on top.
        varies: whether `delivery` depends on the link.
    """

    def __init__(self, models: list[LossModel]) -> None:
        self._use(models)

    @classmethod
    def of(cls, context: ChannelContext) -> "LossChain":
        """The losses of this medium."""
        models = (kind.of(context) for kind in LOSS_MODELS)
        return LossChain([model for model in models if model is not None])

    def tune(self, context: ChannelContext, at_ns: int) -> None:
        """Use the radio parameters of `context` from `at_ns` on; losses keep their state."""
        previous = {type(model): model for model in self.models}
        self._use(LossChain.of(context).models)
        for model in self.models:
            if type(model) in previous:
                model.go_on_from(previous[type(model)], at_ns)

    def losses(self, hold_ns: int, from_ns: int, links: int) -> Losses:
        """Input of `frame_fate` in a PHY, for frames at `from_ns` or later on at most so many links.

        The robots have been at their poses since `hold_ns`. Losses that remember come last: they see no frame that
        another loss ends.
        """
        if not self.models:
            return NO_LOSSES
        return _losses_of(self._forgetful + self._remembering, hold_ns, from_ns, links)

    def decide(self, links: Links, robots: int, keys: KeyArray, *, count_only: bool) -> None:
        """Set the fates of links of a unit disk that a loss ends; in place.

        With `count_only`, losses that remember are left out. Each arena has `robots` and one of the `keys` (arenas,).
        """
        models = self._forgetful if count_only else self.models
        if not models or not len(links.fate):
            return
        index = NO_ORDER
        if self._remembering and not count_only:  # frames of a link are tested in the order of time
            index = np.argsort(links.final_at_ns, kind="stable")
        losses = _losses_of(models, NO_HOLD, int(links.final_at_ns.min()), len(links.fate))
        columns = links.sender, links.receiver, links.sequence, links.final_at_ns, links.fate, links.in_range
        _decide(losses, keys, robots, index, *columns)

    def delivery(self, sender: IntArray, receiver: IntArray, at_ns: int) -> FloatArray | float:
        """Probability that a frame passes beside `passing`, by link between robot rows, (k,)."""
        share: FloatArray | float = 1.0
        for model in self.models:
            share = share * model.delivery(sender, receiver, at_ns)
        return share

    def _use(self, models: list[LossModel]) -> None:
        self.models = models
        self._forgetful = [model for model in models if not model.remembers]
        self._remembering = [model for model in models if model.remembers]
        self.passing = math.prod((model.passing for model in models), start=1.0)
        self.varies = any(model.varies for model in models)


def _losses_of(models: list[LossModel], hold_ns: int, from_ns: int, links: int) -> Losses:
    params = {type(model): model.params(from_ns, links) for model in models}
    return Losses(_order_of(tuple(params)), hold_ns, tuple(params.get(kind, kind.no_params) for kind in LOSS_MODELS))


NO_LOSSES = Losses(NO_ORDER, NO_HOLD, tuple(kind.no_params for kind in LOSS_MODELS))


@cache
def _order_of(kinds: tuple[type[LossModel], ...]) -> IntArray:
    """The places of these losses in LOSS_MODELS."""
    return np.array([LOSS_MODELS.index(kind) for kind in kinds], np.int64)


@kernel(from_python=True)
def _decide(losses, keys, robots, index, sender, receiver, sequence, at_ns, fate, in_range):
    """Set the fates of links under way, one loss after the other, in the order of `index` (k,), if it is not empty.

    A lost frame was in range, unless it is OUT_OF_RANGE.
    """
    for k in range(len(losses.order)):
        place = losses.order[k]
        for n in range(len(fate)):
            i = index[n] if len(index) > 0 else n
            if fate[i] == UNDER_WAY:
                a, b, now_ns = sender[i], receiver[i], at_ns[i]
                arena = a // robots
                first = arena * robots
                frame = ReceivedFrame(keys[arena], a, b, a - first, b - first, sequence[i], 0, False, now_ns, now_ns)
                end = _fate_by(place, losses.params, frame)
                fate[i] = end
                in_range[i] *= end != OUT_OF_RANGE


class LossStage(Stage):
    """All losses as a stage of the unit disk."""

    name = "losses"
    keys = tuple(key for kind in LOSS_MODELS for key in kind.keys)

    @classmethod
    def of(cls, context: ChannelContext) -> Stage | None:
        """The stage, where the radio has any loss."""
        losses = LossChain.of(context)
        return LossStage(context, losses) if losses.models else None

    def __init__(self, context: ChannelContext, losses: LossChain) -> None:
        self._context, self._losses = context, losses

    def go_on_from(self, previous: Stage, at_ns: int) -> None:
        """Losses keep their state."""
        assert isinstance(previous, LossStage)
        previous._losses.tune(self._context, at_ns)
        self._losses = previous._losses

    def decide(self, links: Links, pose: FloatArray) -> None:
        """Lost links end."""
        self._losses.decide(links, self._context.robots, self._context.keys, count_only=False)

    def count_in_range(self, links: Links, pose: FloatArray) -> None:
        """As `decide`, for packets that never go on air: the state of links stays."""
        self._losses.decide(links, self._context.robots, self._context.keys, count_only=True)

    def delivery(self, links: Links, pose: FloatArray) -> FloatArray | float:
        """The probability of the worse direction."""
        losses = self._losses
        if not losses.varies:
            return losses.passing
        at_ns = int(links.final_at_ns.max(initial=0))
        forward = losses.delivery(links.sender, links.receiver, at_ns)
        return losses.passing * np.minimum(forward, losses.delivery(links.receiver, links.sender, at_ns))


class Reception(Stage):
    """The end of the unit disk's losses: every link that is still under way is received."""

    name = "reception"
    keys = ()

    @classmethod
    def of(cls, context: ChannelContext) -> Stage | None:
        """Return the stage: every unit disk has it."""
        return Reception()

    def decide(self, links: Links, pose: FloatArray) -> None:
        """Set the fate RECEIVED."""
        np.putmask(links.fate, links.fate == UNDER_WAY, RECEIVED)

    def count_in_range(self, links: Links, pose: FloatArray) -> None:
        """Leave the links as they are, since these packets never go on air."""
