"""Reports: what events told of packets, as packets and links with fates."""

# pyright: basic, reportUnknownMemberType=false

from dataclasses import replace

import numpy as np

from swarmwire.comms.arrays import BoolArray, FloatArray, IntArray
from swarmwire.comms.packets import BROADCAST, Fate, SentPackets, TxStatuses
from swarmwire.comms.radio.config.impairments import Bursts
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.counters import LivenessHistory
from swarmwire.comms.radio.disruption import Disruption
from swarmwire.comms.radio.links import Links
from swarmwire.comms.radio.model import Decided, RadioModel
from swarmwire.comms.radio.phy import jamming, mac, tx_queue
from swarmwire.comms.radio.phy.event_queue import event_queue
from swarmwire.comms.radio.phy.graph import RadioGraph
from swarmwire.comms.radio.phy.jamming import JammerTable
from swarmwire.comms.radio.phy.link_table import LinkTable
from swarmwire.comms.radio.phy.losses import NOT_TRACED, Losses, MeasuredLinks, losses_of
from swarmwire.comms.radio.phy.packets import PacketTable, learned, sent_in_vain
from swarmwire.comms.radio.phy.params import phy_params_of, thresholds_of
from swarmwire.comms.radio.phy.propagation import PropagationParams, propagation_params_of
from swarmwire.comms.radio.phy.results import RECEIVED, ResultBuffer, room_for, taken_out
from swarmwire.comms.radio.phy.state import NOTHING, SILENT, PhyState, Table, receptions_of_nothing, robots_at_rest
from swarmwire.comms.radio.reception.bursts import BurstStates
from swarmwire.comms.radio.stages.chain import chain_after_reception
from swarmwire.comms.radio.stages.stage import ChannelContext
from swarmwire.comms.radio.transmissions import Admission, Transmissions
from swarmwire.comms.truth import NO_ROBOT

Poses = dict[int, FloatArray]  # by hold


class Reporter:
    """Makes links of what was told, and takes them through the stages that follow reception."""

    def __init__(self, context: ChannelContext, links: LinkTable) -> None:
        self._robots, self._links, self._columns = context.robots, links, len(context.radio.measures.columns)
        self.tune(context)

    def tune(self, context: ChannelContext) -> None:
        """The medium's radio has other numbers."""
        self._stages = chain_after_reception(context)

    def decided(
        self, parts: list[ResultBuffer], queued: Transmissions, packet: Table, poses: Poses, lives: LivenessHistory
    ) -> Decided:
        """What was told in one go or several, of packets `queued`, which are also the rows of `packet`."""
        if not parts:
            return Transmissions.none(), Links.none(self._columns)
        row = (
            parts[0]
            if len(parts) == 1
            else ResultBuffer._make(np.concatenate(columns) for columns in zip(*parts, strict=True))
        )
        # An addressed packet may have been received in an earlier call, and only now be done at its sender.
        used = (packet["is_done"] > 0) & (packet["is_departed"] == 0)
        used[row.packet] = True
        index, local = np.flatnonzero(used), np.cumsum(used) - 1
        was_on_air, on_air_at_ns = packet["fate"] == RECEIVED, packet["on_air_at_ns"].copy()
        on_air_at_ns[row.packet] = row.on_air_at_ns
        packets = queued.select(index)._replace(
            on_air_at_ns=on_air_at_ns[index],
            off_air_at_ns=(on_air_at_ns + np.where(was_on_air, packet["airtime_ns"], 0))[index],
            fate=packet["fate"][index],
        )
        kept = row.receiver != NO_ROBOT
        if lives.any_dead:
            kept &= _meant(queued, row, lives)
        if not kept.all():
            row = ResultBuffer._make([*(column[kept] for column in row[:-1]), row.count])
        in_range = self._would_reach(packets, lives)
        links = Links.with_the_rest(packets, local[row.packet], row.receiver, in_range, self._columns)
        self._tell(links.first(len(row.packet)), row, poses)
        return packets, links

    def _tell(self, links: Links, row: ResultBuffer, poses: Poses) -> None:
        """Put into links what was told of them, and let them pass the stages that follow reception."""
        links.in_range[:], links.fate[:], links.final_at_ns[:] = row.in_range, row.fate, row.final_at_ns
        with np.errstate(divide="ignore"):
            links.rssi_dbm[:] = 10.0 * np.log10(row.power_mw)
        if not self._stages:
            return
        for hold in np.unique(row.hold).tolist():
            index = np.flatnonzero(row.hold == hold)
            of_hold = links.select(index)
            for stage in self._stages:
                stage.decide(of_hold, poses[hold])
            links.final_at_ns[index], links.given[index] = of_hold.final_at_ns, of_hold.given

    def _would_reach(self, packets: Transmissions, lives: LivenessHistory) -> IntArray:
        """How many receivers in range packets would have that never went on air, (packets,)."""
        found = np.zeros(len(packets.sender), np.int64)
        tried = np.flatnonzero((packets.fate != RECEIVED) & (packets.fate != Fate.TOO_LARGE))
        if not len(tried):
            return found
        at, receiver = self._links.reached(packets.sender[tried])
        at = tried[at]
        to_all = packets.to[at] == BROADCAST
        to_one = packets.to[at] == receiver % self._robots
        meant = to_one | (to_all & lives.intended(packets.epoch[at], receiver))
        np.add.at(found, at[meant], 1)
        return found


