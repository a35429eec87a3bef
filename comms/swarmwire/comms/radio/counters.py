"""The books of the medium: packets and receivers counted between two reports."""

# pyright: basic, reportUnknownMemberType=false

import numpy as np
from numba import njit

from swarmwire.comms.arrays import BoolArray, IntArray
from swarmwire.comms.packets import Fate
from swarmwire.comms.radio.links import Links
from swarmwire.comms.radio.transmissions import Transmissions
from swarmwire.comms.truth import PacketCounts


class PacketCounters:
    """Counts by arena. Over a run, `end` of the medium included, the fates add up to the intended receivers.

    - `sent`, `intended`: when a packet is handed to the medium, refused packets included.
    - `fates`: when a fate becomes final, once for each intended receiver.
    - `in_range`: with the fate, for receivers that range and walls did not keep off; also those that a packet refused
      for a full queue would have had. Never those of packets too large or in flight at the end.
    """

    def __init__(self, arenas: int, robots: int) -> None:
        self._arenas, self._robots = arenas, robots
        self._open()

    def take_up(self, packets: Transmissions) -> None:
        """Count packets that were handed to the medium."""
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

    def close(self, arenas: BoolArray | None = None) -> PacketCounts:
        """What was counted since the last report; of these arenas (arenas,) alone if they are given."""
        tally = PacketCounts(self._sent, self._intended, self._in_range, self._fates)
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


# --- Who was alive when a packet was sent: those are the receivers that a broadcast intends.


class LivenessHistory:
    """Robots alive by epoch; an epoch begins whenever a robot dies or is revived."""

    def __init__(self, rows: int) -> None:
        self.epoch = 0
        self._alive: dict[int, BoolArray] = {0: np.ones(rows, np.bool_)}

    def now(self, alive: BoolArray) -> None:
        """These robots (rows,) are alive from now on."""
        if not np.array_equal(alive, self._alive[self.epoch]):
            self.epoch += 1
            self._alive[self.epoch] = alive.copy()

    @property
    def any_dead(self) -> bool:
        """Whether anybody was dead in an epoch that matters."""
        return not all(alive.all() for alive in self._alive.values())

    def intended(self, epoch: IntArray, receiver: IntArray) -> BoolArray:
        """Which robot rows `receiver` were alive in the epochs given, (k,)."""
        found = np.ones(len(receiver), np.bool_)
        for one, alive in self._alive.items():
            if not alive.all():
                of_epoch = epoch == one
                found[of_epoch] = alive[receiver[of_epoch]]
        return found

    def forget(self, queued: IntArray) -> None:
        """Drop the epochs in which none of the packets still queued was sent."""
        if len(self._alive) > 1:
            needed = {self.epoch, *np.unique(queued).tolist()}
            self._alive = {one: alive for one, alive in self._alive.items() if one in needed}
