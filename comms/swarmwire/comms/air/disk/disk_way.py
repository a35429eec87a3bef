"""The disk's way: a packet's fates are decided when it goes on air, since no other packet changes them."""

from dataclasses import replace

import numpy as np

from swarmwire.comms.air.disk.channel import Channel
from swarmwire.comms.air.disk.senders import Senders
from swarmwire.comms.air.disruption import Disruption
from swarmwire.comms.air.links import Links
from swarmwire.comms.air.lives import Lives
from swarmwire.comms.air.radio import Radio
from swarmwire.comms.air.stages.stage import Medium
from swarmwire.comms.air.transmissions import Transmissions
from swarmwire.comms.air.way import Decided, Way
from swarmwire.comms.arrays import BoolArray, FloatArray, IntArray
from swarmwire.comms.packets import Sent

NEVER_NS = 2**63 - 1


class DiskWay(Way):
    """Senders with a queue each, then the chain of stages."""

    def __init__(self, medium: Medium) -> None:
        self._medium = medium
        self._senders = Senders(medium.radio, len(medium.keys) * medium.robots)
        self._channel = Channel(medium)
        self._pose = np.zeros((len(medium.keys) * medium.robots, 3))
        self._held, self._columns = medium.disruption, len(medium.radio.gives.columns)
        self._now_ns = 0

    @property
    def queued(self) -> Transmissions:
        """Packets that still wait."""
        return self._senders.queued

    def hold(self, pose: FloatArray) -> None:
        """Packets that go on air from now on find robots at `pose` (rows, 3)."""
        self._pose = pose

    def tune(self, at_ns: int, radio: Radio) -> None:
        """The radio has other numbers for packets handed over, or on air, from `at_ns` on."""
        self._senders.tune(radio)
        self._channel.tune(at_ns, replace(self._medium, radio=radio))

    def accept(self, sent_at_ns: IntArray, sent: Sent, others_alive: IntArray, epoch: int) -> Transmissions:
        """Queue packets: when they will go on air, or be refused, is known at once."""
        return self._senders.accept(sent_at_ns, sent, others_alive, epoch)

    def pass_time(self, until_ns: int, lives: Lives) -> Decided:
        """What goes on air, or is refused, before `until_ns`."""
        self._now_ns = until_ns
        return self._decided(self._senders.leave(until_ns, self._held), lives)

    def disrupt(self, at_ns: int, coming: Disruption, lives: Lives) -> Decided:
        """The queues of the dead end, those of radios that are off may wait; what is on air has its fates already."""
        decided = self._decided(self._senders.die(at_ns, coming.alive), lives)
        self._senders.switch(at_ns, coming)
        return decided

    def drain(self) -> Transmissions:
        """Take out all that is queued."""
        return self._senders.leave(NEVER_NS, self._held)

    def edges(self, pose: FloatArray, alive: BoolArray) -> IntArray:
        """Pairs of robot rows a < b joined in the radio graph, sorted, (e, 2)."""
        return self._channel.edges(pose, alive, self._now_ns)

    def _decided(self, packets: Transmissions, lives: Lives) -> Decided:
        if not packets:
            return packets, Links.none(self._columns)
        return packets, self._channel.decide(packets, self._pose, lives)
