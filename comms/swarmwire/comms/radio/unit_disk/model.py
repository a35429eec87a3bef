"""The unit disk as a radio model: queues of the senders, then one walk over the links in range.

The fates of a packet are decided when it goes on air, since later packets do not change them.
"""

# pyright: basic, reportUnknownMemberType=false

from dataclasses import replace
from typing import Any

import numpy as np

from swarmwire.comms.base.arrays import AnyArray, BoolArray, FloatArray, IntArray, Table
from swarmwire.comms.base.geometry.robot_index import Grid, grid_over
from swarmwire.comms.base.kernels import kernel, njit
from swarmwire.comms.base.sentinels import ABSENT, BROADCAST, UNDER_WAY
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.context import ChannelContext
from swarmwire.comms.radio.disruption import Disruption
from swarmwire.comms.radio.links import OUT_OF_RANGE, RECEIVED, Links, fill_remainder
from swarmwire.comms.radio.liveness import LivenessHistory
from swarmwire.comms.radio.model import RadioModel, edges_above
from swarmwire.comms.radio.stages.blocking import BodiesBlock, Disrupted, LineOfSight
from swarmwire.comms.radio.stages.chain import (
    BLOCKED,
    StagesBefore,
    after_reception,
    fate_before_reception,
    stages_after,
)
from swarmwire.comms.radio.stages.link_draws import ReceivedFrame
from swarmwire.comms.radio.stages.losses import AT_FRAME_NS, LossChain
from swarmwire.comms.radio.transmissions import DECIDED, WAITING, Transmissions
from swarmwire.comms.radio.unit_disk.neighbours import Neighbours, find_neighbours, pairs_in_range
from swarmwire.comms.radio.unit_disk.tx_queue import TOO_LARGE, TxQueues, leave_queue
from swarmwire.comms.robot.packets import SentPackets

NO_ORDER = np.empty(0, np.int64)
ALREADY_DUE_NS = -1  # no packet becomes due by this time


@njit(nogil=True)
def decide(
    until_ns: int,
    order: AnyArray,
    packets: Any,
    used: Any,
    links: Any,
    link_used: Any,
    neighbours: Neighbours,
    pose: AnyArray,
    keys: AnyArray,
    alive_in: AnyArray,
    first_epoch: int,
    cuts: Any,
    before: Any,
    after: Any,
):
    """Decide the fates of the packets that leave their queue before `until_ns`, or are DUE, at each receiver in range.

    Append a link for each, and then a row per packet for the remainder. Return the number of packets that wait; or, if
    the table of links lacks room, minus the number of rows to append, and nothing is decided.

    Args:
        until_ns: the end of the time that passes.
        order: packets in the order of their tests, (packets,); empty: in the order of their rows.
        packets: the table of packets.
        used: number of packets.
        links: the table of links.
        link_used: number of links.
        neighbours: robots in range.
        pose: poses of the robots, (rows, 4).
        keys: keys of draws, (arenas,).
        alive_in: robots that were alive in each epoch, (epochs, rows).
        first_epoch: the first epoch in `alive_in`.
        cuts: the active disruption.
        before: `StagesBefore`.
        after: `stages_after`.
    """
    first, other, robots = neighbours.first, neighbours.other, len(pose) // len(keys)
    row = np.full(used[0], ABSENT)  # first link of each packet that is due
    in_range, remaining = np.zeros(used[0], np.int64), np.empty(used[0], np.int64)
    end, due, waiting = link_used[0], 0, 0
    measured = before.losses.measured  # here: an attribute counts references, atomically, each time that it is read
    for p in range(used[0]):
        packet = packets[p]
        if not leave_queue(packet, until_ns, cuts):
            waiting += packet.step == WAITING
            continue
        s, row[p], remaining[p], due = packet.sender, end, packet.intended, due + 1
        if packet.fate == UNDER_WAY:
            for k in range(first[s], first[s + 1]):
                end += is_intended(packet, other[k], robots, alive_in, first_epoch)
    if end + due > len(links):
        return link_used[0] - end - due
    for q in range(used[0]):
        p = order[q] if len(order) > 0 else q
        packet, i = packets[p], row[p]
        if i == ABSENT or packet.fate == TOO_LARGE:
            continue
        s, at_ns, goes_on_air = np.int64(packet.sender), packet.off_air_at_ns, packet.fate == UNDER_WAY
        arena = s // robots
        first_row = arena * robots
        for k in range(first[s], first[s + 1]):
            r = other[k]
            if not is_intended(packet, r, robots, alive_in, first_epoch):
                continue
            frame = ReceivedFrame(
                keys[arena], s, r, s - first_row, r - first_row, packet.sequence, 0, False, at_ns, at_ns
            )
            fate = fate_before_reception(before, cuts, pose, frame, goes_on_air)
            is_in_range = fate not in (BLOCKED, OUT_OF_RANGE)
            in_range[p] += is_in_range
            if goes_on_air:
                link = links[np.uint64(i)]
                i += 1
                # Receivers out of range by a trace are in the row for the remainder, as all others out of range are.
                link.packet, link.sender, link.receiver, link.receiver_count = p, s, r, fate != OUT_OF_RANGE
                remaining[p] -= link.receiver_count
                link.in_range, link.final_at_ns, link.rssi_dbm = is_in_range, at_ns, np.nan
                link.fate = RECEIVED if fate == UNDER_WAY else fate
                if fate == UNDER_WAY:
                    after_reception(after, measured, pose, frame, link)
    for p in range(used[0]):
        if row[p] != ABSENT:
            packet = packets[p]
            packet.step = DECIDED
            fill_remainder(links[end], packet, p, remaining[p], in_range[p] if packet.fate != UNDER_WAY else 0)
            end += 1
    link_used[0] = end
    return waiting


