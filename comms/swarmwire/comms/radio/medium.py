"""The radio medium as a state machine: packets and poses go in, time passes, and received packets come out.

It does no I/O and reads no clock. `RadioMedium` drives a radio model (unit disk or PHY), keeps links until their fate
is final, and counts the fates.
"""

# pyright: basic, reportUnknownMemberType=false

from functools import partial, reduce
from operator import add

import numpy as np

from swarmwire.comms.base.arrays import BoolArray, FloatArray, IntArray, KeyArray
from swarmwire.comms.base.clock import NEVER_NS
from swarmwire.comms.base.geometry.obstacle_index import ObstacleIndices
from swarmwire.comms.base.geometry.obstacles import Obstacles
from swarmwire.comms.base.geometry.shapes import Boundary
from swarmwire.comms.base.kernels import njit
from swarmwire.comms.base.sentinels import NO_PACKET, NO_ROBOT
from swarmwire.comms.base.threads import Threads
from swarmwire.comms.radio import results
from swarmwire.comms.radio.config.phy import Antennas
from swarmwire.comms.radio.config.radio import Radio, unfit_for_torus
from swarmwire.comms.radio.counters import LivenessHistory, PacketCounters
from swarmwire.comms.radio.disruption import ActiveDisruption, Disruption
from swarmwire.comms.radio.links import RECEIVED, Links, OpenLinks
from swarmwire.comms.radio.model import RadioModel
from swarmwire.comms.radio.phy.model import SinrPhy
from swarmwire.comms.radio.records import PacketCounts
from swarmwire.comms.radio.results import Results
from swarmwire.comms.radio.send_times import SendTimes
from swarmwire.comms.radio.stages.stage import ChannelContext
from swarmwire.comms.radio.traces import LinkTraces
from swarmwire.comms.radio.transmissions import Transmissions, first_without_receiver
from swarmwire.comms.radio.unit_disk.model import UnitDisk
from swarmwire.comms.robot.packets import NO_TX_STATUSES, Fate, ReceivedPackets, SentPackets, TxStatuses

MANY_LINKS = 4096  # kept, of which final ones leave the table also within a tick: each `advance` reads them


def wait_for_earlier(links: Links, first: int, rows: int) -> None:
    """Delay rows of `links` from `first` on so that each link delivers in the order of time on air; in place.

    Only receptions still to come matter, and all of these are among the links that the medium keeps, so there is no
    further state. A reception that an event ended delays nothing. `rows` is the number of robots of all arenas; rows
    before `first` have been delayed already, and do not change.
    """
    received = np.flatnonzero((links.fate == RECEIVED) & (links.receiver != NO_ROBOT))
    link = links.sender[received] * rows + links.receiver[received]
    # Sequence numbers of a sender rise in the order of time on air.
    order = received[np.lexsort((links.sequence[received], link))]
    _delay(links.sender, links.receiver, links.final_at_ns, order, first)


@njit()
def _delay(sender, receiver, final_at_ns, order, first):
    for i in range(1, len(order)):
        previous, now = order[i - 1], order[i]
        if now >= first and sender[now] == sender[previous] and receiver[now] == receiver[previous]:
            final_at_ns[now] = max(final_at_ns[now], final_at_ns[previous])


def _check(radio: Radio, traces: LinkTraces | None, boundary: Boundary) -> None:
    """ValueError for a radio without what its model needs, or that does not fit the boundary."""
    if not radio.is_phy and radio.range_m is None:
        raise ValueError("range_m: expected a range, as a unit disk has one")
    if (radio.trace is None) != (traces is None):
        raise ValueError("traces: expected the content of the radio's trace file, and None without one")
    if boundary == "torus" and (unfit := unfit_for_torus(radio)) is not None:
        raise ValueError(f"{unfit}: expected a unit disk without bodies_block on a torus")


