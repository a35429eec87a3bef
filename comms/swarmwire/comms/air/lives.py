"""Who was alive when a packet was sent: those are the receivers that a broadcast intends."""

import numpy as np

from swarmwire.comms.arrays import BoolArray, IntArray


class Lives:
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
