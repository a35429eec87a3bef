"""What robots are told of the radio: packets heard, and outcomes of their own."""

from typing import NamedTuple

import numpy as np

from swarmwire.comms.arrays import IntArray
from swarmwire.comms.packets import Heard, Outcomes


class Told(NamedTuple):
    """Packets heard and outcomes, in the orders that these promise; true if there is any."""

    heard: Heard
    outcomes: Outcomes

    def __bool__(self) -> bool:
        return bool(len(self.heard) or len(self.outcomes))

    def followed_by(self, other: "Told") -> "Told":
        """Both together."""
        return Told(Heard.joined([self.heard, other.heard]), Outcomes.joined([self.outcomes, other.outcomes]))

    def of(self, rows: IntArray) -> "Told":
        """What is for these robot rows, (n,), rising."""
        return self.parted(rows)[0]

    def parted(self, rows: IntArray) -> "tuple[Told, Told]":
        """What is for these robot rows, (n,), and what is for others."""
        heard, told = np.isin(self.heard.receiver, rows), np.isin(self.outcomes.row, rows)
        if heard.all() and told.all():
            return self, Told(self.heard.select(NONE), self.outcomes.select(NONE))
        ours, theirs = (
            Told(self.heard.select(np.flatnonzero(h)).compacted(), self.outcomes.select(np.flatnonzero(o)))
            for h, o in ((heard, told), (~heard, ~told))
        )
        return ours, theirs


NONE = np.empty(0, np.int64)
