"""Transmit queues of the unit disk: time on air of each packet, refusals, and the outage queue policy.

Each sender has a queue, first in, first out. While a radio is off its packets end, or wait by its backlog policy.
"""

# pyright: basic, reportUnknownMemberType=false

import numpy as np

from swarmwire.comms.base.arrays import BoolArray, IntArray
from swarmwire.comms.base.kernels import njit
from swarmwire.comms.base.sentinels import UNDER_WAY
from swarmwire.comms.radio.config.radio import Radio, airtime_ns
from swarmwire.comms.radio.disruption import DROP, NEWEST, Disruption
from swarmwire.comms.radio.transmissions import (
    FATE,
    OFF_AIR_AT,
    ON_AIR_AT,
    SENDER,
    SENT_AT,
    Admission,
    Transmissions,
    frame_sizes,
    size_row,
)
from swarmwire.comms.robot.packets import Fate, SentPackets

QUEUE_FULL, TOO_LARGE = int(Fate.QUEUE_FULL), int(Fate.TOO_LARGE)
FAR_NS = 2**62  # time on air of a packet held by a radio that is off; airtimes may be added to it
NO_PACKETS = Transmissions.none()
NO_LIMIT = 2**31  # where all but the newest packet end anyway; pragma: no mutate


@njit()
def enter(
    free_at_ns: IntArray,
    queued: IntArray,
    packets: IntArray,
    offset: IntArray,
    headers_bytes: int,
    airtime_ns: IntArray,
    queue_limit: IntArray,
) -> None:
    """First in, first out: `on_air_at = max(sent_at, end of the sender's previous packet)`, all times in ns.

    A packet that must wait is refused while `queue_limit` others of its sender wait (go on air after `sent_at`).
    `queue_limit` and `free_at_ns` (end of the last airtime) are by robot row; `queued` is the table of packets that may
    still wait. `offset` is that of the new packets' payloads, `airtime_ns` by `size_row`.

    Writes fate and times on and off air into the table `packets`, whose packets are new, have all times at `sent_at`,
    and those of one sender the same; updates `free_at_ns`.
    """
    waiting, sent_at_ns = np.zeros(len(free_at_ns), np.int64), np.zeros(len(free_at_ns), np.int64)
    for p in range(packets.shape[1]):
        sent_at_ns[packets[SENDER, p]] = packets[SENT_AT, p]
    queued_sender, queued_on_air_at_ns = queued[SENDER], queued[ON_AIR_AT]
    for p in range(len(queued_sender)):
        if queued_on_air_at_ns[p] > sent_at_ns[queued_sender[p]]:
            waiting[queued_sender[p]] += 1
    for p in range(packets.shape[1]):
        s, size = packets[SENDER, p], size_row(packets, offset, p, headers_bytes)
        must_wait = free_at_ns[s] > sent_at_ns[s]
        if size >= len(airtime_ns):
            packets[FATE, p] = TOO_LARGE
        elif must_wait and waiting[s] >= queue_limit[s]:
            packets[FATE, p] = QUEUE_FULL
        else:
            packets[ON_AIR_AT, p] = max(sent_at_ns[s], free_at_ns[s])
            free_at_ns[s] = packets[OFF_AIR_AT, p] = packets[ON_AIR_AT, p] + airtime_ns[size]
            waiting[s] += must_wait


def hold_queue(queued: Transmissions, which: BoolArray, free_at_ns: IntArray) -> tuple[Transmissions, IntArray]:
    """Hold the packets of radios `which` (rows,) until they are on; returns the queue and the end of the last airtime.

    `free_at_ns` (rows,) is the end of the last airtime of all queued packets.
    """
    held = _hold(queued.sender, queued.fate, queued.on_air_at_ns, queued.off_air_at_ns, which, free_at_ns)
    on_air_at_ns, off_air_at_ns, free_at_ns = held
    return queued.replaced(on_air_at_ns=on_air_at_ns, off_air_at_ns=off_air_at_ns), free_at_ns


