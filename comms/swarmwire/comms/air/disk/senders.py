"""The senders' side of all radios: packets are numbered, queued, and leave when they go on air or are refused."""

import numpy as np

from swarmwire.comms.air.disk import queue
from swarmwire.comms.air.disk.backlog import FAR_NS, held_back, let_go, newest_only
from swarmwire.comms.air.disruption import DROP, NEWEST, Disruption
from swarmwire.comms.air.intake import Intake
from swarmwire.comms.air.radio import Radio
from swarmwire.comms.air.timing.frames import airtime_ns
from swarmwire.comms.air.transmissions import Transmissions
from swarmwire.comms.arrays import BoolArray, IntArray
from swarmwire.comms.fates import Fate
from swarmwire.comms.packets import Sent

NOTHING = Transmissions.none()
NO_LIMIT = 2**31  # where all but the newest packet end anyway


class Senders:
    """Each robot's radio: a queue, first in, first out, and a count of the packets that it was handed."""

    def __init__(self, radio: Radio, rows: int) -> None:
        self._radio = radio
        self._intake = Intake(rows)
        self._free_at_ns = np.zeros(rows, np.int64)
        self._backlog = np.full(rows, DROP)
        self.queued = Transmissions.none()

    def tune(self, radio: Radio) -> None:
        """The radio has other numbers for packets to come."""
        self._radio = radio

    def accept(self, sent_at_ns: IntArray, sent: Sent, others_alive: IntArray, epoch: int) -> Transmissions:
        """The packets as the radios take them up, sorted by sender; also kept in `queued`.

        `sent_at_ns` (rows,) is when each robot hands its packets over, `others_alive` (rows,) are the receivers that a
        robot's broadcast intends, those of the epoch.
        """
        packets = self._intake.take(sent_at_ns, sent, others_alive, epoch)
        on_air_at_ns, off_air_at_ns, fate = self._access(sent_at_ns, packets.sender, packets.payloads.sizes)
        packets = packets._replace(on_air_at_ns=on_air_at_ns, off_air_at_ns=off_air_at_ns, fate=fate)
        self.queued = newest_only(self.queued.followed_by(packets), self._backlog == NEWEST, sent_at_ns)
        return packets

    def leave(self, until_ns: int, now: Disruption) -> Transmissions:
        """Take out of the queues what goes on air, or is refused, before `until_ns`.

        What a radio that is off should put on air ends at that moment as BLACKOUT: its queue drains at the usual pace,
        unless it is kept back.
        """
        packets = self._taken(self.queued.on_air_at_ns < until_ns)
        if not now.anyone_out:
            return packets
        accepted = packets.fate == queue.ACCEPTED
        off, dead = accepted & ~now.radio_on[packets.sender], accepted & ~now.alive[packets.sender]
        fate = np.where(dead, Fate.SENDER_DEAD, np.where(off, Fate.BLACKOUT, packets.fate))
        off_air_at_ns = np.where(off | dead, packets.on_air_at_ns, packets.off_air_at_ns)
        return packets._replace(fate=fate, off_air_at_ns=off_air_at_ns)

    def switch(self, at_ns: int, now: Disruption) -> None:
        """Radios are off or on from `at_ns` on: queues are kept back, or go on air again."""
        before, self._backlog = self._backlog, now.backlog_now
        held, free = self._backlog != DROP, (before != DROP) & (self._backlog == DROP)
        if free.any():
            self.queued, self._free_at_ns = let_go(self.queued, free, self._free_at_ns, at_ns)
        if (held & (before == DROP)).any():
            self.queued, self._free_at_ns = held_back(self.queued, held & (before == DROP), self._free_at_ns)
        self.queued = newest_only(self.queued, self._backlog == NEWEST, np.full(len(held), at_ns))

    def die(self, at_ns: int, alive: BoolArray) -> Transmissions:
        """Take out all that waits at radios of robots not alive (rows,): SENDER_DEAD now, and the radios are free."""
        self._free_at_ns[~alive] = 0
        packets = self._taken(~alive[self.queued.sender])
        at = np.full(len(packets.sender), at_ns)
        fate = np.where(packets.fate == queue.ACCEPTED, Fate.SENDER_DEAD, packets.fate)
        return packets._replace(fate=fate, on_air_at_ns=at, off_air_at_ns=at)

    def _taken(self, due: BoolArray) -> Transmissions:
        if not due.any():
            return NOTHING
        packets, self.queued = self.queued.parted(due)
        return packets

    def _access(self, sent_at_ns: IntArray, sender: IntArray, sizes: IntArray) -> tuple[IntArray, IntArray, IntArray]:
        radio = self._radio
        lasts_ns = airtime_ns(radio, sizes + radio.overhead_bytes)
        held = self._backlog != DROP
        on_air_at_ns, fate, free_at_ns = queue.enter(
            sent_at_ns,
            np.where(held, FAR_NS, self._free_at_ns),
            self.queued.sender,
            self.queued.on_air_at_ns,
            sender,
            lasts_ns,
            sizes > radio.max_payload_bytes,
            np.where(self._backlog == NEWEST, NO_LIMIT, radio.queue_limit),
        )
        self._free_at_ns = np.where(held, self._free_at_ns, free_at_ns)
        return on_air_at_ns, on_air_at_ns + np.where(fate == queue.ACCEPTED, lasts_ns, 0), fate