@kernel()
def is_intended(packet: Any, receiver: int, robots: int, alive_in: AnyArray, first_epoch: int):
    """Return True for a robot to which the packet is addressed, or that was alive when it was broadcast."""
    if packet.to == BROADCAST:
        return alive_in[packet.epoch - first_epoch, receiver]
    return receiver == packet.sender - packet.sender % robots + packet.to


class UnitDisk(RadioModel):
    """A transmit queue for each sender, then the channel; pose arrays must not change."""

    def __init__(self, context: ChannelContext, packets: Transmissions, links: Links) -> None:
        self._context, self._packets, self._links = context, packets, links
        self._queues = TxQueues(context.radio, context.rows, packets)
        self._losses = LossChain.create(context)
        self._pose = np.zeros((context.rows, 4))
        self._now_ns = 0
        self._waiting = 0  # packets in the queues, or more
        self._use(context)

    def _use(self, context: ChannelContext) -> None:
        self._radio, self._grid = context.radio, _grid_of(context)
        self._sight, self._bodies = LineOfSight.create(context), BodiesBlock.create(context)
        self._with_delivery = [stage for stage in (self._sight, self._bodies, Disrupted(context)) if stage is not None]
        self._after, self._varies = stages_after(context), self._losses.varies
        self._neighbours_pose: FloatArray | None = None  # poses of the cached `_neighbours`

    @property
    def queued(self) -> Table:
        """Packets that wait in queues, of type PACKET."""
        rows = self._packets.rows
        return rows[rows["step"] == WAITING]

    def set_poses(self, pose: FloatArray) -> None:
        """Use `pose` (rows, 4) for packets that go on air from now on."""
        self._pose = pose

    def tune(self, at_ns: int, radio: Radio) -> None:
        """Use the parameters of `radio` for packets sent, or on air, from `at_ns` on."""
        self._queues.tune(radio)
        context = replace(self._context, radio=radio)
        self._losses.tune(context, at_ns)
        self._use(context)

    def accept(
        self, sent_at_ns: IntArray, sent: SentPackets, others_alive: IntArray, epoch: int, counts: AnyArray
    ) -> int:
        """Queue packets, with their time on air or their refusal."""
        self._waiting += len(sent)
        return self._queues.accept(sent_at_ns, sent, others_alive, epoch, counts)

    def pass_time(self, until_ns: int, liveness: LivenessHistory) -> None:
        """Decide the fates of packets that go on air, or are refused, before `until_ns`."""
        if self._waiting:
            self._decide(until_ns, liveness)
        self._now_ns = until_ns

    def disrupt(self, at_ns: int, disruption: Disruption, liveness: LivenessHistory) -> None:
        """End the queues of dead robots and pause those of radios that are off; packets on air have their fates."""
        if self._queues.end_dead(at_ns, disruption.alive):
            self._decide(ALREADY_DUE_NS, liveness)
        self._queues.switch(at_ns, disruption)

    def drain(self) -> Table:
        """Return all queued packets; they leave the table with the last links."""
        queued = self.queued
        self._packets.rows["step"] = DECIDED
        return queued

    def edges(self, pose: FloatArray, alive: BoolArray) -> IntArray:
        """Return the edges of the radio graph: robot rows a < b, sorted, (e, 2)."""
        pairs = pairs_in_range(self._in_range(pose), alive)
        losses, delivery = self._losses, self._losses.passing
        stages = [stage for stage in self._with_delivery if not stage.passes_all]
        if stages or self._varies:
            a, b = np.ascontiguousarray(pairs.T)
            delivery = delivery * np.minimum(losses.delivery(a, b, self._now_ns), losses.delivery(b, a, self._now_ns))
            for stage in stages:
                delivery = delivery * stage.delivery(a, b, pose)
        return edges_above(pairs, delivery, self._radio.min_delivery)

    def _decide(self, until_ns: int, liveness: LivenessHistory) -> None:
        pose, packets, links, disruption = self._pose, self._packets, self._links, self._context.disruption
        neighbours, sight, bodies = self._in_range(pose), self._sight, self._bodies
        before = StagesBefore(
            sight and sight.params(pose),
            bodies and bodies.params(pose),
            self._losses.losses(AT_FRAME_NS, self._now_ns, len(neighbours.other)),
        )
        order = NO_ORDER
        if self._losses.has_state:  # frames of a link are tested in the order of time
            order = np.argsort(packets.rows["off_air_at_ns"], kind="stable")
        for _ in range(2):
            waiting = decide(
                *(until_ns, order, packets.table, packets.used, links.table, links.used, neighbours, pose),
                *(self._context.keys, liveness.alive, liveness.first_epoch, disruption.cuts, before, self._after),
            )
            if waiting >= 0:
                break
            links.reserve(-waiting)
        self._waiting = waiting

    def _in_range(self, pose: FloatArray) -> Neighbours:
        """Return the robots in range of each other, cached for the packets and the radio graph of a tick."""
        if pose is not self._neighbours_pose:
            assert self._radio.range_m is not None  # `RadioMedium` refuses a unit disk without a range
            running, wrap_m = self._context.running, self._context.wrap_m
            self._neighbours = find_neighbours(self._grid, pose, running, wrap_m, self._radio.range_m)
            self._neighbours_pose = pose
        return self._neighbours


def _grid_of(context: ChannelContext) -> Grid:
    """Return the grid in which the robots in range of a robot are in its cell or in adjacent ones."""
    assert context.radio.range_m is not None  # `RadioMedium` refuses a unit disk without a range
    arenas, clamps = len(context.keys), not context.is_torus
    return grid_over(context.size_m, context.radio.range_m, arenas, arenas * context.robots, clamps)
