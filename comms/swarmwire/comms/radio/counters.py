"""Packet counters of the medium."""

# pyright: basic, reportUnknownMemberType=false

import numpy as np

from swarmwire.comms.base.arrays import BoolArray, Table, record_type
from swarmwire.comms.radio.records import PacketCounts
from swarmwire.comms.robot.packets import Fate

COUNTS = record_type(
    [
        ("sent", np.int64),
        ("intended", np.int64),
        ("in_range", np.int64),
        ("fates", np.int64, (len(Fate),)),
    ]
)


class PacketCounters:
    """Counts by arena; over a run, with `end` of the medium, the fates add up to the intended receivers.

    - `sent`, `intended`: counted when a packet is sent, refused packets included.
    - `fates`: counted when a fate becomes final, once for each intended receiver.
    - `in_range`: counted with the fate, for receivers that range and walls allow, also of packets that a full queue
      refused; never of packets that are too large or in flight at the end.

    Attributes:
        counts: counts since the last `close`, (arenas,) of type COUNTS; kernels add to them.
    """

    def __init__(self, arenas: int, robots: int) -> None:
        self._robots = robots
        self.counts: Table = np.zeros(arenas, COUNTS)

    def count_in_flight(self, links: Table, queued: Table) -> None:
        """Count the links under way, of type LINK, and the queued packets, of type PACKET, as IN_FLIGHT."""
        in_flight = self.counts["fates"][:, Fate.IN_FLIGHT]
        np.add.at(in_flight, links["sender"] // self._robots, links["receiver_count"])
        np.add.at(in_flight, queued["sender"] // self._robots, queued["intended"])

    def close(self, arenas: BoolArray | None = None) -> PacketCounts:
        """Return the counts since the last call, of all arenas or only of `arenas` (arenas,), and reset them."""
        closed, self.counts = self.counts, np.zeros(len(self.counts), COUNTS)
        counts = PacketCounts(closed["sent"], closed["intended"], closed["in_range"], closed["fates"])
        if arenas is None:
            return counts
        self.counts[~arenas] = closed[~arenas]
        return counts.in_arenas(arenas)
