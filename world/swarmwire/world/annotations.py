"""Annotations by agents: numbers and named states of robots, kept for observers without any effect on the run."""

import numpy as np

from swarmwire.comms.base.arrays import BoolArray, FloatArray, IntArray
from swarmwire.comms.robot.tick_io import MAX_STATES, SparseTable


class LatestValues:
    """The number that each robot noted last. `value` is replaced when it changes, never written to.

    Attributes:
        value: (rows,) NaN: the robot has noted none; None: no robot ever has.
    """

    def __init__(self) -> None:
        self.value: FloatArray | None = None

    def take(self, noted: SparseTable, alive: BoolArray) -> None:
        """Keep the numbers of a tick of robots `alive` (rows,)."""
        here = alive[noted.rows]
        if here.any():
            self.value = np.full(len(alive), np.nan) if self.value is None else self.value.copy()
            self.value[noted.rows[here]] = noted.value[here]

    def forget(self, rows: BoolArray) -> None:
        """Clear the numbers of these robots (rows,)."""
        if self.value is not None and rows.any():
            self.value = np.where(rows, np.nan, self.value)


ONE_TOO_MANY = -1


class States:
    """The state of each robot row. `code` is replaced when it changes, never written to.

    Attributes:
        code: (rows,) a place in `names`; 0: the agent has named nothing.
        names: the states, in the order in which they were first named, in a tick that of the robots; first comes "".
        dropped: (arenas,) how often a state was named that was one too many in its arena.
    """

    def __init__(self, arenas: int, robots: int) -> None:
        self.code: IntArray = np.zeros(arenas * robots, np.int64)
        self.names: tuple[str, ...] = ("",)
        self.dropped: IntArray = np.zeros(arenas, np.int64)
        self._robots = robots
        self._named: BoolArray = np.ones((arenas, 1), np.bool_)  # (arenas, names) which each arena knows

    def take(self, notes: SparseTable, alive: BoolArray) -> None:
        """Take down what robots named in a tick; only those `alive` (rows,) name anything."""
        if not len(notes):
            return
        order = np.argsort(notes.rows)
        order = order[alive[notes.rows[order]]]
        rows = notes.rows[order]
        arena = rows // self._robots
        place = self._places(arena, notes.integers[order], notes.names)
        kept = place != ONE_TOO_MANY
        np.add.at(self.dropped, arena[~kept], 1)
        self.code = self.code.copy()
        self.code[rows[kept]] = place[kept]

    def forget(self, rows: BoolArray) -> None:
        """These robots (rows,) have named nothing."""
        if rows.any():
            self.code = np.where(rows, 0, self.code)

    def _places(self, arena: IntArray, local: IntArray, names: tuple[str, ...]) -> IntArray:
        """The place here of names[local], (k,), as named in these arenas (k,), new ones in the order of first use."""
        known = {name: place for place, name in enumerate(self.names)}
        place: IntArray = np.array([known.get(name, -1) for name in names], np.int64)[local]
        for at in np.flatnonzero((place < 0) | ~self._named[arena, place]).tolist():
            place[at] = self._place(int(arena[at]), names[int(local[at])])
        return place

    def _place(self, arena: int, name: str) -> int:
        """The place of a state that is named in an arena, be it for the first time."""
        is_new = name not in self.names
        if not is_new and self._named[arena, self.names.index(name)]:
            return self.names.index(name)
        if self._named[arena].sum() > MAX_STATES:  # each arena has its own limit: beside others it is as alone
            return ONE_TOO_MANY
        if is_new:
            self.names = (*self.names, name)
            self._named = np.pad(self._named, ((0, 0), (0, 1)))
        self._named[arena, self.names.index(name)] = True
        return self.names.index(name)
