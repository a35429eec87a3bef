"""Transmit queues of the unit disk: time on air of each packet, refusals, and the outage queue policy.

Each sender has a queue, first in, first out: its packets in the table that are WAITING. While a radio is off its
packets end, or wait by its backlog policy.
"""

# pyright: basic, reportUnknownMemberType=false

from typing import Any, NamedTuple

import numpy as np

from swarmwire.comms.base.arrays import AnyArray, BoolArray, IntArray
from swarmwire.comms.base.kernels import kernel, njit
from swarmwire.comms.base.sentinels import ABSENT, UNDER_WAY
from swarmwire.comms.radio.config.frames import airtime_ns
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.disruption import DROP, NEWEST, Disruption
from swarmwire.comms.radio.transmissions import (
    DUE,
    WAITING,
    Admission,
    SentColumns,
    Transmissions,
    admit,
    frame_sizes,
    size_row,
)
from swarmwire.comms.robot.packets import Fate, SentPackets

QUEUE_FULL, TOO_LARGE, BLACKOUT = int(Fate.QUEUE_FULL), int(Fate.TOO_LARGE), int(Fate.BLACKOUT)
SENDER_DEAD = int(Fate.SENDER_DEAD)
FAR_NS = 2**62  # time on air of a paused packet; airtimes may be added to it
NO_LIMIT = 2**31  # queue limit under NEWEST, which ends all other packets; pragma: no mutate


class QueueState(NamedTuple):
    """The queue of each radio as input of kernels, (rows,) each."""

    free_at_ns: IntArray  # end of the last airtime
    limit: IntArray  # packets that may wait
    backlog: IntArray  # DROP, or the policy while the radio is off


@njit()
def accept(
    packets: Any,
    data: Any,
    used: Any,
    sent: SentColumns,
    others_alive: Any,
    epoch: int,
    sent_before: Any,
    counts: Any,
    queue: QueueState,
    headers_bytes: int,
    airtime_ns: Any,
) -> int:
    """Admit sent packets and queue them; see `admit`.

    `airtime_ns` is the airtime by `size_row`, with `headers_bytes` as in `frame_sizes`.
    """
    first = used[0]
    result = admit(packets, data, used, sent, others_alive, epoch, sent_before, counts)
    enqueue(packets, used, first, queue, headers_bytes, airtime_ns)
    return result


@njit()
def enqueue(packets: Any, used: Any, first: int, queue: QueueState, headers_bytes: int, airtime_ns: Any) -> None:
    """Queue the packets from row `first` on: `on_air_at = max(sent_at, end of the sender's previous packet)`, in ns.

    A packet that must wait is refused while `queue.limit` others of its sender wait (go on air after `sent_at`). All
    times of the new packets are `sent_at`, which is the same for all packets of a sender. Updates `queue.free_at_ns`.
    """
    waiting, sent_at_ns = np.zeros(len(queue.limit), np.int64), np.zeros(len(queue.limit), np.int64)
    for p in range(first, used[0]):
        sent_at_ns[packets[p].sender] = packets[p].sent_at_ns
    for p in range(first):
        waiting[packets[p].sender] += packets[p].on_air_at_ns > sent_at_ns[packets[p].sender]
    for p in range(first, used[0]):
        packet = packets[p]
        s, size = packet.sender, size_row(packet, headers_bytes)
        is_paused, limit = queue.backlog[s] != DROP, queue.limit[s]
        free_at_ns = FAR_NS if is_paused else queue.free_at_ns[s]
        if queue.backlog[s] == NEWEST:
            limit = NO_LIMIT
        must_wait = free_at_ns > sent_at_ns[s]
        if size >= len(airtime_ns):
            packet.fate = TOO_LARGE
        elif must_wait and waiting[s] >= limit:
            packet.fate = QUEUE_FULL
        else:
            packet.on_air_at_ns = max(sent_at_ns[s], free_at_ns)
            packet.off_air_at_ns = packet.on_air_at_ns + airtime_ns[size]
            waiting[s] += must_wait
            if not is_paused:
                queue.free_at_ns[s] = packet.off_air_at_ns


@njit()
def end_older(packets: Any, used: Any, backlog: AnyArray, at_ns: int) -> None:
    """End all paused packets of each radio whose `backlog` (rows,) is NEWEST, but its newest.

    They end as BLACKOUT, since the radio that is off loses them: at `at_ns`, or as the newest arrives if it is ABSENT.
    """
    newest = np.full(len(backlog), ABSENT)
    for p in range(used[0]):
        if packets[p].step == WAITING and packets[p].on_air_at_ns >= FAR_NS:
            newest[packets[p].sender] = p
    for p in range(used[0]):
        packet = packets[p]
        s = packet.sender
        if packet.step == WAITING and packet.on_air_at_ns >= FAR_NS and backlog[s] == NEWEST and newest[s] != p:
            packet.fate = BLACKOUT
            packet.on_air_at_ns = packets[newest[s]].sent_at_ns if at_ns == ABSENT else at_ns
            packet.off_air_at_ns = packet.on_air_at_ns


