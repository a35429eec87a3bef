"""The books of the air: packets and receivers counted between two reports."""

# pyright: basic, reportUnknownMemberType=false

import numpy as np
from numba import njit

from swarmwire.comms.air.links import Links
from swarmwire.comms.air.transmissions import Transmissions
from swarmwire.comms.arrays import BoolArray
from swarmwire.comms.fates import Fate
from swarmwire.comms.truth import Tally


class Accounts:
    """Counts by arena. Over a run, `end` of the air included, the fates add up to the intended receivers.

    - `sent`, `intended`: when a packet is handed to the air, refused packets included.
    - `fates`: when a fate becomes final, once for each intended receiver.
    - `in_range`: with the fate, for receivers that range and walls did not keep off; also those that a packet refused
      for a full queue would have had. Never those of packets too large or in flight at the end.
    """

    def __init__(self, arenas: int, robots: int) -> None:
        self._arenas, self._robots = arenas, robots
        self._open()

    def take_up(self, packets: Transmissions) -> None:
        """Count packets that were handed to the air."""
        arena = packets.sender // self._robots
        np.add.at(self._sent, arena, 1)
        np.add.at(self._intended, arena, packets.intended)

    def settle(self, links: Links, until_ns: int) -> None:
        """Count the fates of links that are final by `until_ns`."""
        columns = links.sender, links.final_at_ns, links.fate, links.receivers, links.in_range
        _settle(*columns, until_ns, self._robots, self._fates, self._in_range)

    def strand(self, links: Links, queued: Transmissions) -> None:
        """Count what the end of the run leaves under way or queued."""
        np.add.at(self._fates[:, Fate.IN_FLIGHT], links.sender // self._robots, links.receivers)
        np.add.at(self._fates[:, Fate.IN_FLIGHT], queued.sender // self._robots, queued.intended)

    def close(self, arenas: BoolArray | None = None) -> Tally:
        """What was counted since the last report; of these arenas (arenas,) alone if they are given."""
        tally = Tally(self._sent, self._intended, self._in_range, self._fates)
        self._open()
        if arenas is None:
            return tally
        others = tally.of(~arenas)
        self._sent, self._intended = others.sent, others.intended
        self._in_range, self._fates = others.in_range, others.fates
        return tally.of(arenas)

    def _open(self) -> None:
        self._sent, self._intended, self._in_range = (np.zeros(self._arenas, np.int64) for _ in range(3))
        self._fates = np.zeros((self._arenas, len(Fate)), np.int64)


@njit(cache=True)
def _settle(sender, final_at_ns, fate, receivers, in_range, until_ns, robots, fates_out, in_range_out):
    for i in range(len(sender)):
        if final_at_ns[i] <= until_ns:
            arena = sender[i] // robots
            fates_out[arena, fate[i]] += receivers[i]
            in_range_out[arena] += in_range[i]
