"""What became of packets on each link: a count for each sender, receiver and fate that occurred together."""

import numpy as np

from swarmwire.comms.arrays import IntArray
from swarmwire.comms.packets import FATE_NAMES
from swarmwire.comms.truth import NO_ROBOT, ReceptionRecords, Static

FATES = len(FATE_NAMES)
WAITING_ROWS = 250_000  # before they are added up


class LinkCounts:
    """Packets counted by (arena, sender, receiver, fate); memory grows with the links that occurred, not with time."""

    def __init__(self, static: Static) -> None:
        self._robots = static.robots
        self._key: IntArray = np.zeros(0, np.int64)  # rising
        self._packets: IntArray = np.zeros(0, np.int64)
        self._waiting: list[IntArray] = []
        self._rows = 0

    def see(self, finished: ReceptionRecords) -> None:
        """Add the links that ended in a tick."""
        rows = np.flatnonzero(finished.receiver != NO_ROBOT)
        link = (finished.arena[rows] * self._robots + finished.sender[rows]) * self._robots + finished.receiver[rows]
        self._waiting.append(link * FATES + finished.fate[rows])
        self._rows += len(rows)
        if self._rows >= WAITING_ROWS:
            self._add_up()

    def columns(self) -> dict[str, IntArray]:
        """arena, sender, receiver, fate and packets, a row per combination that occurred, in that order."""
        self._add_up()
        link, fate = np.divmod(self._key, FATES)
        row, receiver = np.divmod(link, self._robots)
        arena, sender = np.divmod(row, self._robots)
        return {"arena": arena, "sender": sender, "receiver": receiver, "fate": fate, "packets": self._packets}

    def _add_up(self) -> None:
        """Sort what waits and merge it in: so often that sorting costs little, so seldom that merging does."""
        new, counts = np.unique(np.concatenate([np.zeros(0, np.int64), *self._waiting]), return_counts=True)
        self._waiting, self._rows = [], 0
        self._key, place = np.unique(np.concatenate([self._key, new]), return_inverse=True)
        packets = np.zeros(len(self._key), np.int64)
        np.add.at(packets, place, np.concatenate([self._packets, counts]))
        self._packets = packets
