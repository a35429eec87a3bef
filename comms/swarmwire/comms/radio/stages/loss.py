"""The interface of frame losses, and the simplest of them, fixed loss.

One kernel decides a frame at one receiver, in the unit disk and in the PHY.
"""

from abc import ABC, abstractmethod
from typing import Any, ClassVar

import numpy as np

from swarmwire.comms.base.arrays import FloatArray, IntArray
from swarmwire.comms.base.draws import purpose
from swarmwire.comms.base.kernels import kernel
from swarmwire.comms.base.sentinels import UNDER_WAY
from swarmwire.comms.radio.context import ChannelContext
from swarmwire.comms.radio.stages.link_draws import loss_uniform
from swarmwire.comms.robot.packets import Fate

LOSS, ACK_LOSS = purpose("fixed loss"), purpose("fixed loss of an acknowledgement")
LOST = int(Fate.LOST)


class FrameLoss(ABC):
    """A cause of lost frames other than path loss, noise and interference.

    The unit disk tests the links of a packet when it goes on air, the PHY each frame that was received without errors,
    at its end. An acknowledgement is such a frame: every loss model applies to it, on the link from the receiver of the
    packet to its sender.
    """

    name: ClassVar[str]  # its name in `swarmwire describe`
    keys: ClassVar[tuple[str, ...]]  # keys of [radio] that it uses
    has_state: ClassVar[bool] = False  # True: links have state, and frames of a link come in the order of time
    varies: ClassVar[bool] = False  # True: `delivery` depends on the link
    FIELDS: ClassVar[list[tuple[Any, ...]]]  # of its record in the parameters of all losses; all 0: no effect

    @classmethod
    @abstractmethod
    def create(cls, context: ChannelContext) -> "FrameLoss | None":
        """Return the loss model of this medium; None if its radio does not have it."""

    @abstractmethod
    def write(self, params: Any) -> None:
        """Set the fields of `params`, its record."""

    @property
    def passing(self) -> float:
        """Long-run share of frames that pass on every link."""
        return 1.0

    def delivery(self, sender: IntArray, receiver: IntArray, at_ns: int) -> FloatArray | float:
        """Return the part of the delivery that depends on the link between robot rows, (k,); `passing` is the other."""
        return 1.0

    def continue_from(self, previous: "FrameLoss", at_ns: int) -> None:  # noqa: B027 - most have no state
        """Copy the state of `previous`, the same loss model with the radio parameters valid until `at_ns`."""


@kernel()
def fixed_loss(params: Any, frame: Any):
    """Return LOST if u < loss."""
    return LOST if params.loss > 0.0 and loss_uniform(frame, LOSS, ACK_LOSS) < params.loss else UNDER_WAY


class FixedLoss(FrameLoss):
    """A Bernoulli trial with probability `loss` for each packet and receiver."""

    name = "fixed_loss"
    keys = ("loss",)
    FIELDS: ClassVar = [("loss", np.float64)]

    @classmethod
    def create(cls, context: ChannelContext) -> FrameLoss | None:
        """Return the loss if the radio has one."""
        return FixedLoss(context.radio.loss) if context.radio.loss > 0.0 else None

    def __init__(self, loss: float) -> None:
        self._loss = float(loss)

    def write(self, params: Any) -> None:
        """Set the probability."""
        params.loss = self._loss

    @property
    def passing(self) -> float:
        """1 - loss."""
        return 1.0 - self._loss
