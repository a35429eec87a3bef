"""Annotations by agents: numbers and named states of robots, for observers, without any effect on the run."""

import numpy as np

from swarmwire.comms.base.arrays import BoolArray, FloatArray, IntArray
from swarmwire.comms.robot.tick_io import MAX_STATES, SparseTable


class LatestValues:
    """The latest number that each robot noted. `value` is replaced when it changes, never written to.

    Attributes:
        value: (rows,) NaN: no number from this robot; None: no number from any robot.
    """

    def __init__(self) -> None:
        self.value: FloatArray | None = None

    def update(self, noted: SparseTable, alive: BoolArray) -> None:
        """Store the numbers of a tick of robots `alive` (rows,)."""
        valid = alive[noted.rows]
        if valid.any():
            self.value = np.full(len(alive), np.nan) if self.value is None else self.value.copy()
            self.value[noted.rows[valid]] = noted.value[valid]

    def clear(self, rows: BoolArray) -> None:
        """Clear the numbers of these robots (rows,)."""
        if self.value is not None and rows.any():
            self.value = np.where(rows, np.nan, self.value)


NEW, OVER_LIMIT = -1, -2  # codes of a name without a code yet, and of a name beyond MAX_STATES


class States:
    """The state of each robot row. `code` is replaced when it changes, never written to.

    Attributes:
        code: (rows,) index in `names`; 0: no state.
        names: the states in the order of their first use, within a tick that of the robots; the first is "".
        dropped: (arenas,) number of uses of states beyond the limit of an arena.
    """

    def __init__(self, arenas: int, robots: int) -> None:
        self.code: IntArray = np.zeros(arenas * robots, np.int64)
        self.names: tuple[str, ...] = ("",)
        self.dropped: IntArray = np.zeros(arenas, np.int64)
        self._robots = robots
        self._used: BoolArray = np.ones((arenas, 1), np.bool_)  # (arenas, names) states that each arena has used

    def update(self, notes: SparseTable, alive: BoolArray) -> None:
        """Store the states of a tick of robots `alive` (rows,)."""
        if not len(notes):
            return
        order = np.argsort(notes.rows)
        order = order[alive[notes.rows[order]]]
        rows = notes.rows[order]
        arena = rows // self._robots
        code = self._codes(arena, notes.integers[order], notes.names)
        valid = code != OVER_LIMIT
        np.add.at(self.dropped, arena[~valid], 1)
        self.code = self.code.copy()
        self.code[rows[valid]] = code[valid]

    def clear(self, rows: BoolArray) -> None:
        """Clear the states of these robots (rows,)."""
        if rows.any():
            self.code = np.where(rows, 0, self.code)

    def _codes(self, arena: IntArray, local: IntArray, names: tuple[str, ...]) -> IntArray:
        """Return the codes of names[local] in these arenas, (k,) each; new codes are in the order of first use."""
        codes = {name: code for code, name in enumerate(self.names)}
        code: IntArray = np.array([codes.get(name, NEW) for name in names], np.int64)[local]
        for k in np.flatnonzero((code == NEW) | ~self._used[arena, code]).tolist():
            code[k] = self._code(int(arena[k]), names[int(local[k])])
        return code

    def _code(self, arena: int, name: str) -> int:
        """Return the code of a state in an arena, which may use it for the first time."""
        is_new = name not in self.names
        if not is_new and self._used[arena, self.names.index(name)]:
            return self.names.index(name)
        if self._used[arena].sum() > MAX_STATES:  # a limit per arena: an arena is the same alone and among others
            return OVER_LIMIT
        if is_new:
            self.names = (*self.names, name)
            self._used = np.pad(self._used, ((0, 0), (0, 1)))
        self._used[arena, self.names.index(name)] = True
        return self.names.index(name)
