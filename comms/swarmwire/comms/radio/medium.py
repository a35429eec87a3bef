"""The radio medium as a state machine: packets and poses go in, time passes, and received packets come out.

It does no I/O and reads no clock. `RadioMedium` drives a radio model (unit disk or PHY), keeps links until their fate
is final, and counts the fates.
"""

# pyright: basic, reportUnknownMemberType=false

import numpy as np

from swarmwire.comms.arrays import BoolArray, FloatArray, IntArray, KeyArray
from swarmwire.comms.geometry.obstacles import Obstacles
from swarmwire.comms.kernels import njit
from swarmwire.comms.packets import BROADCAST, NO_TX_STATUSES, NOWHERE, Fate, ReceivedPackets, SentPackets, TxStatuses
from swarmwire.comms.radio import results
from swarmwire.comms.radio.config.phy import Antennas
from swarmwire.comms.radio.config.radio import Radio, unfit_for_torus
from swarmwire.comms.radio.counters import LivenessHistory, PacketCounters
from swarmwire.comms.radio.disruption import Disruption
from swarmwire.comms.radio.links import RECEIVED, THE_REST, Links
from swarmwire.comms.radio.model import RadioModel
from swarmwire.comms.radio.phy.model import SinrPhy
from swarmwire.comms.radio.send_times import SendTimes
from swarmwire.comms.radio.stages.stage import ChannelContext
from swarmwire.comms.radio.traces import LinkTraces
from swarmwire.comms.radio.transmissions import Transmissions
from swarmwire.comms.radio.unit_disk.model import UnitDisk
from swarmwire.comms.truth import Boundary, PacketCounts

MAX_PARTS = 8  # parts of a tick's results that are kept before they are joined


def wait_for_earlier(links: Links, first: int, rows: int) -> None:
    """Delay rows of `links` from `first` on so that each link delivers in the order of time on air; in place.

    Only receptions still to come matter, and all of these are among the links that the medium keeps, so there is no
    further state. A reception that an event ended delays nothing. `rows` is the number of robots of all arenas; rows
    before `first` have been delayed already, and do not change.
    """
    received = np.flatnonzero((links.fate == RECEIVED) & (links.receiver != THE_REST))
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