def release_queue(
    queued: Transmissions, which: BoolArray, free_at_ns: IntArray, at_ns: int
) -> tuple[Transmissions, IntArray]:
    """Release the packets held by radios `which` (rows,): they go on air from `at_ns` on, one after the other.

    `free_at_ns` (rows,) is the end of their last airtime; returned with its new values.
    """
    released = _release(
        queued.sender, queued.sent_at_ns, queued.on_air_at_ns, queued.off_air_at_ns, which, free_at_ns, at_ns
    )
    on_air_at_ns, off_air_at_ns, free_at_ns = released
    return queued.replaced(on_air_at_ns=on_air_at_ns, off_air_at_ns=off_air_at_ns), free_at_ns


def newest_only(queued: Transmissions, which: BoolArray, at_ns: IntArray) -> Transmissions:
    """Keep only the newest packet held by each radio of `which` (rows,).

    Older ones end as BLACKOUT at `at_ns` (rows,), by sender, since the radio that is off loses them.
    """
    if not which.any():
        return queued
    waiting = np.flatnonzero((queued.on_air_at_ns >= FAR_NS) & which[queued.sender])
    newest = np.zeros(len(which), np.int64)
    np.maximum.at(newest, queued.sender[waiting], waiting)
    old = waiting[newest[queued.sender[waiting]] != waiting]
    if not len(old):
        return queued
    fate, on_air_at_ns, off_air_at_ns = queued.fate.copy(), queued.on_air_at_ns.copy(), queued.off_air_at_ns.copy()
    fate[old] = Fate.BLACKOUT
    on_air_at_ns[old] = off_air_at_ns[old] = at_ns[queued.sender[old]]
    return queued.replaced(fate=fate, on_air_at_ns=on_air_at_ns, off_air_at_ns=off_air_at_ns)


@njit()
def _hold(sender, fate, on_air_at_ns, off_air_at_ns, which, free_at_ns):
    on_air_at_ns, off_air_at_ns, free_at_ns = on_air_at_ns.copy(), off_air_at_ns.copy(), free_at_ns.copy()
    seen = np.zeros(len(which), np.bool_)
    for p in range(len(sender)):
        s = sender[p]
        if not which[s] or fate[p] != UNDER_WAY:
            continue
        if not seen[s]:  # the packet before the first one held ends when this one would have started
            seen[s] = True
            free_at_ns[s] = on_air_at_ns[p]
        off_air_at_ns[p] += FAR_NS - on_air_at_ns[p]
        on_air_at_ns[p] = FAR_NS
    return on_air_at_ns, off_air_at_ns, free_at_ns


@njit()
def _release(sender, sent_at_ns, on_air_at_ns, off_air_at_ns, which, free_at_ns, at_ns):
    on_air_at_ns, off_air_at_ns, free_at_ns = on_air_at_ns.copy(), off_air_at_ns.copy(), free_at_ns.copy()
    for p in range(len(sender)):
        s = sender[p]
        if not which[s] or on_air_at_ns[p] < FAR_NS:
            continue
        duration_ns = off_air_at_ns[p] - on_air_at_ns[p]
        on_air_at_ns[p] = max(at_ns, free_at_ns[s], sent_at_ns[p])
        off_air_at_ns[p] = on_air_at_ns[p] + duration_ns
        free_at_ns[s] = off_air_at_ns[p]
    return on_air_at_ns, off_air_at_ns, free_at_ns


