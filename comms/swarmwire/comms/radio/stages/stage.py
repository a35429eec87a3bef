"""The interface of a channel stage."""

from abc import ABC, abstractmethod
from typing import Any, ClassVar

from swarmwire.comms.base.arrays import FloatArray, IntArray
from swarmwire.comms.radio.context import ChannelContext


class Stage(ABC):
    """One step of a packet on its way from the sender's radio to one receiver; for a loss see `FrameLoss`.

    Beside it is a kernel for one link, which `chain.py` calls.
    """

    name: ClassVar[str]  # its name in `swarmwire describe`
    keys: ClassVar[tuple[str, ...]]  # keys of [radio] that it uses
    # Fields of its record in the parameters of the chain; all 0, they have no effect.
    FIELDS: ClassVar[list[tuple[Any, ...]]] = []

    @classmethod
    @abstractmethod
    def create(cls, context: ChannelContext) -> "Stage | None":
        """Return the stage for this medium; None if its radio does not need it."""

    def write(self, params: Any) -> None:  # noqa: B027 - some stages have arrays in place of a record
        """Set the fields of `params`, its record."""

    @property
    def passes_all(self) -> bool:
        """True if `delivery` is 1 for all links at the moment; it is then not called."""
        return type(self).delivery is Stage.delivery

    def delivery(self, sender: IntArray, receiver: IntArray, pose: FloatArray) -> FloatArray:
        """Return the probability that lone packets pass between robot rows, for the radio graph, (k,).

        It is that of the worse direction, without fast fading.
        """
        raise NotImplementedError
