"""What keeps robots from sending and hearing, whatever the medium would do."""

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.arrays import BoolArray, IntArray


@dataclass(slots=True)
class Disruption:
    """The state of robots and radios at one time."""

    alive: BoolArray  # (rows,)
    radio_on: BoolArray  # (rows,)
    sides: IntArray  # (partitions, rows) each robot's set in each partition, from 1; 0: in none

    @classmethod
    def none(cls, rows: int) -> "Disruption":
        """All are alive, with radios on, and no one is kept from anyone."""
        return cls(np.ones(rows, np.bool_), np.ones(rows, np.bool_), np.empty((0, rows), np.int64))

    @property
    def anything(self) -> bool:
        """Whether anybody is kept from anything."""
        return len(self.sides) > 0 or not (self.alive.all() and self.radio_on.all())

    def apart(self, a: IntArray, b: IntArray) -> BoolArray:
        """Which pairs of robot rows some partition has in different sets, (k,)."""
        found = np.zeros(len(a), np.bool_)
        for side in self.sides:
            found |= (side[a] != side[b]) & (side[a] > 0) & (side[b] > 0)
        return found