class TxQueues:
    """The radio of each robot: a queue, first in, first out, and the count of its packets."""

    def __init__(self, radio: Radio, rows: int) -> None:
        self._admission = Admission(rows)
        self._free_at_ns = np.zeros(rows, np.int64)
        self._backlog, self._any_held = np.full(rows, DROP), False
        self._limit = np.full(rows, radio.queue_limit)
        self.queued = Transmissions.none()
        self.tune(radio)

    def tune(self, radio: Radio) -> None:
        """Use the parameters of `radio` for later packets."""
        self._limit[:] = radio.queue_limit
        self._headers_bytes, sizes = frame_sizes(radio)
        self._airtime_ns = airtime_ns(radio, sizes)

    def accept(self, sent_at_ns: IntArray, sent: SentPackets, others_alive: IntArray, epoch: int) -> Transmissions:
        """Admit packets to the queues; returns them sorted by sender, also kept in `queued`.

        `sent_at_ns` (k,) holds one time for all packets of a sender; `others_alive` (rows,) is the number of intended
        receivers of its broadcasts in this epoch.
        """
        packets = self._admission.take(sent_at_ns, sent, others_alive, epoch)
        self._access(packets)
        self.queued = self.queued.followed_by(packets)
        if self._any_held:
            at_ns = np.zeros(len(self._backlog), np.int64)
            at_ns[sent.sender] = sent_at_ns
            self.queued = newest_only(self.queued, self._backlog == NEWEST, at_ns)
        return packets

    def leave(self, until_ns: int, disruption: Disruption) -> Transmissions:
        """Take out of the queues the packets that go on air, or are refused, before `until_ns`.

        A packet due while its radio is off ends at that time as BLACKOUT: the queue drains at the usual pace, unless
        its backlog is held.
        """
        if not len(self.queued):
            return NO_PACKETS
        packets = self._take_out(self.queued.on_air_at_ns < until_ns)
        if not disruption.anyone_out:
            return packets
        under_way = packets.fate == UNDER_WAY
        off, dead = under_way & ~disruption.radio_on[packets.sender], under_way & ~disruption.alive[packets.sender]
        fate = np.where(dead, Fate.SENDER_DEAD, np.where(off, Fate.BLACKOUT, packets.fate))
        off_air_at_ns = np.where(off | dead, packets.on_air_at_ns, packets.off_air_at_ns)
        return packets.replaced(fate=fate, off_air_at_ns=off_air_at_ns)

    def switch(self, at_ns: int, disruption: Disruption) -> None:
        """Apply radios that are off or on from `at_ns` on: hold their queues, or release them."""
        previous, self._backlog = self._backlog, disruption.backlog_now
        held, free = self._backlog != DROP, (previous != DROP) & (self._backlog == DROP)
        self._any_held = bool(held.any())
        if free.any():
            self.queued, self._free_at_ns = release_queue(self.queued, free, self._free_at_ns, at_ns)
        if (held & (previous == DROP)).any():
            self.queued, self._free_at_ns = hold_queue(self.queued, held & (previous == DROP), self._free_at_ns)
        self.queued = newest_only(self.queued, self._backlog == NEWEST, np.full(len(held), at_ns))

    def die(self, at_ns: int, alive: BoolArray) -> Transmissions:
        """Take out all packets of robots not `alive` (rows,) as SENDER_DEAD, and free their radios."""
        self._free_at_ns[~alive] = 0
        packets = self._take_out(~alive[self.queued.sender])
        at = np.full(len(packets), at_ns)
        fate = np.where(packets.fate == UNDER_WAY, Fate.SENDER_DEAD, packets.fate)
        return packets.replaced(fate=fate, on_air_at_ns=at, off_air_at_ns=at)

    def _take_out(self, due: BoolArray) -> Transmissions:
        packets, self.queued = self.queued.parted(due)
        return packets

    def _access(self, packets: Transmissions) -> None:
        """Write the fates and times on air of new packets into their table."""
        tables = self.queued.table, packets.table, packets.payloads.offset, self._headers_bytes, self._airtime_ns
        if not self._any_held:
            enter(self._free_at_ns, *tables, self._limit)
            return
        held = self._backlog != DROP
        free_at_ns = np.where(held, FAR_NS, self._free_at_ns)
        enter(free_at_ns, *tables, np.where(self._backlog == NEWEST, NO_LIMIT, self._limit))
        self._free_at_ns = np.where(held, self._free_at_ns, free_at_ns)