def _meant(queued: Transmissions, row: ResultBuffer, lives: LivenessHistory) -> BoolArray:
    """Which rows are for receivers that were alive when the packet was sent, or that it was addressed to, (k,)."""
    return lives.intended(queued.epoch[row.packet], row.receiver) | (queued.to[row.packet] != BROADCAST)


# --- The way of signals: one run of events decides access and reception together, since each depends on the other.


MIN_ROOM = 4096


class SinrPhy(RadioModel):
    """Packets queue, go on air by the access method, and are received or not by signal, noise and interference."""

    def __init__(self, context: ChannelContext) -> None:
        self._context, self._radio = context, context.radio
        rows = len(context.keys) * context.robots
        self._rules = phy_params_of(context.radio, context.robots)
        self._measured = MeasuredLinks.of(context)
        levels = thresholds_of(context.radio, self._rules)
        self._links = LinkTable(context, self._around(), levels, self._measured)
        self._jam, self._was_jammed = JammerTable(context), False
        self._graph = RadioGraph(context, self._rules, self._links, self._jam, self._measured)
        self._reports = Reporter(context, self._links)
        self._intake = Admission(rows)
        self._bursts = BurstStates(context.radio.bursts or Bursts(), context.keys, context.robots)
        self._events = event_queue(rows)
        self._robot, self._reception = robots_at_rest(rows), receptions_of_nothing(rows)
        self._packets = PacketTable()
        self._hold, self._poses = 0, {0: np.zeros((rows, 3))}
        self._now_ns = self._told = 0
        self._tx_status: list[TxStatuses] = []

    @property
    def queued(self) -> Transmissions:
        """Packets that still wait, or are under way."""
        return self._packets.queued

    def hold(self, pose: FloatArray) -> None:
        """Robots stand at `pose` (rows, 3) from now on."""
        self._hold += 1
        # Of frames on air, and of packets that may yet be given up: their last attempt may be long ago.
        needed = (self._robot["on_air"] != SILENT) | (self._robot["stage"] != NOTHING)
        holds = set(self._robot["hold"][needed].tolist())
        self._poses = {hold: at for hold, at in self._poses.items() if hold in holds} | {self._hold: pose}
        if self._measured is not None:
            self._measured.move_to(self._now_ns)
        now = self._context.disruption
        if not all(map(np.array_equal, self._gains, (now.send_gain_db, now.receive_gain_db))):
            self._links.tune(self._around(), thresholds_of(self._radio, self._rules))
        self._links.move(pose, self._robot, self._reception)
        self._jam.move(pose, self._links.around)
        if self._jam.anything or self._was_jammed:
            self._refresh()
        self._was_jammed = self._jam.anything

    def tune(self, at_ns: int, radio: Radio) -> None:
        """The radio has other numbers from `at_ns` on; what was received until then counts by the old ones."""
        self._refresh()
        if radio.bursts is not None:
            self._bursts.change(radio.bursts, at_ns)
        self._radio, self._rules = radio, phy_params_of(radio, self._context.robots)
        self._graph.tune(radio, self._rules)
        self._reports.tune(replace(self._context, radio=radio))
        self._links.tune(self._around(), thresholds_of(radio, self._rules))
        self._refresh()

    def accept(self, sent_at_ns: IntArray, sent: SentPackets, others_alive: IntArray, epoch: int) -> Transmissions:
        """Queue packets; when they go on air will turn out."""
        if self._rules.acknowledged:
            self._tx_status.append(sent_in_vain(sent, self._radio.max_payload_bytes))
        taken = self._intake.take(sent_at_ns, sent, others_alive, epoch)
        self._packets.add(taken, self._radio, self._context.robots)
        return taken

    def pass_time(self, until_ns: int, lives: LivenessHistory) -> Decided:
        """Let happen what is due before `until_ns`."""
        parts: list[ResultBuffer] = []
        if len(self._packets) or self._events.size[0] or self._jam.anything:
            state, start = self._state(self._context.disruption, until_ns)
            losses = self._losses()
            mac.line_up(state, self._events, start)
            most = int(max((state.places.stop - state.places.first).max(), _lengths(self._robot).max()))
            room = room_for(max(MIN_ROOM, 2 * (most + mac.FEW + len(self._packets)), 2 * self._told))
            done = False
            while not done:
                done = mac.run_until(self._rules, losses, state, self._events, room, most, until_ns)
                parts.append(taken_out(room))
            self._told = sum(len(part.packet) for part in parts)
            self._bursts.count_added(losses.bursts)
        self._now_ns = until_ns
        return self._decided(parts, lives)

    def disrupt(self, at_ns: int, coming: Disruption, lives: LivenessHistory) -> Decided:
        """The queues of the dead end, those of radios that are off may wait; they hear nothing of what is on air."""
        state, start = self._state(coming, at_ns)
        mac.line_up(state, self._events, start)
        room = room_for(len(self._packets) + 1)
        mac.stop_the_dead(state, self._events, room, coming.alive, at_ns)
        mac.cut_off(self._rules, state, self._events, coming.alive, coming.radio_on, at_ns)
        tx_queue.switch(self._rules, state, self._events, room, at_ns)
        return self._decided([taken_out(room)], lives)

    def tx_status(self, alive: BoolArray) -> TxStatuses:
        """What senders have learned since the last call, those `alive` (rows,)."""
        told, self._tx_status = TxStatuses.joined(self._tx_status), []
        return told.select(np.flatnonzero(alive[told.row])) if len(told) else told

    def drain(self) -> Transmissions:
        """Take out all that is queued or under way."""
        self._events.size[0] = 0
        self._events.place[:] = NO_ROBOT
        return self._packets.drain()

    def edges(self, pose: FloatArray, alive: BoolArray) -> IntArray:
        """Pairs of robot rows a < b joined in the radio graph, sorted, (e, 2)."""
        return self._graph.edges(pose, alive)

    def _around(self) -> PropagationParams:
        now = self._context.disruption
        self._gains = now.send_gain_db.copy(), now.receive_gain_db.copy()
        return propagation_params_of(self._radio, self._context)

    def _refresh(self) -> None:
        """Noise, or what it is made of, has changed, or is about to."""
        state, _ = self._state(self._context.disruption, self._now_ns)
        jamming.refresh(self._rules, state, self._events, self._now_ns)

    def _state(self, held: Disruption, until_ns: int) -> tuple[PhyState, IntArray]:
        """What events work on until then, and where each robot's packets start in its order, (rows + 1,)."""
        order, start = self._packets.by_sender(len(self._robot))
        state = PhyState(
            self._context.keys,
            self._robot,
            self._reception,
            self._links.link,
            self._links.places,
            self._hold,
            self._packets.table,
            order,
            tx_queue.fate_of_sending(held),
            self._jam.between(self._now_ns, until_ns),
        )
        return state, start

    def _losses(self) -> Losses:
        if self._radio.bursts is not None:
            self._bursts.make_room(self._now_ns, len(self._links.link))
        traced = NOT_TRACED if self._measured is None else self._measured.traced
        return losses_of(self._radio, traced, self._bursts)

    def _decided(self, parts: list[ResultBuffer], lives: LivenessHistory) -> Decided:
        """What was told, as packets and links; packets that are done leave the queue."""
        packets = self._packets
        decided = self._reports.decided(parts, packets.queued, packets.table, self._poses, lives)
        if parts:
            if self._rules.acknowledged:
                self._tx_status.append(learned(packets.table, packets.queued.tx_status_id))
            packets.forget_done()
        return decided


def _lengths(robot: Table) -> IntArray:
    return robot["stop_link"] - robot["first_link"]
