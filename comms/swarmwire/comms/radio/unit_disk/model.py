"""The way from senders' radios to receivers: links in range, then the chain of stages."""

from dataclasses import replace

import numpy as np

from swarmwire.comms.arrays import BoolArray, FloatArray, IntArray
from swarmwire.comms.packets import BROADCAST, Fate, SentPackets
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.counters import LivenessHistory
from swarmwire.comms.radio.disruption import Disruption
from swarmwire.comms.radio.links import RECEIVED, Links
from swarmwire.comms.radio.model import Decided, RadioModel
from swarmwire.comms.radio.stages.chain import chain
from swarmwire.comms.radio.stages.stage import ChannelContext
from swarmwire.comms.radio.transmissions import Transmissions
from swarmwire.comms.radio.unit_disk.neighbours import Reach, links_in_reach, pairs_in_reach, reach, reach_on_torus
from swarmwire.comms.radio.unit_disk.tx_queue import TxQueues

# 1 - 0.9 is a hair below 0.1.
ROUNDING = 1e-9


class Channel:
    """Decides what becomes of packets at robots that stand at given poses: arrays that nobody writes to any more."""

    def __init__(self, context: ChannelContext) -> None:
        self._radio, self._size_m = context.radio, context.size_m
        self._arenas, self._running = len(context.keys), context.running
        self._find_reach = reach_on_torus if context.is_torus else reach
        self._columns = len(context.radio.measures.columns)
        self._stages = chain(context)
        self._known_pose: FloatArray | None = None  # for which it is known who is in range

    def tune(self, at_ns: int, context: ChannelContext) -> None:
        """The medium's radio has other numbers from `at_ns` on; stages keep what they remember."""
        before = {type(stage): stage for stage in self._stages if stage.remembers}
        self._radio, self._stages, self._known_pose = context.radio, chain(context), None
        for stage in self._stages:
            if type(stage) in before:
                stage.go_on_from(before[type(stage)], at_ns)

    def decide(self, packets: Transmissions, pose: FloatArray, lives: LivenessHistory) -> Links:
        """What becomes of packets that go on air, or are refused, while robots stand at `pose`."""
        # No geometry for what is too large; for a full queue it tells how many it would have reached.
        tried = np.flatnonzero(packets.fate != Fate.TOO_LARGE)
        # Alive or not: some that are dead by now were meant, some alive by now were not.
        robots, sender, to = len(pose) // self._arenas, packets.sender.take(tried), packets.to.take(tried)
        found, receiver = links_in_reach(self._reach(pose), robots, sender, to)
        packet = tried.take(found)
        if lives.any_dead:
            meant = lives.intended(packets.epoch[packet], receiver) | (packets.to[packet] != BROADCAST)
            packet, receiver = packet[meant], receiver[meant]
        refused, in_range = packets.fate != RECEIVED, np.zeros(len(packets.sender), np.int64)
        if refused.any():
            never = refused[packet]
            in_range = self._would_reach(packets, packet[never], receiver[never], pose)
            packet, receiver = packet[~never], receiver[~never]
        links = Links.with_the_rest(packets, packet, receiver, in_range, self._columns)
        under_way = links.first(len(packet))
        for stage in self._stages:
            stage.decide(under_way, pose)
        return links

    def _would_reach(self, packets: Transmissions, packet: IntArray, receiver: IntArray, pose: FloatArray) -> IntArray:
        """How many receivers in range packets would have that never go on air, (packets,)."""
        zero = np.zeros(len(packets.sender), np.int64)
        links = Links.with_the_rest(packets, packet, receiver, zero, self._columns).first(len(packet))
        for stage in self._stages:
            if not stage.remembers:
                stage.decide(links, pose)
        found = zero.copy()
        np.add.at(found, links.packet, links.in_range)
        return found

    def edges(self, pose: FloatArray, alive: BoolArray, at_ns: int) -> IntArray:
        """Pairs of robot rows a < b joined in the radio graph at a time, sorted, (e, 2)."""
        pair = pairs_in_reach(self._reach(pose), alive)
        stages = [stage for stage in self._stages if not stage.lets_all_pass]
        if not stages:
            return pair
        zero = np.zeros(len(pair), np.int64)
        a, b = np.ascontiguousarray(pair.T)
        links = Links.under_way(zero, a, b, zero, np.full(len(pair), at_ns), 0)
        probability = np.ones(len(pair))
        for stage in stages:
            probability *= stage.delivery(links, pose)
        joined = probability >= self._radio.min_delivery - ROUNDING
        return pair if joined.all() else pair[joined]

    def _reach(self, pose: FloatArray) -> Reach:
        """Who is in range of whom; the poses of a tick serve its radio graph and the packets that go on air in it."""
        if pose is not self._known_pose:
            assert self._radio.range_m is not None  # `RadioMedium` has refused a unit disk without
            self._known = self._find_reach(pose, self._running, self._size_m, self._radio.range_m)
            self._known_pose = pose
        return self._known


# --- The unit disk's way: a packet's fates are decided when it goes on air, since no other packet changes them.


NEVER_NS = 2**63 - 1


class UnitDisk(RadioModel):
    """Senders with a queue each, then the chain of stages."""

    def __init__(self, context: ChannelContext) -> None:
        self._context = context
        self._senders = TxQueues(context.radio, len(context.keys) * context.robots)
        self._channel = Channel(context)
        self._pose = np.zeros((len(context.keys) * context.robots, 3))
        self._held, self._columns = context.disruption, len(context.radio.measures.columns)
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
        self._channel.tune(at_ns, replace(self._context, radio=radio))

    def accept(self, sent_at_ns: IntArray, sent: SentPackets, others_alive: IntArray, epoch: int) -> Transmissions:
        """Queue packets: when they will go on air, or be refused, is known at once."""
        return self._senders.accept(sent_at_ns, sent, others_alive, epoch)

    def pass_time(self, until_ns: int, lives: LivenessHistory) -> Decided:
        """What goes on air, or is refused, before `until_ns`."""
        self._now_ns = until_ns
        return self._decided(self._senders.leave(until_ns, self._held), lives)

    def disrupt(self, at_ns: int, coming: Disruption, lives: LivenessHistory) -> Decided:
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

    def _decided(self, packets: Transmissions, lives: LivenessHistory) -> Decided:
        if not packets:
            return packets, Links.none(self._columns)
        return packets, self._channel.decide(packets, self._pose, lives)
