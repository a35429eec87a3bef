"""The unit disk as a radio model: queues of the senders, links in range, then the chain of stages.

The fates of a packet are decided when it goes on air, since later packets do not change them.
"""

from dataclasses import replace

import numpy as np

from swarmwire.comms.base.arrays import BoolArray, FloatArray, IntArray
from swarmwire.comms.base.clock import NEVER_NS
from swarmwire.comms.base.geometry.robot_index import Grid, grid_over
from swarmwire.comms.base.sentinels import BROADCAST, UNDER_WAY
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.context import ChannelContext
from swarmwire.comms.radio.disruption import Disruption
from swarmwire.comms.radio.links import Links
from swarmwire.comms.radio.liveness import LivenessHistory
from swarmwire.comms.radio.model import Decided, RadioModel, edges_above
from swarmwire.comms.radio.stages.chain import chain
from swarmwire.comms.radio.stages.stage import Stage
from swarmwire.comms.radio.transmissions import Transmissions
from swarmwire.comms.radio.unit_disk.neighbours import (
    Neighbours,
    find_neighbours,
    links_in_range,
    pairs_in_range,
)
from swarmwire.comms.radio.unit_disk.tx_queue import TxQueues
from swarmwire.comms.robot.packets import SentPackets


def _grid_of(context: ChannelContext) -> Grid:
    """Return the grid in which the robots in range of a robot are in its cell or in adjacent ones."""
    assert context.radio.range_m is not None  # `RadioMedium` refuses a unit disk without a range
    arenas, clamps = len(context.keys), not context.is_torus
    return grid_over(context.size_m, context.radio.range_m, arenas, arenas * context.robots, clamps)


class Channel:
    """Decides the fate of packets at robots with given poses; pose arrays must not change afterwards."""

    def __init__(self, context: ChannelContext) -> None:
        self._radio, self._wrap_m = context.radio, context.wrap_m
        self._arenas, self._running, self._grid = len(context.keys), context.running, _grid_of(context)
        self._columns = len(context.radio.measures.columns)
        self._set_stages(chain(context))

    def tune(self, at_ns: int, context: ChannelContext) -> None:
        """Use the radio parameters of `context` from `at_ns` on; stages keep their state."""
        previous = {type(stage): stage for stage in self._stages}
        self._radio, self._grid = context.radio, _grid_of(context)
        self._set_stages(chain(context))
        for stage in self._stages:
            if type(stage) in previous:
                stage.continue_from(previous[type(stage)], at_ns)

    def _set_stages(self, stages: tuple[Stage, ...]) -> None:
        self._stages, self._stages_with_delivery = stages, [stage for stage in stages if stage.has_delivery]
        self._neighbours_pose: FloatArray | None = None  # poses of the cached `_neighbours`

    def decide(self, packets: Transmissions, pose: FloatArray, liveness: LivenessHistory) -> Links:
        """Decide the fate of each packet at each receiver in range, with robots at `pose`, and return the links.

        Packets that end at the sender's radio only count their receivers in range.
        """
        # Robots that are dead now are included: the intended receivers are the robots that were alive when the packet
        # was sent, and the others are removed below.
        robots = len(pose) // self._arenas
        packet, receiver = links_in_range(*self._in_range(pose), robots, packets.table)
        if liveness.any_dead:
            is_intended = liveness.intended(packets.epoch[packet], receiver) | (packets.to[packet] != BROADCAST)
            packet, receiver = packet[is_intended], receiver[is_intended]
        in_range = np.zeros(len(packets), np.int64)
        is_refused_packet = packets.fate != UNDER_WAY
        if np.count_nonzero(is_refused_packet):
            is_refused = is_refused_packet[packet]
            in_range = self._count_in_range(packets, packet[is_refused], receiver[is_refused], pose)
            packet, receiver = packet[~is_refused], receiver[~is_refused]
        links = Links.with_remainders(packets, packet, receiver, in_range, self._columns)
        open_links = links.first(len(packet))
        for stage in self._stages:
            stage.decide(open_links, pose)
        return links

    def _count_in_range(
        self, packets: Transmissions, packet: IntArray, receiver: IntArray, pose: FloatArray
    ) -> IntArray:
        """Return the number of receivers in range of packets that never go on air, (packets,)."""
        zero = np.zeros(len(packets), np.int64)
        links = Links.with_remainders(packets, packet, receiver, zero, self._columns).first(len(packet))
        for stage in self._stages:
            stage.count_in_range(links, pose)
        in_range = zero.copy()
        np.add.at(in_range, links.packet, links.in_range)
        return in_range

    def edges(self, pose: FloatArray, alive: BoolArray, at_ns: int) -> IntArray:
        """Return the edges of the radio graph at `at_ns`: robot rows a < b, sorted, (e, 2)."""
        pairs = pairs_in_range(self._in_range(pose), alive)
        stages = [stage for stage in self._stages_with_delivery if not stage.passes_all]
        if not stages:
            return pairs
        zero = np.zeros(len(pairs), np.int64)
        a, b = np.ascontiguousarray(pairs.T)
        links = Links.under_way(zero, a, b, zero, np.full(len(pairs), at_ns), 0)
        probability = np.ones(len(pairs))
        for stage in stages:
            probability *= stage.delivery(links, pose)
        return edges_above(pairs, probability, self._radio.min_delivery)

    def _in_range(self, pose: FloatArray) -> Neighbours:
        """Return the robots in range of each other, cached for the packets and the radio graph of a tick."""
        if pose is not self._neighbours_pose:
            assert self._radio.range_m is not None  # `RadioMedium` refuses a unit disk without a range
            self._neighbours = find_neighbours(self._grid, pose, self._running, self._wrap_m, self._radio.range_m)
            self._neighbours_pose = pose
        return self._neighbours


