"""Packet counters of the medium, and the liveness history that decides the intended receivers of broadcasts."""

# pyright: basic, reportUnknownMemberType=false

import numpy as np

from swarmwire.comms.base.arrays import BoolArray, IntArray
from swarmwire.comms.base.kernels import njit
from swarmwire.comms.radio.links import Links
from swarmwire.comms.radio.records import PacketCounts
from swarmwire.comms.radio.transmissions import Transmissions
from swarmwire.comms.robot.packets import Fate


class PacketCounters:
    """Counts by arena. Over a run, with `end` of the medium, the fates add up to the intended receivers.

    - `sent`, `intended`: counted when a packet is sent, refused packets included.
    - `fates`: counted when a fate becomes final, once for each intended receiver.
    - `in_range`: counted with the fate, for receivers that range and walls allow; also for those that a packet refused
      by a full queue would have had. Never for packets too large or in flight at the end.
    """

    def __init__(self, arenas: int, robots: int) -> None:
        self._arenas, self._robots = arenas, robots
        self._open()

    def count_sent(self, packets: Transmissions) -> None:
        """Count packets that were sent."""
        _count_sent(packets.sender, packets.intended, self._robots, self._sent, self._intended)

    @property
    def final(self) -> tuple[IntArray, IntArray]:
        """The fates that became final, and their receivers in range, to be added to."""
        return self._fates, self._in_range

    def count_in_flight(self, links: Links, queued: Transmissions) -> None:
        """Count the links under way and the queued packets at the end of the run as IN_FLIGHT."""
        np.add.at(self._fates[:, Fate.IN_FLIGHT], links.sender // self._robots, links.receivers)
        np.add.at(self._fates[:, Fate.IN_FLIGHT], queued.sender // self._robots, queued.intended)

    def close(self, arenas: BoolArray | None = None) -> PacketCounts:
        """The counts since the last call; those of `arenas` (arenas,) alone if given."""
        counts = PacketCounts(self._sent, self._intended, self._in_range, self._fates)
        self._open()
        if arenas is None:
            return counts
        others = counts.in_arenas(~arenas)
        self._sent, self._intended = others.sent, others.intended
        self._in_range, self._fates = others.in_range, others.fates
        return counts.in_arenas(arenas)

    def _open(self) -> None:
        self._sent, self._intended, self._in_range = (np.zeros(self._arenas, np.int64) for _ in range(3))
        self._fates = np.zeros((self._arenas, len(Fate)), np.int64)


@njit()
def _count_sent(sender, intended, robots, sent_out, intended_out):
    for p in range(len(sender)):
        sent_out[sender[p] // robots] += 1
        intended_out[sender[p] // robots] += intended[p]


class LivenessHistory:
    """Robots alive by epoch; an epoch begins whenever a robot dies or is revived.

    A broadcast intends the robots that were alive when it was sent.

    Attributes:
        epoch: the present one.
        any_dead: whether any robot was dead in a kept epoch.
    """

    def __init__(self, rows: int) -> None:
        self.epoch, self.any_dead = 0, False
        self._alive: dict[int, BoolArray] = {0: np.ones(rows, np.bool_)}

    def now(self, alive: BoolArray) -> None:
        """The robots `alive` (rows,) are alive from now on."""
        if not np.array_equal(alive, self._alive[self.epoch]):
            self.epoch += 1
            self._alive[self.epoch] = alive.copy()
            self._look()

    def intended(self, epoch: IntArray, receiver: IntArray) -> BoolArray:
        """Whether each robot row `receiver` was alive in its `epoch`, (k,)."""
        is_intended = np.ones(len(receiver), np.bool_)
        for number, alive in self._alive.items():
            if not alive.all():
                in_epoch = epoch == number
                is_intended[in_epoch] = alive[receiver[in_epoch]]
        return is_intended

    def forget(self, queued: IntArray) -> None:
        """Drop the epochs of no queued packet; `queued` holds the epochs of queued packets."""
        if len(self._alive) > 1:
            needed = {self.epoch, *np.unique(queued).tolist()}
            self._alive = {number: alive for number, alive in self._alive.items() if number in needed}
            self._look()

    def _look(self) -> None:
        self.any_dead = not all(alive.all() for alive in self._alive.values())
