"""The memory of agents, which a world keeps for the next runner of their robots.

Frames carry it as the arrays `memory/{group}/rows` and `memory/{group}/{column}`.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from swarmwire.comms.base.arrays import AnyArray, IntArray
from swarmwire.comms.base.errors import BadFrame
from swarmwire.comms.wire import frames
from swarmwire.comms.wire.frames import Frame, checked_array

PREFIX = "memory/"
ROWS = "rows"

Layout = Mapping[str, tuple[str, tuple[int, ...]]]  # column: dtype code of frames, and shape without the rows


@dataclass(frozen=True, slots=True)
class GroupMemory:
    """The memory of the agents of robots of one group."""

    rows: IntArray  # (n,) robot row, rising
    columns: Mapping[str, AnyArray]  # (n,) or (n, width)

    def for_rows(self, rows: IntArray) -> "GroupMemory":
        """Return the memory of the robots with these rows; rows without memory are left out."""
        selected = np.isin(self.rows, rows)
        return GroupMemory(self.rows[selected], {name: column[selected] for name, column in self.columns.items()})

    def updated(self, newest: "GroupMemory") -> "GroupMemory":
        """Return this memory with the robots in `newest` replaced."""
        older = self.rows[~np.isin(self.rows, newest.rows)]
        return GroupMemory.joined([self.for_rows(older), newest]) if len(older) else newest

    def fits(self, layout: Layout) -> bool:
        """Return True if the columns have this layout."""
        columns = {name: (column.dtype.str, column.shape[1:]) for name, column in self.columns.items()}
        return columns == {name: (code, tuple(shape)) for name, (code, shape) in layout.items()}

    @classmethod
    def joined(cls, parts: "list[GroupMemory]") -> "GroupMemory":
        """Return the memory of all parts, sorted by row; all parts have the same columns."""
        rows = np.concatenate([part.rows for part in parts])
        order = np.argsort(rows)
        names = parts[0].columns
        return cls(rows[order], {name: np.concatenate([part.columns[name] for part in parts])[order] for name in names})


GroupMemories = dict[str, GroupMemory]  # name of the group: memory of its robots


def memory_arrays(memory: GroupMemories) -> dict[str, AnyArray]:
    """Return the memory as arrays of a frame."""
    arrays: dict[str, AnyArray] = {}
    for name, group in memory.items():
        arrays[f"{PREFIX}{name}/{ROWS}"] = group.rows
        for column, values in group.columns.items():
            arrays[f"{PREFIX}{name}/{column}"] = values
    return arrays


def encode_memory(memory: GroupMemories) -> bytes:
    """Encode a `memory` frame: the memory that the robots of a runner have from earlier runners."""
    return frames.encode("memory", -1, memory_arrays(memory))


def decode_memory(
    frame: Frame, layouts: Mapping[str, Layout], rows: Mapping[str, IntArray] | None = None
) -> GroupMemories:
    """Decode the memory in a frame, of groups with these layouts; BadFrame if an array does not fit.

    With `rows`, by group, memory of other robots is refused; a group may have none.
    """
    memory: GroupMemories = {}
    for name, layout in layouts.items():
        key = f"{PREFIX}{name}/"
        if key + ROWS not in frame.arrays:
            continue
        group_rows = checked_array(frame, key + ROWS, "<i8", (None,))
        if rows is not None and (name not in rows or not np.isin(group_rows, rows[name]).all()):
            raise BadFrame("malformed", f"{key}{ROWS}: expected the runner's own robots")
        if (group_rows[1:] <= group_rows[:-1]).any():
            raise BadFrame("malformed", f"{key}{ROWS}: expected rising rows")
        columns = {
            column: checked_array(frame, key + column, code, (len(group_rows), *shape))
            for column, (code, shape) in layout.items()
        }
        memory[name] = GroupMemory(group_rows, columns)
    return memory
