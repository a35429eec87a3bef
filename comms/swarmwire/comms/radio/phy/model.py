"""The SINR PHY as a radio model: queues, channel access and reception in one event simulation.

Access and reception depend on each other, so one run of events decides both. `Reporter` turns the result buffer of that
run into packets and links with fates, and passes the links through the stages that follow reception.
"""

from dataclasses import replace
from typing import Any

import numpy as np

from swarmwire.comms.base import math as portable
from swarmwire.comms.base.arrays import AnyArray, BoolArray, FloatArray, IntArray, Table
from swarmwire.comms.base.kernels import njit
from swarmwire.comms.base.sentinels import ABSENT, BROADCAST, UNDER_WAY
from swarmwire.comms.radio.config.phy import MAX_CHANNELS
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.context import ChannelContext
from swarmwire.comms.radio.disruption import Disruption
from swarmwire.comms.radio.links import RECEIVED, Links
from swarmwire.comms.radio.liveness import LivenessHistory
from swarmwire.comms.radio.model import RadioModel
from swarmwire.comms.radio.phy import advertising, esb, jamming, mac, polling, tx_queue
from swarmwire.comms.radio.phy.duty_cycle import airtime_log
from swarmwire.comms.radio.phy.event_queue import event_queue
from swarmwire.comms.radio.phy.graph import RadioGraph
from swarmwire.comms.radio.phy.ht import events
from swarmwire.comms.radio.phy.ht.state import MPDU, idle_stations
from swarmwire.comms.radio.phy.jamming import JammerTable
from swarmwire.comms.radio.phy.link_table import LinkTable
from swarmwire.comms.radio.phy.packets import PacketTable, append_results, final_statuses, frames_of
from swarmwire.comms.radio.phy.pairs import MeasuredLinks
from swarmwire.comms.radio.phy.params import phy_params_of, thresholds_of
from swarmwire.comms.radio.phy.propagation import PropagationParams, propagation_params_of
from swarmwire.comms.radio.phy.results import ResultBuffer, joined_rows, result_buffer
from swarmwire.comms.radio.phy.spreading import spreading_of
from swarmwire.comms.radio.phy.state import IDLE, PACKET, SILENT, PhyState, RadioSwitches, idle_receptions, idle_robots
from swarmwire.comms.radio.stages.chain import after_reception, stages_after
from swarmwire.comms.radio.stages.link_draws import ReceivedFrame
from swarmwire.comms.radio.stages.losses import LossChain
from swarmwire.comms.radio.transmissions import Transmissions
from swarmwire.comms.robot.packets import NO_TX_STATUSES, Fate, SentPackets, TxStatuses

EVERY_ROW = np.empty(0, np.bool_)
Poses = dict[int, FloatArray]  # poses (rows, 4) by their number


class Reporter:
    """Appends result rows to the tables of the medium as packets and links, after the stages that follow reception."""

    def __init__(self, context: ChannelContext, link_table: LinkTable, packets: Transmissions, links: Links) -> None:
        self._robots, self._keys, self._link_table = context.robots, context.keys, link_table
        self._packets, self._links = packets, links
        self.tune(context)

    def tune(self, context: ChannelContext) -> None:
        """Use the radio parameters of `context` from now on."""
        self._stages, self._measured = stages_after(context), context.measured
        self._spreading = spreading_of(context.radio, context)

    def report(self, parts: list[ResultBuffer], queued: PacketTable, poses: Poses, liveness: LivenessHistory) -> None:
        """Append packets and links of the result rows in `parts`, which are rows of `queued`."""
        if not parts:
            return
        buffer, packets, links = joined_rows(parts), self._packets, self._links
        is_intended = _is_intended(queued.queued, buffer, liveness) if liveness.any_dead else EVERY_ROW
        packets.reserve(len(queued), int(queued.queued.used[1]))
        links.reserve(int(buffer.count[0]) + len(queued))
        first_packet, first_link = len(packets), len(links)
        pose_id = append_results(
            *(queued.queued.table, queued.queued.data, queued.table, buffer, is_intended),
            *(packets.table, packets.data, packets.used, links.table, links.used),
        )
        if self._spreading is not None:
            received = links.rows[first_link : first_link + len(pose_id)]
            received["rssi_dbm"] -= self._spreading.gain_db[received["receiver"]]
        new = packets.rows[first_packet:]
        if np.count_nonzero(new["fate"] != UNDER_WAY):
            links.rows["in_range"][first_link + len(pose_id) :] = self._count_in_range(new, liveness)
        for number, pose in poses.items() if self._stages[0].has_any else ():
            index = first_link + np.flatnonzero(pose_id == number)
            if len(index):
                pass_received(index, links.table, packets.table, pose, self._keys, self._stages, self._measured)

    def _count_in_range(self, packets: Table, liveness: LivenessHistory) -> IntArray:
        """Return the receivers in range of packets that never went on air, (packets,); 0 for the others."""
        in_range, to = np.zeros(len(packets), np.int64), packets["to"]
        candidates = np.flatnonzero((packets["fate"] != UNDER_WAY) & (packets["fate"] != Fate.TOO_LARGE))
        if not len(candidates):
            return in_range
        index, receiver = self._link_table.reached(packets["sender"][candidates])
        packet = candidates[index]
        is_broadcast, is_addressee = to[packet] == BROADCAST, to[packet] == receiver % self._robots
        is_intended = is_addressee | (is_broadcast & liveness.intended(packets["epoch"][packet], receiver))
        np.add.at(in_range, packet[is_intended], 1)
        return in_range


