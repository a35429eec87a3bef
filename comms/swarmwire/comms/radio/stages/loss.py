"""The interface of a loss model, and the simplest one, fixed loss.

One kernel decides a frame at one receiver, in the unit disk and in the PHY.
"""

# pyright: basic, reportUnknownMemberType=false

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, ClassVar, NamedTuple

import numpy as np

from swarmwire.comms.base.arrays import FloatArray, IntArray
from swarmwire.comms.base.draws import purpose
from swarmwire.comms.base.draws_compiled import uniform
from swarmwire.comms.base.kernels import kernel
from swarmwire.comms.base.sentinels import UNDER_WAY
from swarmwire.comms.radio.stages.stage import ChannelContext
from swarmwire.comms.robot.packets import Fate

LOSS, ACK_LOSS = purpose("fixed loss"), purpose("fixed loss of an acknowledgement")
LOST = int(Fate.LOST)


class ReceivedFrame(NamedTuple):
    """One frame at one receiver, as input of kernels.

    Key draws by `key`, (s, r, sequence) and a purpose of the loss model + `attempt`; acknowledgements have purposes of
    their own, since the acknowledged packet has the same numbers.
    """

    key: int  # of the arena
    sender: int  # robot row
    receiver: int | np.int64  # robot row
    s: int  # index of the sender in the arena
    r: int  # index of the receiver in the arena
    sequence: int  # of the packet, or of the acknowledged packet
    attempt: int  # from 0; a unit disk has no other
    is_ack: bool
    at_ns: int  # unit disk: end of the airtime; PHY: start of the airtime
    hold_ns: int  # time for measured values. Unit disk: as `at_ns`; PHY: start of the current poses


class LossModel(ABC):
    """A cause of lost frames beside noise and interference.

    The unit disk tests the links of a packet when it goes on air, the PHY each frame that was received without errors,
    at its end. An acknowledgement is such a frame: every loss model applies to it, on the link from the receiver of the
    packet to its sender.
    """

    name: ClassVar[str]  # as in `swarmwire describe`
    keys: ClassVar[tuple[str, ...]]  # keys of [radio] that it uses
    kernel: ClassVar[Callable[..., Any]]  # (params, frame): UNDER_WAY, or the Fate of a lost frame
    no_params: ClassVar[tuple[Any, ...]]  # for a radio without this loss; of the same numba type as `params`
    remembers: ClassVar[bool] = False  # whether links have state; frames of a link then come in the order of time
    varies: ClassVar[bool] = False  # whether `delivery` depends on the link

    @classmethod
    @abstractmethod
    def of(cls, context: ChannelContext) -> "LossModel | None":
        """The loss model of this medium; None where the radio does not have it."""

    @abstractmethod
    def params(self, from_ns: int, links: int) -> tuple[Any, ...]:
        """A NamedTuple for the kernel, for frames at `from_ns` or later on at most so many links."""

    @property
    def passing(self) -> float:
        """Long-run share of frames that pass on every link."""
        return 1.0

    def delivery(self, sender: IntArray, receiver: IntArray, at_ns: int) -> FloatArray | float:
        """Probability that a frame passes beside `passing`, by link between robot rows, (k,)."""
        return 1.0

    def go_on_from(self, previous: "LossModel", at_ns: int) -> None:  # noqa: B027 - most have no state
        """Take over the state of the same loss model with the radio parameters valid until `at_ns`."""


class FixedLossParams(NamedTuple):
    """Parameters of `fixed_loss`."""

    loss: float


@kernel()
def fixed_loss(params, frame):
    """LOST if u < loss."""
    loss = ACK_LOSS if frame.is_ack else LOSS
    u = uniform(frame.key, frame.s, frame.r, frame.sequence, loss + frame.attempt)
    return LOST if u < params.loss else UNDER_WAY


class FixedLoss(LossModel):
    """A Bernoulli trial with probability `loss` for each packet and receiver."""

    name = "fixed_loss"
    keys = ("loss",)
    kernel = fixed_loss
    no_params = FixedLossParams(0.0)  # not read; pragma: no mutate

    @classmethod
    def of(cls, context: ChannelContext) -> LossModel | None:
        """The loss, where the radio loses anything."""
        return FixedLoss(context.radio.loss) if context.radio.loss > 0.0 else None

    def __init__(self, loss: float) -> None:
        self._params = FixedLossParams(float(loss))

    def params(self, from_ns: int, links: int) -> FixedLossParams:
        """The probability."""
        return self._params

    @property
    def passing(self) -> float:
        """1 - loss."""
        return 1.0 - self._params.loss