class UnitDisk(RadioModel):
    """A transmit queue for each sender, then the channel."""

    def __init__(self, context: ChannelContext) -> None:
        self._context = context
        self._queues = TxQueues(context.radio, context.rows)
        self._channel = Channel(context)
        self._pose = np.zeros((context.rows, 3))
        self._disruption = context.disruption
        self._no_links = Links.none(len(context.radio.measures.columns))
        self._now_ns = 0  # pragma: no mutate (each step sets it first)

    @property
    def queued(self) -> Transmissions:
        """Packets that wait in queues."""
        return self._queues.queued

    def set_poses(self, pose: FloatArray) -> None:
        """Use `pose` (rows, 3) for packets that go on air from now on."""
        self._pose = pose

    def tune(self, at_ns: int, radio: Radio) -> None:
        """Use the parameters of `radio` for packets sent, or on air, from `at_ns` on."""
        self._queues.tune(radio)
        self._channel.tune(at_ns, replace(self._context, radio=radio))

    def accept(self, sent_at_ns: IntArray, sent: SentPackets, others_alive: IntArray, epoch: int) -> Transmissions:
        """Queue packets, with their time on air or their refusal."""
        return self._queues.accept(sent_at_ns, sent, others_alive, epoch)

    def pass_time(self, until_ns: int, liveness: LivenessHistory) -> Decided:
        """Decide the fates of packets that go on air, or are refused, before `until_ns`."""
        self._now_ns = until_ns
        return self._decide(self._queues.pop_due(until_ns, self._disruption), liveness)

    def disrupt(self, at_ns: int, disruption: Disruption, liveness: LivenessHistory) -> Decided:
        """End the queues of dead robots and pause those of radios that are off; packets on air have their fates."""
        decided = self._decide(self._queues.pop_dead(at_ns, disruption.alive), liveness)
        self._queues.switch(at_ns, disruption)
        return decided

    def drain(self) -> Transmissions:
        """Remove all queued packets."""
        return self._queues.pop_due(NEVER_NS, self._disruption)

    def edges(self, pose: FloatArray, alive: BoolArray) -> IntArray:
        """Return the edges of the radio graph: robot rows a < b, sorted, (e, 2)."""
        return self._channel.edges(pose, alive, self._now_ns)

    def _decide(self, packets: Transmissions, liveness: LivenessHistory) -> Decided:
        if not len(packets):
            return packets, self._no_links
        return packets, self._channel.decide(packets, self._pose, liveness)