class RadioMedium:
    """The emulated medium of every arena of a world; robot row r is robot r % robots of arena r // robots.

    `radio` holds the current parameters.

    A packet waits in its sender's queue, goes on air, and ends at each intended receiver in exactly one fate. Tick k
    starts with `advance(its start)`; then come `hold` with the poses of tick k and `send`. So a packet sent in a tick
    is received in the next tick at the earliest, under the poses of the tick in which it goes on air.

    A fate is final when the reception ends: RECEIVED at `on_air_at + airtime + latency + jitter`, every other fate of a
    packet on air at `on_air_at + airtime`, a fate at the sender's radio at `sent_at`.

    Events kill or revive robots, switch radios and set partitions at the start of a tick (`disrupt`, before `advance`).
    Packets already on air stay on air, but dead robots receive nothing and their queues end. A radio that is off loses
    the packets that it is receiving; packets to send end or wait by its `backlog`. A revived robot receives only
    packets sent from then on.
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
    ) -> None:
        """`act_every_ticks` (robots,) is the period in which each robot index acts, in ticks; 1 each if left out.

        `radius_m` (robots,) are the robots' radii, for bodies between two robots; 0 each if left out. `traces` is the
        content of the radio's trace file, `antennas` the antennas of a radio with a PHY. ValueError for a unit disk
        without `range_m`, a trace without its file or the other way round, or a radio that `unfit_for_torus` refuses on
        a torus.
        """
        if not radio.is_phy and radio.range_m is None:
            raise ValueError("range_m: expected a range, as a unit disk has one")
        if (radio.trace is None) != (traces is None):
            raise ValueError("traces: expected what the file of the radio's trace holds, and nothing without one")
        if boundary == "torus" and (unfit := unfit_for_torus(radio)) is not None:
            raise ValueError(f"{unfit}: expected a unit disk without bodies_block on a torus")
        rows = len(keys) * robots
        self.radio = self._next_radio = radio
        self._robots = robots
        self._active, self._next_disruption = Disruption.none(rows), Disruption.none(rows)
        radii_m = np.zeros(rows) if radius_m is None else np.tile(radius_m, len(keys))
        robot_antennas = antennas or Antennas.alike(robots)
        self._running: BoolArray = np.ones(len(keys), np.bool_)
        arena_facts = keys, robots, obstacles, size_m, radii_m
        context = ChannelContext(
            radio, *arena_facts, self._active, robot_antennas, self._running, traces, boundary == "torus"
        )
        period_ticks = np.ones(robots, np.int64) if act_every_ticks is None else act_every_ticks
        self._send_times = SendTimes(radio.send_offset, keys, period_ticks, rate_hz)
        self._model: RadioModel = SinrPhy(context) if radio.is_phy else UnitDisk(context)
        self._counters = PacketCounters(len(keys), robots)
        self._liveness = LivenessHistory(rows)
        self._left: BoolArray = np.zeros(rows, np.bool_)  # robots of arenas that have left the run
        self._others_alive = np.zeros(rows, np.int64)
        self._now_ns = 0
        self._parts: list[results.FinalFates] = []  # results within the current tick
        self._on_air = Transmissions.none()  # the packets of `_links`
        self._links = self._no_links = Links.none(len(radio.measures.columns))
        none = (
            ReceivedPackets.none(radio.measures.columns),
            *results.nothing_final(self._links, self._on_air, radio.is_phy),
        )
        self._nothing = results.FinalFates(*none, NO_TX_STATUSES)

    def hold(self, pose: FloatArray, alive: BoolArray) -> None:
        """Robots are at `pose` (rows, 3) (x, y in m, heading in rad) from now on; those `alive` (rows,) receive.

        `pose` must not change afterwards.
        """
        alive = alive | self._left  # no packets are for them, so they may count as alive
        self._liveness.now(alive)
        self._active.become(self._next_disruption)
        self._active.alive = alive
        if self._next_radio is not self.radio:
            self.radio = self._next_radio
            self._model.tune(self._now_ns, self.radio)
        self._model.hold(pose)
        in_arena = alive.reshape(-1, self._robots).sum(axis=1)
        self._others_alive = np.repeat(in_arena, self._robots) - alive

    def disrupt(self, first_new: Disruption) -> None:
        """Apply this disruption from the end of the next `advance` on, until the next call."""
        self._next_disruption = first_new

    def tune(self, radio: Radio) -> None:
        """Use the numbers of `radio` from the end of the next `advance` on; everything else must be unchanged.

        Packets that wait or are on air are not affected.
        """
        self._next_radio = radio

    def send(self, at_ns: int, tick: int, sent: SentPackets) -> None:
        """Queue the packets that agents sent in the tick that started at `at_ns`; call `hold` with its poses before.

        The intended receivers of a broadcast are all other robots of the arena that are alive now, of a unicast packet
        its one receiver. A packet to NOWHERE has none: it takes a sequence number, and its transmit status is "not
        acknowledged". Senders may be in any order. ValueError, and nothing changed, for a receiver outside the arena or
        the sender itself, or for a time that has passed.
        """
        self._check(at_ns, sent)
        if len(sent):
            self._accept(self._send_times.at(at_ns, tick), sent)

    def turns(self, start_ns: int, tick: int) -> IntArray:
        """Send time of each robot in the tick that starts at `start_ns`, in ns, (rows,)."""
        return self._send_times.at(start_ns, tick)

    def send_at(self, sent_at_ns: IntArray, sent: SentPackets) -> None:
        """Queue packets within a tick, as `send`; `sent_at_ns` (rows,) is the send time of each robot."""
        if len(sent):
            self._check(int(sent_at_ns[sent.sender].min()), sent)
            self._accept(sent_at_ns, sent)

    def advance(self, until_ns: int) -> results.Results:
        """Let time pass to `until_ns` under the current poses: packets go on air before it, fates are final by it.

        Events at a sender's radio at `until_ns` itself belong to the next poses, and so to the next call.
        """
        self._pass_time(until_ns)
        if self._next_disruption.anyone_out or self._active.anyone_out:
            self._keep_new(*self._model.disrupt(until_ns, self._next_disruption, self._liveness))
            self._cut_off(until_ns)
        final = results.joined([*self._parts, self._final(until_ns)])
        self._parts = []
        return results.Results(final.received, final.finished, final.departed, self._counters.close(), final.tx_status)

    def advance_within(self, until_ns: int) -> tuple[ReceivedPackets, TxStatuses]:
        """Let time pass within a tick, where no disruption begins; the number of such calls changes nothing.

        The next `advance` returns these results again, with those of the whole tick.
        """
        self._pass_time(until_ns)
        final = self._final(until_ns)
        if final.anything:
            self._parts.append(final)
            if len(self._parts) == MAX_PARTS:  # joined early, since the next tick waits for the last part
                self._parts = [results.joined(self._parts)]
        return final.received, final.tx_status

    def end(self) -> PacketCounts:
        """End the run: packets that are queued or under way end as IN_FLIGHT."""
        self._counters.strand(self._links, self._without_left(self._model.drain()))
        self._keep(np.empty(0, np.int64))
        return self._counters.close()

    def leave(self, over: BoolArray) -> PacketCounts:
        """End the run in arenas `over` (arenas,); returns the counts that `end` would return for them.

        Packets left at their radios still run to their end, without results.
        """
        leaving, queued = np.repeat(over, self._robots), self._without_left(self._model.queued)
        is_leaving = leaving[self._links.sender]
        self._counters.strand(self._links.select(np.flatnonzero(is_leaving)), queued.parted(leaving[queued.sender])[0])
        self._keep(np.flatnonzero(~is_leaving))
        self._parts = [results.joined(self._parts).of(~over, self._robots)] if self._parts else []
        self._left |= leaving
        self._running &= ~over
        return self._counters.close(over)

    def edges(self, pose: FloatArray, alive: BoolArray) -> IntArray:
        """Edges of the radio graph over robots at `pose`: pairs of robot rows a < b, sorted, (e, 2).

        Two robots that are alive are joined where a lone packet is delivered with at least `min_delivery`.
        """
        return self._model.edges(pose, alive)

    def _accept(self, sent_at_ns: IntArray, sent: SentPackets) -> None:
        packets = self._model.accept(sent_at_ns, sent, self._others_alive, self._liveness.epoch)
        self._counters.take_up(packets)

    def _pass_time(self, until_ns: int) -> None:
        if until_ns < self._now_ns:
            raise ValueError(f"until_ns: expected at least {self._now_ns}, got {until_ns}")
        self._now_ns = until_ns
        self._keep_new(*self._model.pass_time(until_ns, self._liveness))

    def _final(self, until_ns: int) -> results.FinalFates:
        """Results of links that are final by `until_ns`; the others are kept."""
        self._liveness.forget(self._model.queued.epoch)
        links, packets, robots = self._links, self._on_air, self._robots
        rows = results.parted(links.fate, links.receiver, links.final_at_ns, until_ns)
        if len(rows.open) == len(links.fate):
            return self._nothing._replace(tx_status=self._model.tx_status(self._next_disruption.alive & ~self._left))
        self._counters.settle(links, until_ns)
        final = results.FinalFates(
            results.received(
                rows.received, links, packets, self.radio.measures.columns, robots, len(self._others_alive)
            ),
            results.finished(rows.finished, links, packets, robots, self.radio.is_phy),
            results.departed(rows.departed, links, packets, robots),
            self._model.tx_status(self._next_disruption.alive & ~self._left),
        )
        self._keep(rows.open)
        return final

    def _check(self, at_ns: int, sent: SentPackets) -> None:
        if at_ns < self._now_ns:
            raise ValueError(f"at_ns: expected at least {self._now_ns}, got {at_ns}")
        addressed = (sent.to != BROADCAST) & (sent.to != NOWHERE)
        is_invalid = addressed & ((sent.to < 0) | (sent.to >= self._robots) | (sent.to == sent.sender % self._robots))
        if is_invalid.any():
            raise ValueError(f"to: expected another robot of the arena's {self._robots}, got {sent.to[is_invalid][0]}")

    def _cut_off(self, now_ns: int) -> None:
        """End receptions of robots that are dead now, and unfinished ones at radios that are off now."""
        links, now = self._links, self._next_disruption
        is_open = (links.fate == RECEIVED) & (links.receiver != THE_REST)
        links.fate[is_open & ~now.radio_on[links.receiver] & (links.final_at_ns > now_ns)] = Fate.BLACKOUT
        links.fate[is_open & ~now.alive[links.receiver]] = Fate.RECEIVER_DEAD

    def _without_left(self, packets: Transmissions) -> Transmissions:
        """The packets that were not sent in an arena that has left the run."""
        return packets.parted(self._left[packets.sender])[1]

    def _keep_new(self, packets: Transmissions, links: Links) -> None:
        """Keep links until they are final, and their packets; none of arenas that have left."""
        if packets:
            first_new, rows = len(self._links.packet), len(self._others_alive)
            self._links = self._links.followed_by(links._replace(packet=links.packet + len(self._on_air.sender)))
            self._on_air = self._on_air.followed_by(packets)
            if self.radio.delays is not None and self.radio.delays.keep_order:
                wait_for_earlier(self._links, first_new, rows)
            if self._left[packets.sender].any():
                self._keep(np.flatnonzero(~self._left[self._links.sender]))

    def _keep(self, index: IntArray) -> None:
        """Keep only the links of `index` and their packets."""
        if not len(index):
            self._links, self._on_air = self._no_links, Transmissions.none()
            return
        kept, packet = results.compacted(self._links.packet[index], len(self._on_air.sender))
        self._links = self._links.select(index)._replace(packet=packet)
        self._on_air = self._on_air.select(kept)
