"""What the agents of robots remember, as it is kept for whoever plays these robots next."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from swarmwire.comms.arrays import AnyArray, IntArray
from swarmwire.comms.errors import BadFrame
from swarmwire.comms.wire import frames
from swarmwire.comms.wire.frames import Frame, checked_array

Layout = Mapping[str, tuple[str, tuple[int, ...]]]  # of each column: dtype, as in frames, and shape without the rows


@dataclass(frozen=True, slots=True)
class GroupMemory:
    """What is remembered of some robots of one group."""

    rows: IntArray  # (n,) robot row, rising
    columns: Mapping[str, AnyArray]  # (n,) or (n, width)

    def of(self, rows: IntArray) -> "GroupMemory":
        """What is remembered of these robots alone, as far as it is."""
        mine = np.isin(self.rows, rows)
        return GroupMemory(self.rows[mine], {name: column[mine] for name, column in self.columns.items()})

    @classmethod
    def joined(cls, parts: "list[GroupMemory]") -> "GroupMemory":
        """What is remembered of the robots of all parts, which are of one layout."""
        rows = np.concatenate([part.rows for part in parts])
        order = np.argsort(rows)
        names = parts[0].columns
        return cls(rows[order], {name: np.concatenate([part.columns[name] for part in parts])[order] for name in names})


Memory = dict[str, GroupMemory]  # by group


# --- How what agents remember goes over the wire: arrays `memory/{group}/{column}`, beside `memory/{group}/rows`.


PREFIX = "memory/"
ROWS = "rows"


def memory_arrays(memory: Memory) -> dict[str, AnyArray]:
    """The arrays of a frame that carry the memory."""
    arrays: dict[str, AnyArray] = {}
    for name, group in memory.items():
        arrays[f"{PREFIX}{name}/{ROWS}"] = group.rows
        for column, values in group.columns.items():
            arrays[f"{PREFIX}{name}/{column}"] = values
    return arrays


def encode_memory(memory: Memory) -> bytes:
    """A `memory` frame: what earlier agents of a runner's robots remembered."""
    return frames.encode("memory", -1, memory_arrays(memory))


def decode_memory(frame: Frame, layouts: Mapping[str, Layout], rows: Mapping[str, IntArray] | None = None) -> Memory:
    """The memory that a frame carries, of groups of these layouts; BadFrame if it fits none.

    With `rows`, by group, it must be that of exactly these robots, and there may be none.
    """
    memory: Memory = {}
    for name, layout in layouts.items():
        key = f"{PREFIX}{name}/"
        if key + ROWS not in frame.arrays:
            continue
        own = checked_array(frame, key + ROWS, "<i8", (None,))
        if rows is not None and (name not in rows or len(own) != len(rows[name]) or (own != rows[name]).any()):
            raise BadFrame("malformed", f"{key}{ROWS}: expected the runner's own robots")
        if (own[1:] <= own[:-1]).any():
            raise BadFrame("malformed", f"{key}{ROWS}: expected rising rows")
        columns = {
            column: checked_array(frame, key + column, code, (len(own), *shape))
            for column, (code, shape) in layout.items()
        }
        memory[name] = GroupMemory(own, columns)
    return memory
