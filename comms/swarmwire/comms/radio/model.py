"""A way through the medium: what the medium asks of it, whatever the radio's model."""

from abc import ABC, abstractmethod

from swarmwire.comms.arrays import BoolArray, FloatArray, IntArray
from swarmwire.comms.packets import NO_TX_STATUSES, SentPackets, TxStatuses
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.counters import LivenessHistory
from swarmwire.comms.radio.disruption import Disruption
from swarmwire.comms.radio.links import Links
from swarmwire.comms.radio.transmissions import Transmissions

Decided = tuple[Transmissions, Links]


class RadioModel(ABC):
    """From the senders' radios to the receivers.

    What `pass_time` and `disrupt` return are packets and what becomes of them at their receivers (`packet` is the row
    in those packets); a fate may become final later than the time that has passed.
    """

    @property
    @abstractmethod
    def queued(self) -> Transmissions:
        """Packets that still wait, or are under way."""

    @abstractmethod
    def hold(self, pose: FloatArray) -> None:
        """Robots stand at `pose` (rows, 3) from now on, under the disruption that holds; the array stays as it is."""

    @abstractmethod
    def tune(self, at_ns: int, radio: Radio) -> None:
        """The radio has other numbers from `at_ns` on; what waits or is on air stays so."""

    @abstractmethod
    def accept(self, sent_at_ns: IntArray, sent: SentPackets, others_alive: IntArray, epoch: int) -> Transmissions:
        """Queue packets that robots hand over at `sent_at_ns` (rows,); they as the radios take them up.

        `others_alive` (rows,) are whom a broadcast intends.
        """

    @abstractmethod
    def pass_time(self, until_ns: int, lives: LivenessHistory) -> Decided:
        """Let time pass to just before `until_ns`."""

    @abstractmethod
    def disrupt(self, at_ns: int, coming: Disruption, lives: LivenessHistory) -> Decided:
        """Robots that are dead from now on lose their queues, radios that are off what they receive.

        Called while anybody is dead or off, and once when nobody is any more: queues that waited go on air.
        """

    def tx_status(self, alive: BoolArray) -> TxStatuses:
        """What senders have learned since the last call, those `alive` (rows,); nothing without acknowledgements."""
        return NO_TX_STATUSES

    @abstractmethod
    def drain(self) -> Transmissions:
        """Take out all that is queued or under way: the run is over. `intended` are the receivers not told of yet."""

    @abstractmethod
    def edges(self, pose: FloatArray, alive: BoolArray) -> IntArray:
        """Pairs of robot rows a < b joined in the radio graph, sorted, (e, 2)."""
