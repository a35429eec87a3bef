"""What robots are at, as their agents name it: kept for observers, without any effect on the run."""

from typing import cast

import numpy as np

from swarmwire.comms.arrays import BoolArray, IntArray
from swarmwire.comms.notes import MOST_STATES, Notes


class States:
    """The state of each robot row. `code` is replaced when it changes, never written to.

    Attributes:
        code: (rows,) a place in `names`; 0: the agent has named nothing.
        names: the states, in the order in which they were first named, in a tick that of the robots; first comes "".
        dropped: how often a state was named that was one too many.
    """

    def __init__(self, rows: int) -> None:
        self.code: IntArray = np.zeros(rows, np.int64)
        self.names: tuple[str, ...] = ("",)
        self.dropped = 0

    def take(self, notes: Notes, alive: BoolArray) -> None:
        """Take down what robots named in a tick; only those `alive` (rows,) name anything."""
        if not len(notes):
            return
        order = np.argsort(notes.rows)
        order = order[alive[notes.rows[order]]]
        rows, local = notes.rows[order], notes.code[order]
        place = self._places(local, notes.names)[local]
        kept = place >= 0
        self.dropped += int(np.count_nonzero(~kept))
        self.code = self.code.copy()
        self.code[rows[kept]] = place[kept]

    def forget(self, rows: BoolArray) -> None:
        """These robots (rows,) have named nothing."""
        if rows.any():
            self.code = np.where(rows, 0, self.code)

    def _places(self, local: IntArray, names: tuple[str, ...]) -> IntArray:
        """The place of each of these names here, (names,), new ones in the order of first use; -1: one too many."""
        known = {name: place for place, name in enumerate(self.names)}
        places = np.full(len(names), -1)
        used, first = np.unique(local, return_index=True)
        for code in cast("list[int]", used[np.argsort(first)].tolist()):
            if len(known) <= MOST_STATES:
                known.setdefault(names[code], len(known))
            places[code] = known.get(names[code], -1)
        self.names = tuple(known)
        return places
