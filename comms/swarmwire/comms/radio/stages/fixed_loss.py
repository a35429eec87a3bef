"""Fixed loss: every frame is lost with the same probability."""

# pyright: basic, reportUnknownMemberType=false

from typing import NamedTuple

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.draws import purpose
from swarmwire.comms.draws_compiled import uniform
from swarmwire.comms.kernels import kernel
from swarmwire.comms.packets import Fate
from swarmwire.comms.radio.stages.loss import LossModel
from swarmwire.comms.radio.stages.stage import ChannelContext

LOSS, ACK_LOSS = purpose("fixed loss"), purpose("fixed loss of an acknowledgement")
RECEIVED, LOST = int(Fate.RECEIVED), int(Fate.LOST)


class FixedLossParams(NamedTuple):
    """Parameters of the kernel."""

    loss: float


@kernel()
def fixed_loss(params, frame):
    """LOST if u < loss."""
    loss = ACK_LOSS if frame.is_ack else LOSS
    u = uniform(frame.key, frame.s, frame.r, frame.sequence, loss + frame.attempt)
    return LOST if u < params.loss else RECEIVED


class FixedLoss(LossModel):
    """A Bernoulli trial with probability `loss` for each packet and receiver."""

    name = "fixed_loss"
    keys = ("loss",)
    kernel = fixed_loss
    no_params = FixedLossParams(0.0)

    @classmethod
    def of(cls, context: ChannelContext) -> LossModel | None:
        """The loss, where the radio loses anything."""
        return FixedLoss(context.radio.loss) if context.radio.loss > 0.0 else None

    def __init__(self, loss: float) -> None:
        self._params = FixedLossParams(float(loss))

    def params(self, pose: FloatArray, from_ns: int, links: int) -> FixedLossParams:
        """The probability."""
        return self._params

    @property
    def passing(self) -> float:
        """1 - loss."""
        return 1.0 - self._params.loss
