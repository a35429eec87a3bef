"""Kept order: packets of a link are received in the order in which they went on air, whatever their delays.

What counts of the past are receptions that are still to come: they are all among the links that the medium keeps, so
that there is no state beside these. A reception that an event has ended holds up nothing.
"""

# pyright: basic, reportUnknownMemberType=false

import numpy as np
from numba import njit

from swarmwire.comms.arrays import BoolArray, FloatArray, IntArray, KeyArray
from swarmwire.comms.geometry.obstacles import Obstacles
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


def wait_for_earlier(links: Links, first: int, rows: int) -> None:
    """Rows of `links` from `first` on become final no sooner than their link's earlier ones; in place.

    `rows` are the robots of all arenas. Those before `first` have waited already, and are not changed.
    """
    received = np.flatnonzero((links.fate == RECEIVED) & (links.receiver != THE_REST))
    link = links.sender[received] * rows + links.receiver[received]
    # A sender's packets have their numbers in the order in which they go on air.
    order = received[np.lexsort((links.sequence[received], link))]
    _wait(links.sender, links.receiver, links.final_at_ns, order, first)


@njit(cache=True)
def _wait(sender, receiver, final_at_ns, order, first):
    for i in range(1, len(order)):
        before, now = order[i - 1], order[i]
        if now >= first and sender[now] == sender[before] and receiver[now] == receiver[before]:
            final_at_ns[now] = max(final_at_ns[now], final_at_ns[before])


# --- The medium as a state machine: packets and poses go in, time passes, and what was received comes out. No I/O, no
# clock.


PARTS = 8  # of what is told within a tick that are kept before they are put together


