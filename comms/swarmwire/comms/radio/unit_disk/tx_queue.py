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
FAR_NS = 2**62  # time on air of a paused packet; airtimes may be added to it
NO_PACKETS = Transmissions.none()
NO_LIMIT = 2**31  # queue limit under NEWEST, which ends all other packets; pragma: no mutate


@njit()
def enqueue(
    free_at_ns: IntArray,
    queued: IntArray,
    packets: IntArray,
    offset: IntArray,
    headers_bytes: int,
    airtime_ns: IntArray,
    queue_limit: IntArray,
) -> None:
    """Queue new packets, first in, first out: `on_air_at = max(sent_at, end of the sender's previous packet)`, in ns.

    A packet that must wait is refused while `queue_limit` others of its sender wait (go on air after `sent_at`).
    Writes fate and times on and off air into the table `packets`, and updates `free_at_ns`.

    Args:
        free_at_ns: end of the last airtime by robot row.
        queued: table of packets that may still wait.
        packets: table of the new packets, with all times at `sent_at`, which is the same for all packets of a sender.
        offset: offset of the new packets' payloads.
        headers_bytes: as in `frame_sizes`.
        airtime_ns: airtime by `size_row`.
        queue_limit: limit by robot row.
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


def pause_queue(queued: Transmissions, radios: BoolArray, free_at_ns: IntArray) -> tuple[Transmissions, IntArray]:
    """Pause the packets of `radios` (rows,) that go off; return the queue and the end of the last airtime.

    `free_at_ns` (rows,) is the end of the last airtime of all queued packets.
    """
    on_air_at_ns, off_air_at_ns, free_at_ns = _pause(
        queued.sender, queued.fate, queued.on_air_at_ns, queued.off_air_at_ns, radios, free_at_ns
    )
    return queued.with_columns(on_air_at_ns=on_air_at_ns, off_air_at_ns=off_air_at_ns), free_at_ns


def resume_queue(
    queued: Transmissions, radios: BoolArray, free_at_ns: IntArray, at_ns: int
) -> tuple[Transmissions, IntArray]:
    """Resume the paused packets of `radios` (rows,): they go on air from `at_ns` on, one after the other.

    `free_at_ns` (rows,) is the end of their last airtime; returned with its new values.
    """
    on_air_at_ns, off_air_at_ns, free_at_ns = _resume(
        queued.sender, queued.sent_at_ns, queued.on_air_at_ns, queued.off_air_at_ns, radios, free_at_ns, at_ns
    )
    return queued.with_columns(on_air_at_ns=on_air_at_ns, off_air_at_ns=off_air_at_ns), free_at_ns


def end_older(queued: Transmissions, radios: BoolArray, at_ns: IntArray) -> Transmissions:
    """End all paused packets of each radio of `radios` (rows,) but its newest.

    They end as BLACKOUT at `at_ns` (rows,), by sender, since the radio that is off loses them.
    """
    if not radios.any():
        return queued
    waiting = np.flatnonzero((queued.on_air_at_ns >= FAR_NS) & radios[queued.sender])
    newest = np.zeros(len(radios), np.int64)
    np.maximum.at(newest, queued.sender[waiting], waiting)
    old = waiting[newest[queued.sender[waiting]] != waiting]
    if not len(old):
        return queued
    fate, on_air_at_ns, off_air_at_ns = queued.fate.copy(), queued.on_air_at_ns.copy(), queued.off_air_at_ns.copy()
    fate[old] = Fate.BLACKOUT
    on_air_at_ns[old] = off_air_at_ns[old] = at_ns[queued.sender[old]]
    return queued.with_columns(fate=fate, on_air_at_ns=on_air_at_ns, off_air_at_ns=off_air_at_ns)


@njit()
def _pause(sender, fate, on_air_at_ns, off_air_at_ns, radios, free_at_ns):
    on_air_at_ns, off_air_at_ns, free_at_ns = on_air_at_ns.copy(), off_air_at_ns.copy(), free_at_ns.copy()
    is_paused = np.zeros(len(radios), np.bool_)
    for p in range(len(sender)):
        s = sender[p]
        if not radios[s] or fate[p] != UNDER_WAY:
            continue
        if not is_paused[s]:  # the packet before the first paused one ends when that one would have started
            is_paused[s] = True
            free_at_ns[s] = on_air_at_ns[p]
        off_air_at_ns[p] += FAR_NS - on_air_at_ns[p]
        on_air_at_ns[p] = FAR_NS
    return on_air_at_ns, off_air_at_ns, free_at_ns


@njit()
def _resume(sender, sent_at_ns, on_air_at_ns, off_air_at_ns, radios, free_at_ns, at_ns):
    on_air_at_ns, off_air_at_ns, free_at_ns = on_air_at_ns.copy(), off_air_at_ns.copy(), free_at_ns.copy()
    for p in range(len(sender)):
        s = sender[p]
        if not radios[s] or on_air_at_ns[p] < FAR_NS:
            continue
        airtime_ns = off_air_at_ns[p] - on_air_at_ns[p]
        on_air_at_ns[p] = max(at_ns, free_at_ns[s], sent_at_ns[p])
        off_air_at_ns[p] = on_air_at_ns[p] + airtime_ns
        free_at_ns[s] = off_air_at_ns[p]
    return on_air_at_ns, off_air_at_ns, free_at_ns


class TxQueues:
    """The transmit queue of each radio, first in, first out.

    Attributes:
        queued: the packets that wait.
    """

    def __init__(self, radio: Radio, rows: int) -> None:
        self._admission = Admission(rows)
        self._free_at_ns = np.zeros(rows, np.int64)
        self._backlog, self._any_paused = np.full(rows, DROP), False
        self._limit = np.full(rows, radio.queue_limit)
        self.queued = Transmissions.none()
        self.tune(radio)

    def tune(self, radio: Radio) -> None:
        """Use the parameters of `radio` for later packets."""
        self._limit[:] = radio.queue_limit
        self._headers_bytes, sizes = frame_sizes(radio)
        self._airtime_ns = airtime_ns(radio, sizes)

    def accept(self, sent_at_ns: IntArray, sent: SentPackets, others_alive: IntArray, epoch: int) -> Transmissions:
        """Add packets to `queued`; returns them sorted by sender.

        `sent_at_ns` (k,) holds one time for all packets of a sender; `others_alive` (rows,) is the number of intended
        receivers of its broadcasts in this epoch.
        """
        packets = self._admission.admit(sent_at_ns, sent, others_alive, epoch)
        self._enqueue(packets)
        self.queued = self.queued.followed_by(packets)
        if self._any_paused:
            at_ns = np.zeros(len(self._backlog), np.int64)
            at_ns[sent.sender] = sent_at_ns
            self.queued = end_older(self.queued, self._backlog == NEWEST, at_ns)
        return packets

    def pop_due(self, until_ns: int, disruption: Disruption) -> Transmissions:
        """Remove the packets that go on air, or are refused, before `until_ns`.

        A packet due while its radio is off ends at that time as BLACKOUT: the queue drains at the usual pace, unless
        its backlog policy pauses it.
        """
        if not len(self.queued):
            return NO_PACKETS
        packets = self._pop(self.queued.on_air_at_ns < until_ns)
        if not disruption.has_outages:
            return packets
        under_way = packets.fate == UNDER_WAY
        off, dead = under_way & ~disruption.radio_on[packets.sender], under_way & ~disruption.alive[packets.sender]
        fate = np.where(dead, Fate.SENDER_DEAD, np.where(off, Fate.BLACKOUT, packets.fate))
        off_air_at_ns = np.where(off | dead, packets.on_air_at_ns, packets.off_air_at_ns)
        return packets.with_columns(fate=fate, off_air_at_ns=off_air_at_ns)

    def switch(self, at_ns: int, disruption: Disruption) -> None:
        """Apply radios that are off or on from `at_ns` on: pause or resume their queues."""
        previous, self._backlog = self._backlog, disruption.active_backlog
        paused = self._backlog != DROP
        resuming, pausing = ~paused & (previous != DROP), paused & (previous == DROP)
        self._any_paused = bool(paused.any())
        if resuming.any():
            self.queued, self._free_at_ns = resume_queue(self.queued, resuming, self._free_at_ns, at_ns)
        if pausing.any():
            self.queued, self._free_at_ns = pause_queue(self.queued, pausing, self._free_at_ns)
        self.queued = end_older(self.queued, self._backlog == NEWEST, np.full(len(paused), at_ns))

    def pop_dead(self, at_ns: int, alive: BoolArray) -> Transmissions:
        """Remove all packets of robots that are not `alive` (rows,) as SENDER_DEAD, and free their radios."""
        self._free_at_ns[~alive] = 0
        packets = self._pop(~alive[self.queued.sender])
        end_ns = np.full(len(packets), at_ns)
        fate = np.where(packets.fate == UNDER_WAY, Fate.SENDER_DEAD, packets.fate)
        return packets.with_columns(fate=fate, on_air_at_ns=end_ns, off_air_at_ns=end_ns)

    def _pop(self, due: BoolArray) -> Transmissions:
        packets, self.queued = self.queued.split(due)
        return packets

    def _enqueue(self, packets: Transmissions) -> None:
        """Write the fates and times on air of new packets into their table."""
        queued, offset = self.queued.table, packets.payloads.offset
        free_at_ns, limit = self._free_at_ns, self._limit
        if self._any_paused:
            free_at_ns = np.where(self._backlog != DROP, FAR_NS, free_at_ns)
            limit = np.where(self._backlog == NEWEST, NO_LIMIT, limit)
        enqueue(free_at_ns, queued, packets.table, offset, self._headers_bytes, self._airtime_ns, limit)
        if self._any_paused:
            self._free_at_ns = np.where(self._backlog != DROP, self._free_at_ns, free_at_ns)
