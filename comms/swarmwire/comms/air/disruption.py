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
    one_way: IntArray  # (partitions, rows) the same, of those in which only the second does not hear the first

    @classmethod
    def none(cls, rows: int) -> "Disruption":
        """All are alive, with radios on, and no one is kept from anyone."""
        nobody = np.empty((0, rows), np.int64)
        return cls(np.ones(rows, np.bool_), np.ones(rows, np.bool_), nobody, nobody.copy())

    @property
    def anything(self) -> bool:
        """Whether anybody is kept from anything."""
        return len(self.sides) + len(self.one_way) > 0 or not (self.alive.all() and self.radio_on.all())

    def apart(self, sender: IntArray, receiver: IntArray) -> BoolArray:
        """From which senders some partition keeps which receivers, pairs of robot rows, (k,)."""
        found = np.zeros(len(sender), np.bool_)
        for side in self.sides:
            found |= (side[sender] != side[receiver]) & (side[sender] > 0) & (side[receiver] > 0)
        for side in self.one_way:
            found |= (side[sender] == 1) & (side[receiver] == 2)
        return found

    def joined(self, a: IntArray, b: IntArray) -> BoolArray:
        """Which pairs of robot rows have radios that are on, and no partition between them either way, (k,)."""
        return self.radio_on[a] & self.radio_on[b] & ~self.apart(a, b) & ~self.apart(b, a)