class RadioMedium:
    """The emulated medium of every arena of a world; robot row r is robot r % robots of arena r // robots.

    `radio` is what it goes by at the moment.

    A packet waits in its sender's queue, goes on air, and ends at each intended receiver in one fate. Tick k starts
    with `advance(its start)`; then come `hold` with the poses of tick k and `send`. So a packet sent in a tick is
    received in the next at the earliest, and geometry is that of the tick in which the packet goes on air.

    A fate is final when the reception ends: RECEIVED at `on_air_at + airtime + latency + jitter`, every other fate of a
    packet on air at `on_air_at + airtime`, a fate at the sender's radio at `sent_at`.

    Events change who is alive and what is off or apart at the start of a tick (`disrupt`, before `advance`). What went
    on air before stays on air, but the dead hear nothing any more and their queues end; a radio that is off loses what
    it was receiving, and what it should send ends or waits as its `backlog` says. A robot revived hears only what is
    sent from then on.
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

        `radius_m` (robots,) are their radii, which count for bodies between two robots; 0 each if left out. `traces`
        are what the file of the radio's trace holds, `antennas` those of a radio with a PHY. ValueError for a unit disk
        without `range_m`, a trace without its file or the other way round, or what `unfit_for_torus` names on a torus.
        """
        if not radio.is_phy and radio.range_m is None:
            raise ValueError("range_m: expected a range, as a unit disk has one")
        if (radio.trace is None) != (traces is None):
            raise ValueError("traces: expected what the file of the radio's trace holds, and nothing without one")
        if boundary == "torus" and (unfit := unfit_for_torus(radio)) is not None:
            raise ValueError(f"{unfit}: expected a unit disk without bodies_block on a torus")
        rows = len(keys) * robots
        self.radio = self._coming_radio = radio
        self._robots = robots
        self._held, self._coming = Disruption.none(rows), Disruption.none(rows)
        radii_m = np.zeros(rows) if radius_m is None else np.tile(radius_m, len(keys))
        own = antennas or Antennas.alike(robots)
        self._running: BoolArray = np.ones(len(keys), np.bool_)
        fixed = keys, robots, obstacles, size_m, radii_m
        context = ChannelContext(radio, *fixed, self._held, own, self._running, traces, boundary == "torus")
        every = np.ones(robots, np.int64) if act_every_ticks is None else act_every_ticks
        self._send_times = SendTimes(radio.send_offset, keys, every, rate_hz)
        self._way: RadioModel = SinrPhy(context) if radio.is_phy else UnitDisk(context)
        self._accounts = PacketCounters(len(keys), robots)
        self._lives = LivenessHistory(rows)
        self._gone: BoolArray = np.zeros(rows, np.bool_)  # robots of arenas that left
        self._others_alive = np.zeros(rows, np.int64)
        self._now_ns = 0
        self._within: list[results.FinalFates] = []  # told in the tick under way
        self._on_air = Transmissions.none()  # packets of `_links`
        self._links = self._no_links = Links.none(len(radio.measures.columns))
        nothing = (
            ReceivedPackets.none(radio.measures.columns),
            *results.nothing_final(self._links, self._on_air, radio.is_phy),
        )
        self._nothing = results.FinalFates(*nothing, NO_TX_STATUSES)

    def hold(self, pose: FloatArray, alive: BoolArray) -> None:
        """Robots stand at `pose` (rows, 3) (x, y in m, heading in rad) from now on; those alive (rows,) receive.

        Nobody may write to `pose` after.
        """
        alive = alive | self._gone  # nobody sends to them: they need not be kept from hearing
        self._lives.now(alive)
        self._held.become(self._coming)
        self._held.alive = alive
        if self._coming_radio is not self.radio:
            self.radio = self._coming_radio
            self._way.tune(self._now_ns, self.radio)
        self._way.hold(pose)
        in_arena = alive.reshape(-1, self._robots).sum(axis=1)
        self._others_alive = np.repeat(in_arena, self._robots) - alive

    def disrupt(self, coming: Disruption) -> None:
        """This holds from the end of the next `advance` on, until told otherwise."""
        self._coming = coming

    def tune(self, radio: Radio) -> None:
        """The radio has these numbers from the end of the next `advance` on; all but numbers is as it was.

        What waits or is on air stays so.
        """
        self._coming_radio = radio

    def send(self, at_ns: int, tick: int, sent: SentPackets) -> None:
        """Queue the packets that agents sent in the tick that started at `at_ns`; `hold` has told the tick's poses.

        A broadcast intends every other robot of the arena that is alive now; an addressed packet its one receiver, and
        one to NOWHERE nobody: it takes a sequence number, and its sender learns that it was not acknowledged.
        Senders may stand in any order. ValueError, and nothing changed, for a receiver outside the arena or the sender
        itself, or for a time that has passed.
        """
        self._refuse(at_ns, sent)
        if len(sent):
            self._accept(self._send_times.at(at_ns, tick), sent)

    def turns(self, start_ns: int, tick: int) -> IntArray:
        """When each robot hands over what it sends in a tick that starts at `start_ns`, in ns, (rows,)."""
        return self._send_times.at(start_ns, tick)

    def send_at(self, sent_at_ns: IntArray, sent: SentPackets) -> None:
        """Queue packets within a tick; `sent_at_ns` (rows,) is when each robot hands its own over.

        The rest is as for `send`.
        """
        if len(sent):
            self._refuse(int(sent_at_ns[sent.sender].min()), sent)
            self._accept(sent_at_ns, sent)

    def advance(self, until_ns: int) -> results.Results:
        """Let time pass to `until_ns`, with the poses held: what goes on air before it, what is final by it.

        What happens at a sender's radio at `until_ns` itself belongs to the poses held next, and so to the next call.
        """
        self._pass(until_ns)
        if self._coming.anyone_out or self._held.anyone_out:
            self._take(*self._way.disrupt(until_ns, self._coming, self._lives))
            self._cut_off(until_ns)
        told = results.joined([*self._within, self._final(until_ns)])
        self._within = []
        return results.Results(told.received, told.finished, told.departed, self._accounts.close(), told.tx_status)

    def advance_within(self, until_ns: int) -> tuple[ReceivedPackets, TxStatuses]:
        """The same in the middle of a tick, where no event begins: in how many parts time passes changes nothing.

        What became final is told again with all of the tick by the next `advance`.
        """
        self._pass(until_ns)
        told = self._final(until_ns)
        if told.anything:
            self._within.append(told)
            if len(self._within) == PARTS:  # now, and not in the one moment in which the next tick waits for them
                self._within = [results.joined(self._within)]
        return told.received, told.tx_status

    def end(self) -> PacketCounts:
        """The run is over: what is queued or on its way ends as IN_FLIGHT."""
        self._accounts.strand(self._links, self._of_here(self._way.drain()))
        self._keep(np.empty(0, np.int64))
        return self._accounts.close()

    def leave(self, over: BoolArray) -> PacketCounts:
        """The run is over in these arenas (arenas,); what `end` would have counted there.

        What is left at their radios still comes to its end, but nobody is told.
        """
        going, queued = np.repeat(over, self._robots), self._of_here(self._way.queued)
        lost = going[self._links.sender]
        self._accounts.strand(self._links.select(np.flatnonzero(lost)), queued.parted(going[queued.sender])[0])
        self._keep(np.flatnonzero(~lost))
        self._within = [results.joined(self._within).of(~over, self._robots)] if self._within else []
        self._gone |= going
        self._running &= ~over
        return self._accounts.close(over)

    def edges(self, pose: FloatArray, alive: BoolArray) -> IntArray:
        """The radio graph over robots that stand at `pose`: pairs of robot rows a < b, sorted, (e, 2).

        Two robots alive are joined where a lone packet gets through with at least `min_delivery`.
        """
        return self._way.edges(pose, alive)

    def _accept(self, sent_at_ns: IntArray, sent: SentPackets) -> None:
        packets = self._way.accept(sent_at_ns, sent, self._others_alive, self._lives.epoch)
        self._accounts.take_up(packets)

    def _pass(self, until_ns: int) -> None:
        if until_ns < self._now_ns:
            raise ValueError(f"until_ns: expected at least {self._now_ns}, got {until_ns}")
        self._now_ns = until_ns
        self._take(*self._way.pass_time(until_ns, self._lives))

    def _final(self, until_ns: int) -> results.FinalFates:
        """What is final by `until_ns`; links that are not are kept."""
        self._lives.forget(self._way.queued.epoch)
        links, packets, robots = self._links, self._on_air, self._robots
        rows = results.parted(links.fate, links.receiver, links.final_at_ns, until_ns)
        if len(rows.open) == len(links.fate):
            return self._nothing._replace(tx_status=self._way.tx_status(self._coming.alive & ~self._gone))
        self._accounts.settle(links, until_ns)
        told = results.FinalFates(
            results.received(
                rows.received, links, packets, self.radio.measures.columns, robots, len(self._others_alive)
            ),
            results.finished(rows.finished, links, packets, robots, self.radio.is_phy),
            results.departed(rows.departed, links, packets, robots),
            self._way.tx_status(self._coming.alive & ~self._gone),
        )
        self._keep(rows.open)
        return told

    def _refuse(self, at_ns: int, sent: SentPackets) -> None:
        if at_ns < self._now_ns:
            raise ValueError(f"at_ns: expected at least {self._now_ns}, got {at_ns}")
        addressed = (sent.to != BROADCAST) & (sent.to != NOWHERE)
        wrong = addressed & ((sent.to < 0) | (sent.to >= self._robots) | (sent.to == sent.sender % self._robots))
        if wrong.any():
            raise ValueError(f"to: expected another robot of the arena's {self._robots}, got {sent.to[wrong][0]}")

    def _cut_off(self, now_ns: int) -> None:
        """End receptions of robots that are dead now, and those still going on at radios that are off now."""
        links, now = self._links, self._coming
        open_ = (links.fate == RECEIVED) & (links.receiver != THE_REST)
        links.fate[open_ & ~now.radio_on[links.receiver] & (links.final_at_ns > now_ns)] = Fate.BLACKOUT
        links.fate[open_ & ~now.alive[links.receiver]] = Fate.RECEIVER_DEAD

    def _of_here(self, packets: Transmissions) -> Transmissions:
        """Those of the packets that were not sent in an arena that left."""
        return packets.parted(self._gone[packets.sender])[1]

    def _take(self, packets: Transmissions, links: Links) -> None:
        """Keep links until they are final, and their packets; of arenas that left, none."""
        if packets:
            coming, rows = len(self._links.packet), len(self._others_alive)
            self._links = self._links.followed_by(links._replace(packet=links.packet + len(self._on_air.sender)))
            self._on_air = self._on_air.followed_by(packets)
            if self.radio.delays is not None and self.radio.delays.keep_order:
                wait_for_earlier(self._links, coming, rows)
            if self._gone[packets.sender].any():
                self._keep(np.flatnonzero(~self._gone[self._links.sender]))

    def _keep(self, index: IntArray) -> None:
        """Keep these links and their packets only."""
        if not len(index):
            self._links, self._on_air = self._no_links, Transmissions.none()
            return
        kept, packet = results.compacted(self._links.packet[index], len(self._on_air.sender))
        self._links = self._links.select(index)._replace(packet=packet)
        self._on_air = self._on_air.select(kept)
