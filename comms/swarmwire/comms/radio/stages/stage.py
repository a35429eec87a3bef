"""The interface of a channel stage."""

from abc import ABC, abstractmethod
from typing import ClassVar

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.radio.context import ChannelContext
from swarmwire.comms.radio.links import Links


class Stage(ABC):
    """One step of a packet on its way from the sender's radio to one receiver; for a loss see `FrameLoss`."""

    name: ClassVar[str]  # its name in `swarmwire describe`
    keys: ClassVar[tuple[str, ...]]  # keys of [radio] that it uses

    @classmethod
    @abstractmethod
    def create(cls, context: ChannelContext) -> "Stage | None":
        """Return the stage for this medium; None if its radio does not need it."""

    @abstractmethod
    def decide(self, links: Links, pose: FloatArray) -> None:
        """Set the fate of links that end here, or change columns of the others; in place.

        A stage before reception works on links that are UNDER_WAY, one after it on links that are RECEIVED. One that
        ends a link before reception also sets its `in_range` to 0. `pose` (rows, 3) is that at `on_air_at_ns`: x, y in
        m, heading in rad.
        """

    def count_in_range(self, links: Links, pose: FloatArray) -> None:
        """Set `in_range` of packets that never go on air, without a change of state; by default by `decide`."""
        self.decide(links, pose)

    def continue_from(self, previous: "Stage", at_ns: int) -> None:  # noqa: B027 - most stages have no state
        """Copy the state of `previous`, the same stage with the radio parameters valid until `at_ns`."""

    @property
    def has_delivery(self) -> bool:
        """True if the stage has a `delivery` of its own."""
        return type(self).delivery is not Stage.delivery

    @property
    def passes_all(self) -> bool:
        """True if `delivery` is 1 for all links at the moment; it is then not called."""
        return False

    def delivery(self, links: Links, pose: FloatArray) -> FloatArray | float:
        """Return the probability that lone packets pass, without fast fading, for the radio graph.

        One number for each link, (k,), or for all: that of the worse direction. `final_at_ns` is the time of the graph.
        """
        return 1.0