class RadioMedium:
    """The emulated medium of every arena of a world; robot row r is robot r % robots of arena r // robots.

    `radio` holds the current parameters.

    A packet waits in its sender's queue, goes on air, and ends at each intended receiver in exactly one fate. Each tick
    is a `step` to its start, then a `send`. So a packet sent in a tick is received in the next tick at the earliest,
    under the poses of the tick in which it goes on air. `advance` and `send_at` divide a tick into sub-ticks.

    A fate is final when the reception ends: RECEIVED at `on_air_at + airtime + latency + jitter`, every other fate of a
    packet on air at `on_air_at + airtime`, a fate at the sender's radio at `sent_at`.

    Disruptions kill or revive robots, switch radios and set partitions at the start of a tick. Packets already on air
    stay on air, but dead robots receive nothing and their queues end. A radio that is off loses the packets that it is
    receiving; packets to send end or wait by its `backlog`. A revived robot receives only packets sent from then on.
    """

    def __init__(
        self,
        radio: Radio,
        keys: KeyArray,
        robots: int,
        size_m: tuple[float, float],
        obstacles: Obstacles,
        rate_hz: int,
        act_every_ticks: IntArray | None = None,
        radius_m: FloatArray | None = None,
        traces: LinkTraces | None = None,
        antennas: Antennas | None = None,
        boundary: Boundary = "walls",
        obstacles_move: bool = False,
        threads: int = 1,
        graph: bool = True,
    ) -> None:
        """`act_every_ticks` (robots,) is the period in which each robot index acts, in ticks; 1 each if left out.

        `radius_m` (robots,) are the robots' radii, for bodies between two robots; 0 each if left out. `traces` is the
        content of the radio's trace file, `antennas` the antennas of a radio with a PHY. With `obstacles_move` the
        arrays of `obstacles` may change in place. `threads` change nothing but the speed. Without `graph` the results
        have no edges, which takes less time. ValueError for a unit disk without `range_m`, a trace without its file or
        the other way round, or a radio that `unfit_for_torus` refuses on a torus.
        """
        _check(radio, traces, boundary)
        rows = len(keys) * robots
        self.radio, self._robots, self._graph = radio, robots, graph
        self._disruption = Disruption.none(rows)  # of the last `step`
        self._active = ActiveDisruption.none(rows)  # shared with the model; robots of arenas that left are alive
        radii_m = np.zeros(rows) if radius_m is None else np.tile(radius_m, len(keys))
        robot_antennas = antennas or Antennas.alike(robots)
        self._active.become(self._disruption, self._disruption.alive)
        self._running: BoolArray = np.ones(len(keys), np.bool_)
        obstacle_indices = ObstacleIndices(obstacles, size_m, 0.0, obstacles_move=obstacles_move)
        self._threads = Threads(threads)
        arena_facts = keys, robots, obstacle_indices, size_m, radii_m
        state = self._active, robot_antennas, self._running
        context = ChannelContext(radio, *arena_facts, *state, traces, boundary == "torus", self._threads)
        period_ticks = np.ones(robots, np.int64) if act_every_ticks is None else act_every_ticks
        self._send_times = SendTimes(radio.send_offset, keys, period_ticks, rate_hz)
        self._model: RadioModel = SinrPhy(context) if radio.is_phy else UnitDisk(context)
        self._counters = PacketCounters(len(keys), robots)
        self._liveness = LivenessHistory(rows)
        self._left: BoolArray = np.zeros(rows, np.bool_)  # robots of arenas that have left the run
        self._any_left = False
        self._present: BoolArray = np.ones(rows, np.bool_)  # alive, in arenas that have not
        self._is_new = True  # the disruption, or an arena has left, since poses were held last
        self._anyone_out = False  # in either disruption
        self._others_alive = np.zeros(rows, np.int64)
        self._now_ns = 0
        self._parts: list[Results] = []  # results within the current tick
        self._tx_status: list[TxStatuses] = []  # those of the current tick that `advance` returned
        self._handed_ns = 0  # receptions up to then were returned by `advance`
        self._next_ns = NEVER_NS  # no reception of `_open` is returned by `advance` before it
        self._nothing = ReceivedPackets.none(radio.measures.columns)
        self._no_links = Links.none(len(radio.measures.columns))
        self._open = OpenLinks(Transmissions.none(), self._no_links)

    def step(
        self, start_ns: int, pose: FloatArray, disruption: Disruption | None = None, radio: Radio | None = None
    ) -> Results:
        """Let time pass to the start of a tick; then `pose`, `disruption` and `radio` hold.

        Packets go on air before `start_ns` under the poses until then, and fates are final by it. Events at a sender's
        radio at `start_ns` itself belong to the new poses.

        Args:
            start_ns: the start of the tick; ValueError if it has passed.
            pose: x, y in m and heading in rad, (rows, 3); the array must not change afterwards.
            disruption: the state of robots and radios from now on; None: unchanged.
            radio: the parameters from now on, for packets that neither wait nor are on air. Only numbers may change.
                None: unchanged.

        Returns:
            All results since the last step, those of `advance` included, and the radio graph at `pose`.
        """
        self._model.expect(pose)
        self._pass_time(start_ns)
        if disruption is not None:
            self._disruption, self._is_new = disruption, True
            self._present = disruption.alive & ~self._left
        now = self._disruption
        if (self._is_new or self._anyone_out) and (now.anyone_out or self._active.anyone_out):
            self._keep_new(*self._model.disrupt(start_ns, now, self._liveness))
            self._cut_off(start_ns, now)
        tx_status, self._tx_status = TxStatuses.joined([*self._tx_status, self._model.tx_status(self._present)]), []
        self._liveness.forget(self._model.queued.epoch)
        pending = self._threads.start(partial(self._final, start_ns, self.radio), self._open.links)
        self._hold(pose, radio or self.radio)
        edges = self._model.edges(pose, self._present) if self._graph else results.NO_EDGES
        final = Results.joined([*self._parts, pending()])
        self._parts = []
        return Results(final.received, final.finished, final.departed, tx_status, final.tally, edges)

    def send(self, start_ns: int, tick: int, sent: SentPackets) -> None:
        """Queue the packets that agents sent in the tick that started at `start_ns`; call `step` to it before.

        The intended receivers of a broadcast are all other robots of the arena that are alive now, of a unicast packet
        its one receiver. A packet to NOWHERE has none: it goes on air, with all retries where radios acknowledge.
        Senders may be in any order. ValueError, and nothing changed, for a receiver outside the arena or the sender
        itself, or for a time that has passed.
        """
        self._check(start_ns, sent)
        if len(sent):
            self._accept(self._send_times.at(start_ns, tick)[sent.sender], sent)

    def send_times(self, start_ns: int, tick: int) -> IntArray:
        """Send time of each robot in the tick that starts at `start_ns`, in ns, (rows,)."""
        return self._send_times.at(start_ns, tick)

    def send_at(self, sent_at_ns: IntArray, sent: SentPackets) -> None:
        """Queue packets within a tick, as `send`; `sent_at_ns` (k,) holds one time for all packets of a robot."""
        if len(sent):
            self._check(int(sent_at_ns[0] if len(sent) == 1 else sent_at_ns.min()), sent)
            self._accept(sent_at_ns, sent)

    def advance(self, until_ns: int) -> tuple[ReceivedPackets, TxStatuses]:
        """Let time pass within a tick; the number of such calls changes nothing.

        Returns the packets received and the transmit statuses since the last call. The next `step` returns them again,
        with all else that became final.
        """
        self._pass_time(until_ns)
        tx_status = self._model.tx_status(self._present)
        if len(tx_status):
            self._tx_status.append(tx_status)
        since_ns, self._handed_ns = self._handed_ns, until_ns
        if until_ns < self._next_ns:
            return self._nothing, tx_status
        names = self.radio.measures.columns
        received, self._next_ns = results.received_between(since_ns, until_ns, self._open, names, self._robots)
        if self._open.links >= MANY_LINKS:
            self._take_final(until_ns)
        return received, tx_status

    def end(self) -> PacketCounts:
        """End the run: packets that are queued or under way end as IN_FLIGHT."""
        self._take_final(self._handed_ns)
        self._counters.count_in_flight(self._open.rows, self._without_left(self._model.drain()))
        self._keep(np.empty(0, np.int64))
        counts = reduce(add, [part.tally for part in self._parts], self._counters.close())
        self._parts = []
        return counts

    def leave(self, over: BoolArray) -> PacketCounts:
        """End the run in arenas `over` (arenas,); returns the counts that `end` would return for them.

        Packets left at their radios still run to their end, without results.
        """
        self._take_final(self._handed_ns)
        leaving, queued = np.repeat(over, self._robots), self._without_left(self._model.queued)
        links = self._open.rows
        is_leaving = leaving[links.sender]
        self._counters.count_in_flight(
            links.select(np.flatnonzero(is_leaving)), queued.parted(leaving[queued.sender])[0]
        )
        self._keep(np.flatnonzero(~is_leaving))
        counts = self._counters.close(over)
        if self._parts:
            final = Results.joined(self._parts)
            counts, self._parts = counts + final.tally.in_arenas(over), [final.of(~over, self._robots)]
        self._tx_status = [part.select(np.flatnonzero(~leaving[part.row])) for part in self._tx_status]
        self._left |= leaving
        self._any_left = True
        self._running &= ~over
        self._present, self._is_new = self._present & ~leaving, True
        return counts

    def _hold(self, pose: FloatArray, radio: Radio) -> None:
        """Hold these poses and parameters, and the disruption, from now on."""
        if self._is_new:
            self._disrupt()
        if radio is not self.radio:
            self.radio = radio
            self._model.tune(self._now_ns, radio)
        self._model.hold(pose)

    def _disrupt(self) -> None:
        """The last disruption, in the arenas that have not left, is the active one from now on."""
        alive = self._disruption.alive | self._left  # no packets are for those that left, so they may count as alive
        self._liveness.now(alive)
        self._active.become(self._disruption, alive)
        in_arena = alive.reshape(-1, self._robots).sum(axis=1)
        self._others_alive = np.repeat(in_arena, self._robots) - alive
        self._anyone_out, self._is_new = self._disruption.anyone_out, False

    def _accept(self, sent_at_ns: IntArray, sent: SentPackets) -> None:
        packets = self._model.accept(sent_at_ns, sent, self._others_alive, self._liveness.epoch)
        self._counters.count_sent(packets)

    def _pass_time(self, until_ns: int) -> None:
        if until_ns < self._now_ns:
            raise ValueError(f"until_ns: expected at least {self._now_ns}, got {until_ns}")
        self._now_ns = until_ns
        self._keep_new(*self._model.pass_time(until_ns, self._liveness))

    def _take_final(self, until_ns: int) -> None:
        """Take the results of links that are final by `until_ns` before the next step does."""
        if (self._open.rows.final_at_ns <= until_ns).any():
            self._parts.append(self._final(until_ns, self.radio))

    def _final(self, until_ns: int, radio: Radio) -> Results:
        """The results of links that are final by `until_ns`, without transmit statuses; the others are kept.

        It may be called in another thread while poses are held.
        """
        received, finished, departed, still_open = results.final_by(
            until_ns, self._open, radio, self._robots, self._counters.final
        )
        if len(still_open) < self._open.links:
            self._keep(still_open)
        return Results(received, finished, departed, NO_TX_STATUSES, self._counters.close())

    def _check(self, at_ns: int, sent: SentPackets) -> None:
        if at_ns < self._now_ns:
            raise ValueError(f"at_ns: expected at least {self._now_ns}, got {at_ns}")
        if (invalid := first_without_receiver(sent, self._robots)) != NO_PACKET:
            raise ValueError(f"to: expected another robot of the arena's {self._robots}, got {sent.to[invalid]}")

    def _cut_off(self, now_ns: int, now: Disruption) -> None:
        """End receptions of robots that are dead `now`, and unfinished ones at radios that are off."""
        links = self._open.rows
        is_open = (links.fate == RECEIVED) & (links.receiver != NO_ROBOT) & (links.final_at_ns > self._handed_ns)
        links.fate[is_open & ~now.radio_on[links.receiver] & (links.final_at_ns > now_ns)] = Fate.BLACKOUT
        links.fate[is_open & ~now.alive[links.receiver]] = Fate.RECEIVER_DEAD

    def _without_left(self, packets: Transmissions) -> Transmissions:
        """The packets that were not sent in an arena that has left the run."""
        return packets.parted(self._left[packets.sender])[1]

    def _keep_new(self, packets: Transmissions, links: Links) -> None:
        """Keep links until they are final, and their packets; none of arenas that have left."""
        if len(packets):
            links.check_fates()
            first_new, self._next_ns = self._open.links, 0
            self._open.add(packets, links)
            if self.radio.delays is not None and self.radio.delays.keep_order:
                wait_for_earlier(self._open.rows, first_new, len(self._others_alive))
            if self._any_left and self._left[packets.sender].any():
                self._keep(np.flatnonzero(~self._left[self._open.rows.sender]))

    def _keep(self, index: IntArray) -> None:
        """Keep only the links of `index` and their packets."""
        if len(index):
            self._open.keep(index)
        else:
            self._open = OpenLinks(Transmissions.none(), self._no_links)
