"""The interface of frame losses, and the simplest of them, fixed loss.

One kernel decides a frame at one receiver, in the unit disk and in the PHY.
"""

from abc import ABC, abstractmethod
from typing import Any, ClassVar, NamedTuple

import numpy as np

from swarmwire.comms.base.arrays import FloatArray, IntArray
from swarmwire.comms.base.draws import purpose
from swarmwire.comms.base.draws_compiled import uniform
from swarmwire.comms.base.kernels import kernel
from swarmwire.comms.base.sentinels import UNDER_WAY
from swarmwire.comms.radio.context import ChannelContext
from swarmwire.comms.robot.packets import Fate

LOSS, ACK_LOSS = purpose("fixed loss"), purpose("fixed loss of an acknowledgement")
LOST = int(Fate.LOST)


class ReceivedFrame(NamedTuple):
    """One frame at one receiver, as input of kernels: without distance, poses or power.

    Kernels key draws by `key`, (s, r, sequence) and a purpose of the loss model + `attempt`. Acknowledgements have
    purposes of their own, since the acknowledged packet has the same counters.
    """

    key: int  # key of the arena
    sender: int  # robot row
    receiver: int | np.int64  # robot row
    s: int  # index of the sender in the arena
    r: int  # index of the receiver in the arena
    sequence: int  # sequence number of the packet, or of the acknowledged packet
    attempt: int  # number of the attempt, from 0; a unit disk has only one
    is_ack: bool
    at_ns: int  # unit disk: end of the airtime; PHY: start of the airtime
    trace_ns: int  # time at which traces are read. Unit disk: `at_ns`; PHY: start of the current poses


class FrameLoss(ABC):
    """A cause of lost frames other than path loss, noise and interference.

    The unit disk tests the links of a packet when it goes on air, the PHY each frame that was received without errors,
    at its end. An acknowledgement is such a frame: every loss model applies to it, on the link from the receiver of the
    packet to its sender.
    """

    name: ClassVar[str]  # its name in `swarmwire describe`
    keys: ClassVar[tuple[str, ...]]  # keys of [radio] that it uses
    no_params: ClassVar[tuple[Any, ...]]  # `params` of a radio without this loss, of the same numba type
    has_state: ClassVar[bool] = False  # True: links have state, and frames of a link come in the order of time
    varies: ClassVar[bool] = False  # True: `delivery` depends on the link

    @classmethod
    @abstractmethod
    def create(cls, context: ChannelContext) -> "FrameLoss | None":
        """Return the loss model of this medium; None if its radio does not have it."""

    @abstractmethod
    def params(self, from_ns: int, links: int) -> tuple[Any, ...]:
        """Return the NamedTuple for the kernel, for frames at `from_ns` or later on at most `links` links."""

    @property
    def passing(self) -> float:
        """Long-run share of frames that pass on every link."""
        return 1.0

    def delivery(self, sender: IntArray, receiver: IntArray, at_ns: int) -> FloatArray | float:
        """Return the part of the delivery that depends on the link between robot rows, (k,); `passing` is the other."""
        return 1.0

    def continue_from(self, previous: "FrameLoss", at_ns: int) -> None:  # noqa: B027 - most have no state
        """Copy the state of `previous`, the same loss model with the radio parameters valid until `at_ns`."""


class FixedLossParams(NamedTuple):
    """Parameters of `fixed_loss`."""

    loss: float


@kernel()
def fixed_loss(params: Any, frame: Any):
    """Return LOST if u < loss."""
    loss = ACK_LOSS if frame.is_ack else LOSS
    u = uniform(frame.key, frame.s, frame.r, frame.sequence, loss + frame.attempt)
    return LOST if u < params.loss else UNDER_WAY


class FixedLoss(FrameLoss):
    """A Bernoulli trial with probability `loss` for each packet and receiver."""

    name = "fixed_loss"
    keys = ("loss",)
    no_params = FixedLossParams(0.0)  # never read; pragma: no mutate

    @classmethod
    def create(cls, context: ChannelContext) -> FrameLoss | None:
        """Return the loss if the radio has one."""
        return FixedLoss(context.radio.loss) if context.radio.loss > 0.0 else None

    def __init__(self, loss: float) -> None:
        self._params = FixedLossParams(float(loss))

    def params(self, from_ns: int, links: int) -> FixedLossParams:
        """Return the probability."""
        return self._params

    @property
    def passing(self) -> float:
        """1 - loss."""
        return 1.0 - self._params.loss
