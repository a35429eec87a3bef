"""Packet counters of the medium."""

import numpy as np

from swarmwire.comms.base.arrays import AnyArray, BoolArray, IntArray
from swarmwire.comms.base.kernels import njit
from swarmwire.comms.radio.links import Links
from swarmwire.comms.radio.records import PacketCounts
from swarmwire.comms.radio.transmissions import Transmissions
from swarmwire.comms.robot.packets import Fate


class PacketCounters:
    """Counts by arena; over a run, with `end` of the medium, the fates add up to the intended receivers.

    - `sent`, `intended`: counted when a packet is sent, refused packets included.
    - `fates`: counted when a fate becomes final, once for each intended receiver.
    - `in_range`: counted with the fate, for receivers that range and walls allow, also of packets that a full queue
      refused; never of packets that are too large or in flight at the end.
    """

    def __init__(self, arenas: int, robots: int) -> None:
        self._arenas, self._robots = arenas, robots
        self._reset()

    def count_sent(self, packets: Transmissions) -> None:
        """Count packets that were sent."""
        _count_sent(packets.sender, packets.intended, self._robots, self._sent, self._intended)

    @property
    def final_counts(self) -> tuple[IntArray, IntArray]:
        """Counts of final fates (arenas, fates) and of their receivers in range (arenas,); callers add to them."""
        return self._fates, self._in_range

    def count_in_flight(self, links: Links, queued: Transmissions) -> None:
        """Count the links under way and the queued packets at the end of the run as IN_FLIGHT."""
        np.add.at(self._fates[:, Fate.IN_FLIGHT], links.sender // self._robots, links.receiver_count)
        np.add.at(self._fates[:, Fate.IN_FLIGHT], queued.sender // self._robots, queued.intended)

    def close(self, arenas: BoolArray | None = None) -> PacketCounts:
        """Return the counts since the last call, of all arenas or only of `arenas` (arenas,), and reset them."""
        counts = PacketCounts(self._sent, self._intended, self._in_range, self._fates)
        self._reset()
        if arenas is None:
            return counts
        others = counts.in_arenas(~arenas)
        self._sent, self._intended = others.sent, others.intended
        self._in_range, self._fates = others.in_range, others.fates
        return counts.in_arenas(arenas)

    def _reset(self) -> None:
        self._sent, self._intended = (np.zeros(self._arenas, np.int64) for _ in range(2))
        self._in_range: IntArray = np.zeros(self._arenas, np.int64)
        self._fates: IntArray = np.zeros((self._arenas, len(Fate)), np.int64)


@njit()
def _count_sent(sender: AnyArray, intended: AnyArray, robots: int, sent_out: AnyArray, intended_out: AnyArray):
    for p in range(len(sender)):
        sent_out[sender[p] // robots] += 1
        intended_out[sender[p] // robots] += intended[p]