@njit()
def pause(packets: Any, used: Any, radios: AnyArray, free_at_ns: AnyArray) -> None:
    """Pause the packets of `radios` (rows,) that go off, and free these from the packets' airtimes."""
    is_paused = np.zeros(len(radios), np.bool_)
    for p in range(used[0]):
        packet = packets[p]
        s = packet.sender
        if packet.step != WAITING or not radios[s] or packet.fate != UNDER_WAY:
            continue
        if not is_paused[s]:  # the packet before the first paused one ends when that one would have started
            is_paused[s] = True
            free_at_ns[s] = packet.on_air_at_ns
        packet.off_air_at_ns += FAR_NS - packet.on_air_at_ns
        packet.on_air_at_ns = FAR_NS


@kernel(from_python=True)
def resume(packets: Any, used: Any, radios: AnyArray, free_at_ns: AnyArray, at_ns: int) -> None:
    """Resume the paused packets of `radios` (rows,): they go on air from `at_ns` on, one after the other."""
    for p in range(used[0]):
        packet = packets[p]
        s = packet.sender
        if packet.step != WAITING or not radios[s] or packet.on_air_at_ns < FAR_NS:
            continue
        airtime_ns = packet.off_air_at_ns - packet.on_air_at_ns
        packet.on_air_at_ns = max(at_ns, free_at_ns[s], packet.sent_at_ns)
        packet.off_air_at_ns = packet.on_air_at_ns + airtime_ns
        free_at_ns[s] = packet.off_air_at_ns


@kernel(from_python=True)
def end_dead(packets: Any, used: Any, alive: AnyArray, free_at_ns: AnyArray, at_ns: int):
    """End all waiting packets of robots that are not `alive` (rows,) as SENDER_DEAD, and free their radios.

    Return the number of these packets, which are then DUE.
    """
    count = 0
    for s in range(len(alive)):
        if not alive[s]:
            free_at_ns[s] = 0
    for p in range(used[0]):
        packet = packets[p]
        if packet.step == WAITING and not alive[packet.sender]:
            packet.step, packet.on_air_at_ns, packet.off_air_at_ns = DUE, at_ns, at_ns
            if packet.fate == UNDER_WAY:
                packet.fate = SENDER_DEAD
            count += 1
    return count


@kernel()
def leave_queue(packet: Any, until_ns: int, cuts: Any):
    """Return True for a packet that goes on air, or is refused, before `until_ns`, or that is DUE; it is then DUE.

    A packet due while its radio is off ends at that time as BLACKOUT: the queue drains at the usual pace, unless its
    backlog policy pauses it.
    """
    if packet.step != WAITING or packet.on_air_at_ns >= until_ns:
        return packet.step == DUE
    packet.step = DUE
    if packet.fate == UNDER_WAY:
        if not cuts.alive[packet.sender]:
            packet.fate, packet.off_air_at_ns = SENDER_DEAD, packet.on_air_at_ns
        elif not cuts.radio_on[packet.sender]:
            packet.fate, packet.off_air_at_ns = BLACKOUT, packet.on_air_at_ns
    return True


class TxQueues:
    """The transmit queue of each radio, first in, first out: the waiting packets of the table `packets`."""

    def __init__(self, radio: Radio, rows: int, packets: Transmissions) -> None:
        self._packets, self._admission = packets, Admission(rows, packets)
        self._state = QueueState(np.zeros(rows, np.int64), np.empty(rows, np.int64), np.full(rows, DROP))
        self._any_paused = False
        self.tune(radio)

    def tune(self, radio: Radio) -> None:
        """Use the parameters of `radio` for later packets."""
        self._state.limit[:] = radio.queue_limit
        self._headers_bytes, sizes = frame_sizes(radio)
        self._airtime_ns: IntArray = airtime_ns(radio, sizes)

    def accept(
        self, sent_at_ns: IntArray, sent: SentPackets, others_alive: IntArray, epoch: int, counts: AnyArray
    ) -> int:
        """Append sent packets to the table, sorted by sender, and queue them; see `admit`.

        `sent_at_ns` (k,) holds one time for all packets of a sender.
        """
        queue = self._state, self._headers_bytes, self._airtime_ns
        result = self._admission.accept(accept, sent_at_ns, sent, others_alive, epoch, counts, queue)
        if self._any_paused:
            end_older(self._packets.table, self._packets.used, self._state.backlog, ABSENT)
        return result

    def switch(self, at_ns: int, disruption: Disruption) -> None:
        """Apply radios that are off or on from `at_ns` on: pause or resume their queues."""
        packets, state = self._packets, self._state
        was_paused, is_paused = state.backlog != DROP, disruption.active_backlog != DROP
        state.backlog[:] = disruption.active_backlog
        self._any_paused = bool(is_paused.any())
        resume(packets.table, packets.used, was_paused & ~is_paused, state.free_at_ns, at_ns)
        pause(packets.table, packets.used, is_paused & ~was_paused, state.free_at_ns)
        end_older(packets.table, packets.used, state.backlog, at_ns)

    def end_dead(self, at_ns: int, alive: BoolArray) -> int:
        """End the queues of robots that are not `alive` (rows,); return the number of packets that became due."""
        return end_dead(self._packets.table, self._packets.used, alive, self._state.free_at_ns, at_ns)
