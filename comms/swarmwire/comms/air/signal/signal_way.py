"""The way of signals: one run of events decides access and reception together, since each depends on the other."""

# pyright: basic, reportUnknownMemberType=false

import numpy as np

from swarmwire.comms.air.channel import with_the_rest
from swarmwire.comms.air.disruption import Disruption
from swarmwire.comms.air.frames import airtime_ns
from swarmwire.comms.air.intake import Intake
from swarmwire.comms.air.links import HEARD, Links
from swarmwire.comms.air.lives import Lives
from swarmwire.comms.air.reception.burst_states import BurstStates
from swarmwire.comms.air.reception.parameters import Bursts
from swarmwire.comms.air.send_times import SendTimes
from swarmwire.comms.air.signal import events
from swarmwire.comms.air.signal.event_queue import event_queue
from swarmwire.comms.air.signal.learning import learned, result_at_first, sent_in_vain
from swarmwire.comms.air.signal.links_held import LinksHeld, open_ways
from swarmwire.comms.air.signal.numbers import edge_dbm, levels_of, rules_of, surroundings_of
from swarmwire.comms.air.signal.tables import (
    NOBODY,
    PACKET,
    RECEPTION,
    ROBOT,
    SILENT,
    Bursting,
    State,
    Table,
    Told,
    told,
)
from swarmwire.comms.air.stage import Medium
from swarmwire.comms.air.stages import chain_after_reception
from swarmwire.comms.air.traffic.access_timing import IEEE_802_15_4
from swarmwire.comms.air.transmissions import Transmissions
from swarmwire.comms.air.way import Decided, Way
from swarmwire.comms.arrays import BoolArray, FloatArray, IntArray
from swarmwire.comms.fates import Fate
from swarmwire.comms.outcomes import Outcomes
from swarmwire.comms.packets import BROADCAST, Sent

LEAST_ROOM = 4096
LONG_AGO_NS = -(10**15)
HEADER_BYTES = 6  # of IEEE 802.15.4 before its PSDU