@njit(nogil=True)
def pass_received(
    index: AnyArray, links: Any, packets: Any, pose: AnyArray, keys: AnyArray, stages: Any, measured: Any
):
    """Pass the links of `index` (k,) that were received through the stages that follow reception; in place."""
    robots = len(pose) // len(keys)
    for i in index:
        link = links[i]
        if link.fate == RECEIVED:
            s, r, sequence = np.int64(link.sender), np.int64(link.receiver), packets[link.packet].sequence
            arena, at_ns = s // robots, link.final_at_ns
            first_row = arena * robots
            frame = ReceivedFrame(keys[arena], s, r, s - first_row, r - first_row, sequence, 0, False, at_ns, at_ns)
            after_reception(stages, measured, pose, frame, link)


def _is_intended(queued: Transmissions, rows: ResultBuffer, liveness: LivenessHistory) -> BoolArray:
    """Return True for rows whose receiver was alive when the packet was sent, or is its addressee, (k,)."""
    packet, receiver = (column[: int(rows.count[0])] for column in (rows.packet, rows.receiver))
    return liveness.intended(queued.rows["epoch"][packet], receiver) | (queued.rows["to"][packet] != BROADCAST)


MIN_CAPACITY = 4096


class SinrPhy(RadioModel):
    """Packets queue, go on air by the access method, and are received depending on signal, noise and interference."""

    def __init__(self, context: ChannelContext, packets: Transmissions, links: Links) -> None:
        self._context, self._radio = context, context.radio
        rows = len(context.keys) * context.robots
        self._spreading = spreading_of(context.radio, context)
        self._params = phy_params_of(context.radio, context.robots, self._spreading)
        self._measured, self._losses = MeasuredLinks.create(context), LossChain.create(context)
        thresholds = thresholds_of(context.radio, self._params)
        self._links = LinkTable(context, self._propagation_params(), thresholds, self._measured, self._spreading)
        self._jam, self._was_jammed, self._despreading = JammerTable(context), False, self._despreading_gains()
        self._graph = RadioGraph(context, self._params, self._links, self._jam, self._losses)
        self._reports = Reporter(context, self._links, packets, links)
        self._events = event_queue(rows)
        # 802.11n, polling and advertising have event loops; compiled functions depend on the types of these tables.
        is_ht, method = self._params.ht is not None, context.radio.access_or_default.method
        is_esb, is_advertising = method == "esb", method == "advertising"
        self._robot = idle_robots(rows)
        self._reception = idle_receptions(rows * MAX_CHANNELS if is_advertising else rows)
        self._mac: Any = events if is_ht else advertising if is_advertising else mac
        self._ht = idle_stations(rows, context.robots) if is_ht else None
        self._packets, self._frames = PacketTable(rows, MPDU if is_ht else PACKET), frames_of(context.radio)
        # Queues are set up again if packets are new; no event is due before `_next_ns`.
        self._order, self._start = np.empty(0, np.int64), np.zeros(rows + 1, np.int64)
        self._is_new, self._next_ns, self._buffer = True, 0, result_buffer(MIN_CAPACITY)
        self._spent = airtime_log(rows, context.radio)
        self._switch = tx_queue.switches_of(context.disruption)
        self._esb_timing = polling.esb_timing(context.radio) if is_esb else None
        self._polling = polling.new_polling(context.stations, context.robots, len(context.keys)) if is_esb else None
        self._advertising = self._advertising_timing() if is_advertising else None
        self._pose_id, self._poses = 0, {0: np.zeros((rows, 4))}
        self._now_ns = self._poses_from_ns = self._last_rows = 0
        self._tx_status: list[TxStatuses] = []

    @property
    def queued(self) -> Table:
        """Packets that wait or are on air."""
        return self._packets.queued.rows

    def set_poses(self, pose: FloatArray) -> None:
        """Move the robots to `pose` (rows, 4)."""
        self._pose_id, self._poses_from_ns = self._pose_id + 1, self._now_ns
        self._switch, self._next_ns = tx_queue.switches_of(self._context.disruption), 0
        # The stages need the poses of frames on air, and of the last attempt at a packet that may still fail.
        needed = (self._robot["on_air"] != SILENT) | (self._robot["mac_state"] != IDLE)
        pose_ids = set(self._robot["pose_id"][needed].tolist())
        self._poses = {pose_id: self._poses[pose_id] for pose_id in self._poses.keys() & pose_ids}
        self._poses[self._pose_id] = pose
        if self._measured is not None:
            self._measured.move_to(self._now_ns)
        now = self._context.disruption
        if not all(map(np.array_equal, self._gains, (now.send_gain_db, now.receive_gain_db))):
            self._links.tune(self._propagation_params(), thresholds_of(self._radio, self._params), self._spreading)
        self._links.move(pose, self._robot, self._reception)
        self._jam.move(pose, self._links.propagation, self._despreading)
        if self._jam.anything or self._was_jammed:
            self._refresh()
        self._was_jammed = self._jam.anything

    def expect(self, pose: FloatArray) -> None:
        """Begin to compute the links of robots that will be at `pose` (rows, 4)."""
        self._links.expect(pose)

    def tune(self, at_ns: int, radio: Radio) -> None:
        """Use the parameters of `radio` from `at_ns` on; chunks received before keep the old parameters."""
        self._refresh()
        context = replace(self._context, radio=radio)
        self._radio, self._spreading = radio, spreading_of(radio, context)
        self._params = phy_params_of(radio, self._context.robots, self._spreading)
        self._despreading = self._despreading_gains()
        self._frames = frames_of(radio)
        self._esb_timing = self._esb_timing and polling.esb_timing(radio)
        self._advertising = self._advertising and self._advertising_timing()
        if not len(self._spent.minute):
            self._spent = airtime_log(len(self._robot), radio)
        self._losses.tune(context, at_ns)
        self._graph.tune(radio, self._params)
        self._reports.tune(context)
        self._links.tune(self._propagation_params(), thresholds_of(radio, self._params), self._spreading)
        self._refresh()

    def accept(
        self, sent_at_ns: IntArray, sent: SentPackets, others_alive: IntArray, epoch: int, counts: AnyArray
    ) -> int:
        """Queue packets; events decide when they go on air."""
        self._is_new, self._next_ns, before = True, 0, len(self._packets)
        result = self._packets.accept(sent_at_ns, sent, others_alive, epoch, counts, self._frames)
        if self._spreading is not None:
            self._spreading.set_airtimes(self._packets.table[before:])
        return result

    def pass_time(self, until_ns: int, liveness: LivenessHistory) -> None:
        """Handle the events due before `until_ns`."""
        parts: list[ResultBuffer] = []
        if self._next_ns < until_ns or self._jam.anything:
            parts = self._run(until_ns)
        self._now_ns = until_ns
        self._report(parts, liveness)

    def _run(self, until_ns: int) -> list[ResultBuffer]:
        """Handle the events due before `until_ns`; return the result rows, in parts; none if no packet changed."""
        parts: list[ResultBuffer] = []
        state = self._state(self._switch, until_ns)
        losses = self._losses.losses(self._poses_from_ns, self._now_ns, len(self._links.link))
        max_links = self._context.robots
        capacity = max(MIN_CAPACITY, 2 * (max_links + mac.MAX_EXTRA_ROWS + len(self._packets)), 2 * self._last_rows)
        buffer = self._buffer
        if len(buffer.packet) < capacity:
            buffer = self._buffer = result_buffer(capacity)
        buffer.count[0], next_ns = 0, mac.BUFFER_IS_FULL
        while next_ns == mac.BUFFER_IS_FULL:
            if parts:
                buffer = result_buffer(capacity)
            tables = losses, state, self._events, buffer, max_links
            if self._polling is not None:
                next_ns = esb.run_until(
                    *(self._params, self._esb_timing, self._polling, *tables),
                    *(self._now_ns, until_ns, self._start, self._is_new),
                )
            else:
                timing = () if self._advertising is None else (self._advertising,)
                next_ns = self._mac.run_until(self._params, *timing, *tables, until_ns, self._start, self._is_new)
            self._is_new = False
            parts.append(buffer)
        self._next_ns = next_ns
        self._last_rows = sum(int(part.count[0]) for part in parts)
        return parts if self._last_rows or self._packets.any_done else []

    def disrupt(self, at_ns: int, disruption: Disruption, liveness: LivenessHistory) -> None:
        """End the queues of dead robots, suspend those of radios that are off, and end the receptions of both."""
        state = self._state(tx_queue.switches_of(disruption), at_ns)
        self._mac.order_queues(state, self._events, self._start)
        buffer = result_buffer(len(self._packets) + 1)
        if self._polling is not None:
            esb.end_exchanges(self._polling, state, self._events, buffer, at_ns)
        self._mac.stop_dead(state, self._events, buffer, disruption.alive, at_ns)
        self._mac.end_receptions(self._params, state, self._events, disruption.alive, disruption.radio_on, at_ns)
        self._mac.switch(self._params, state, self._events, buffer, at_ns)
        if self._polling is not None:
            esb.resume(self._params, self._polling, state, self._events, buffer, at_ns)
        self._report([buffer], liveness)

    def tx_status(self, alive: BoolArray) -> TxStatuses:
        """Return the transmit statuses since the last call, of senders that are `alive` (rows,)."""
        if not self._tx_status:
            return NO_TX_STATUSES
        statuses, self._tx_status = TxStatuses.joined(self._tx_status), []
        return statuses.select(np.flatnonzero(alive[statuses.row])) if len(statuses) else statuses

    def drain(self) -> Table:
        """Remove and return all packets that are queued or on air."""
        self._events.size[0] = 0
        self._events.heap_index[:] = ABSENT
        return self._packets.drain()

    def edges(self, pose: FloatArray, alive: BoolArray) -> IntArray:
        """Return the edges of the radio graph, robot rows a < b, sorted, (e, 2)."""
        edges = self._graph.edges(pose, alive, self._poses_from_ns)
        if self._spreading is not None:
            edges = edges[self._spreading.are_equal(edges[:, 0], edges[:, 1])]
        return edges if self._polling is None else edges[polling.are_linked(self._polling, edges[:, 0], edges[:, 1])]

    def _propagation_params(self) -> PropagationParams:
        now = self._context.disruption
        self._gains = now.send_gain_db.copy(), now.receive_gain_db.copy()
        return propagation_params_of(self._radio, self._context)

    def _despreading_gains(self) -> FloatArray:
        """Return what the detector of each robot of an arena divides jammers by, (robots,)."""
        gain_db = np.full(self._context.robots, self._radio.despreading_db)
        if self._spreading is not None:
            gain_db += self._spreading.gain_db[: len(gain_db)]
        return portable.power(10.0, 0.1 * gain_db)

    def _refresh(self) -> None:
        """Recompute the noise of all robots, before or after a change of its sources."""
        jamming.refresh(self._params, self._state(self._switch, self._now_ns), self._events, self._now_ns)

    def _advertising_timing(self) -> advertising.AdvertisingTiming:
        return advertising.advertising_timing(self._radio, self._context.keys, self._context.robots)

    def _state(self, switch: RadioSwitches, until_ns: int) -> PhyState:
        """Return the state for events until `until_ns`, with these switches of the radios."""
        if len(self._order) != len(self._packets):
            self._order = np.empty(len(self._packets), np.int64)
        return PhyState(
            self._context.keys,
            self._robot,
            self._reception,
            self._links.link,
            self._links.ranges,
            self._pose_id,
            self._packets.table,
            self._order,
            switch,
            self._spent,
            self._jam.between(self._now_ns, until_ns),
            self._ht,
        )

    def _report(self, parts: list[ResultBuffer], liveness: LivenessHistory) -> None:
        """Report the result rows, and remove packets that are done from the queue."""
        if not parts:
            return
        packets = self._packets
        self._reports.report(parts, packets, self._poses, liveness)
        if self._params.acknowledged:
            self._tx_status.append(final_statuses(packets.table, packets.queued.rows["tx_status_id"]))
        self._is_new |= packets.forget_done()
