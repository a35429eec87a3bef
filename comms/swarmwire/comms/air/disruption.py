"""What keeps robots from sending and hearing, whatever the medium would do."""

from dataclasses import dataclass, fields

import numpy as np

from swarmwire.comms.air.jammers import Jammers
from swarmwire.comms.arrays import BoolArray, FloatArray, IntArray

# What becomes of the packets that a radio should send while it is off: DROP, they end at the usual pace; NEWEST, the
# newest waits until it is on again; ALL, they wait in its queue.
BACKLOGS = ("drop", "newest", "all")
DROP, NEWEST, ALL = range(3)


@dataclass(slots=True)
class Disruption:
    """The state of robots and radios at one time."""

    alive: BoolArray  # (rows,)
    radio_on: BoolArray  # (rows,)
    backlog: IntArray  # (rows,) DROP, NEWEST or ALL: for when the radio is off
    sides: IntArray  # (partitions, rows) each robot's set in each partition, from 1; 0: in none
    one_way: IntArray  # (partitions, rows) the same, of those in which only the second does not hear the first
    send_gain_db: FloatArray  # (rows,) added to the strength of all that a robot sends
    receive_gain_db: FloatArray  # (rows,) added to the strength of all that a robot hears
    jammers: Jammers

    @classmethod
    def none(cls, rows: int) -> "Disruption":
        """All are alive, with radios on, and no one is kept from anyone."""
        nobody = np.empty((0, rows), np.int64)
        return cls(
            alive=np.ones(rows, np.bool_),
            radio_on=np.ones(rows, np.bool_),
            backlog=np.full(rows, DROP),
            sides=nobody,
            one_way=nobody,
            send_gain_db=np.zeros(rows),
            receive_gain_db=np.zeros(rows),
            jammers=Jammers.none(),
        )

    def become(self, other: "Disruption") -> None:
        """Take over all that holds in another; the arrays are shared."""
        for of in fields(self):
            setattr(self, of.name, getattr(other, of.name))

    @property
    def anything(self) -> bool:
        """Whether anybody is kept from anything."""
        return len(self.sides) + len(self.one_way) > 0 or self.anyone_out

    @property
    def anyone_out(self) -> bool:
        """Whether anybody is dead, or a radio off."""
        return not (self.alive.all() and self.radio_on.all())

    @property
    def backlog_now(self) -> IntArray:
        """What waits at each radio until it is on again, (rows,): NEWEST or ALL; DROP where nothing does."""
        return np.where(self.radio_on | ~self.alive, DROP, self.backlog)

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