class SignalWay(Way):
    """Packets queue, go on air by the access method, and are received or not by signal, noise and interference."""

    def __init__(
        self, medium: Medium, size_m: tuple[float, float], send_times: SendTimes, radius_m: FloatArray
    ) -> None:
        """`radius_m` (rows,) are the robots' radii."""
        self._medium, self._radio, self._send_times = medium, medium.radio, send_times
        rows = len(medium.keys) * medium.robots
        self._rules = rules_of(medium.radio, medium.robots)
        around = surroundings_of(medium.radio, medium.keys, radius_m)
        self._links = LinksHeld(medium, size_m, around, levels_of(medium.radio, self._rules))
        self._edge_dbm = edge_dbm(medium.radio, self._rules)
        self._intake = Intake(rows)
        self._stages = chain_after_reception(medium)
        self._columns = len(medium.radio.gives.columns)
        self._bursts = BurstStates(medium.radio.bursts or Bursts(), medium.keys, medium.robots)
        self._events = event_queue(rows)
        self._robot: Table = np.zeros(rows, ROBOT)
        self._robot["packet"] = self._robot["answers_to"] = NOBODY
        self._reception: Table = np.zeros(rows, RECEPTION)
        self._reception["locked_to"], self._reception["signal_mw"] = NOBODY, np.inf
        self._robot["free_from_ns"] = LONG_AGO_NS
        self._queued, self._packet = Transmissions.none(), np.zeros(0, PACKET)
        self._hold, self._poses = 0, {0: np.zeros((rows, 3))}
        self._now_ns = self._told = 0
        self._outcomes: list[Outcomes] = []

    @property
    def queued(self) -> Transmissions:
        """Packets that still wait, or are under way."""
        return self._queued

    def hold(self, pose: FloatArray) -> None:
        """Robots stand at `pose` (rows, 3) from now on."""
        self._hold += 1
        on_air = {int(hold) for hold in self._robot["hold"][self._robot["on_air"] != SILENT]}
        self._poses = {hold: at for hold, at in self._poses.items() if hold in on_air} | {self._hold: pose}
        self._links.move(pose, self._robot, self._reception)

    def accept(self, at_ns: int, tick: int, sent: Sent, others_alive: IntArray, epoch: int) -> Transmissions:
        """Queue packets; when they go on air will turn out."""
        if self._rules.acknowledged:
            self._outcomes.append(sent_in_vain(sent, self._radio.max_payload_bytes))
        taken = self._intake.take(self._send_times.at(at_ns, tick), sent, others_alive, epoch)
        self._packet = np.concatenate([self._packet, self._as_packets(taken)])
        self._queued = self._queued.followed_by(taken)
        return taken

    def pass_time(self, until_ns: int, lives: Lives) -> Decided:
        """Let happen what is due before `until_ns`."""
        parts: list[Told] = []
        if len(self._packet) or self._events.size[0]:
            state, start = self._state()
            bursts = self._bursting()
            events.line_up(state, self._events, start)
            most = int(max((state.places.stop - state.places.first).max(), _lengths(self._robot).max()))
            room = told(max(LEAST_ROOM, 2 * (most + events.FEW + len(self._packet)), 2 * self._told))
            done = False
            while not done:
                done = events.run_until(self._rules, bursts, state, self._events, room, most, until_ns)
                parts.append(_taken_out(room))
            self._told = sum(len(part.packet) for part in parts)
            self._bursts.added(int(bursts.added[0]))
        self._now_ns = until_ns
        return self._decided(parts, lives)

    def disrupt(self, at_ns: int, coming: Disruption, lives: Lives) -> Decided:
        """The queues of the dead end, and what the dead and radios that are off were receiving."""
        state, start = self._state()
        events.line_up(state, self._events, start)
        room = told(len(self._packet) + 1)
        events.stop_the_dead(state, self._events, room, coming.alive, at_ns)
        events.cut_off(state, coming.alive, coming.radio_on)
        return self._decided([_taken_out(room)], lives)

    def outcomes(self, alive: BoolArray) -> Outcomes:
        """What senders have learned since the last call, those `alive` (rows,)."""
        told, self._outcomes = Outcomes.joined(self._outcomes), []
        return told.select(np.flatnonzero(alive[told.row])) if len(told) else told

    def drain(self) -> Transmissions:
        """Take out all that is queued or under way."""
        packets, self._queued, self._packet = self._queued, Transmissions.none(), np.zeros(0, PACKET)
        self._events.size[0] = 0
        self._events.place[:] = NOBODY
        return packets

    def edges(self, pose: FloatArray, alive: BoolArray) -> IntArray:
        """Pairs of robot rows a < b joined in the radio graph, sorted, (e, 2)."""
        links = self._links
        pairs = links.pairs if np.array_equal(pose, links.pose) else links.pairs_at(pose)
        is_open = alive[pairs.a] & alive[pairs.b] & (pairs.blocked == 0)
        is_open &= open_ways(self._medium.disruption, pairs.a, pairs.b)
        joined = is_open & (links.worse_dbm(pairs) >= self._edge_dbm)
        return np.stack(np.divmod(np.sort((pairs.a * len(pose) + pairs.b)[joined]), len(pose)), axis=1)

    def _as_packets(self, taken: Transmissions) -> Table:
        radio, robots = self._radio, self._medium.robots
        frame_bytes = taken.payloads.sizes + radio.overhead_bytes
        packet: Table = np.zeros(len(taken.sender), PACKET)
        packet["sender"], packet["sequence"] = taken.sender, taken.sequence
        packet["to"] = np.where(taken.to == BROADCAST, NOBODY, taken.sender - taken.sender % robots + taken.to)
        packet["sent_at_ns"] = packet["on_air_at_ns"] = taken.sent_at_ns
        packet["airtime_ns"], packet["bits"] = airtime_ns(radio, frame_bytes), 8 * frame_bytes
        packet["refused"] = np.where(taken.payloads.sizes > radio.max_payload_bytes, int(Fate.TOO_LARGE), 0)
        packet["result"] = result_at_first(taken.payloads.sizes, radio.max_payload_bytes)
        if radio.access_or_default.method == "csma-802154":
            csma = IEEE_802_15_4
            short = frame_bytes - HEADER_BYTES <= csma.short_frame_octets
            packet["pause_ns"] = np.where(short, csma.short_space_ns, csma.long_space_ns)
        return packet

    def _state(self) -> tuple[State, IntArray]:
        """What events work on, and where each robot's packets start in its order, (rows + 1,)."""
        sender = self._packet["sender"]
        order = np.argsort(sender, kind="stable")
        start = np.searchsorted(sender[order], np.arange(len(self._robot) + 1))
        held = self._medium.disruption
        off = np.where(held.alive, np.where(held.radio_on, int(Fate.HEARD), int(Fate.BLACKOUT)), int(Fate.SENDER_DEAD))
        state = State(
            self._medium.keys,
            self._robot,
            self._reception,
            self._links.link,
            self._links.places,
            self._hold,
            self._packet,
            order,
            off,
        )
        return state, start

    def _bursting(self) -> Bursting:
        given = self._radio.bursts
        bursts = given or Bursts()
        if given is not None:
            self._bursts.make_room(self._now_ns, len(self._links.link.receiver))
        link, at_ns, bad = self._bursts.table
        a, b, added = 1.0 / bursts.good_s, 1.0 / bursts.bad_s, np.zeros(1, np.int64)
        return Bursting(given is not None, link, at_ns, bad, added, a, b, bursts.loss_bad, bursts.loss_good)

    def _decided(self, parts: list[Told], lives: Lives) -> Decided:
        """What was told, as packets and links; packets that are done leave the queue."""
        if not parts:
            return Transmissions.none(), Links.none(self._columns)
        row = (
            parts[0] if len(parts) == 1 else Told._make(np.concatenate(columns) for columns in zip(*parts, strict=True))
        )
        packet = self._packet
        # An addressed packet may have been heard in an earlier call, and only now be done at its sender.
        used = (packet["is_done"] > 0) & (self._queued.intended > 0)
        used[row.packet] = True
        index, local = np.flatnonzero(used), np.cumsum(used) - 1
        was_on_air, on_air_at_ns = packet["fate"] == HEARD, packet["on_air_at_ns"].copy()
        on_air_at_ns[row.packet] = row.on_air_at_ns
        packets = self._queued.select(index)._replace(
            on_air_at_ns=on_air_at_ns[index],
            off_air_at_ns=(on_air_at_ns + np.where(was_on_air, packet["airtime_ns"], 0))[index],
            fate=packet["fate"][index],
        )
        kept = row.receiver != NOBODY
        if lives.any_dead:
            kept &= _meant(self._queued, row, lives)
        if not kept.all():
            row = Told._make([*(column[kept] for column in row[:-1]), row.count])
        links = self._as_links(row, local)
        decided = with_the_rest(links, packets, self._would_reach(packets, lives), self._columns)
        self._forget_done()
        return packets, decided

    def _as_links(self, row: Told, local: IntArray) -> Links:
        """Links from rows that were told, after the stages that follow reception."""
        sender, sequence = self._packet["sender"][row.packet], self._packet["sequence"][row.packet]
        links = Links.under_way(local[row.packet], sender, row.receiver, sequence, row.final_at_ns, self._columns)
        with np.errstate(divide="ignore"):
            rssi_dbm = 10.0 * np.log10(row.power_mw)
        links = links._replace(in_range=row.in_range, fate=row.fate, rssi_dbm=rssi_dbm)
        if not self._stages:
            return links
        for hold in np.unique(row.hold).tolist():
            index = np.flatnonzero(row.hold == hold)
            of_hold = links.select(index)
            for stage in self._stages:
                stage.decide(of_hold, self._poses[hold])
            links.final_at_ns[index], links.given[index] = of_hold.final_at_ns, of_hold.given
        return links

    def _would_reach(self, packets: Transmissions, lives: Lives) -> IntArray:
        """How many receivers in range packets would have that never went on air, (packets,)."""
        found = np.zeros(len(packets.sender), np.int64)
        tried = np.flatnonzero((packets.fate != HEARD) & (packets.fate != Fate.TOO_LARGE))
        at, receiver = self._links.reached(packets.sender[tried])
        at = tried[at]
        to_all = packets.to[at] == BROADCAST
        to_one = packets.to[at] == receiver % self._medium.robots
        meant = to_one | (to_all & lives.intended(packets.epoch[at], receiver))
        np.add.at(found, at[meant], 1)
        return found

    def _forget_done(self) -> None:
        settled = self._packet["is_settled"] > 0
        if self._rules.acknowledged:
            self._outcomes.append(learned(self._packet, self._queued.outcome_id))
        kept = np.flatnonzero(self._packet["is_done"] == 0)
        queued = self._queued._replace(intended=np.where(settled, 0, self._queued.intended))
        self._queued, self._packet = queued.select(kept), self._packet[kept]


def _lengths(robot: Table) -> IntArray:
    return robot["stop_link"] - robot["first_link"]


def _taken_out(room: Told) -> Told:
    """The rows that were told, out of `room`, which is empty again."""
    count = int(room.count[0])
    rows = Told._make([*(column[:count].copy() for column in room[:-1]), room.count.copy()])
    room.count[0] = 0
    return rows


def _meant(queued: Transmissions, row: Told, lives: Lives) -> BoolArray:
    """Which rows are for receivers that were alive when the packet was sent, or that it was addressed to, (k,)."""
    return lives.intended(queued.epoch[row.packet], row.receiver) | (queued.to[row.packet] != BROADCAST)
