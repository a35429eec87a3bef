"""How what agents remember goes over the wire: arrays `memory/{group}/{column}`, beside `memory/{group}/rows`."""

from collections.abc import Mapping

from swarmwire.comms.arrays import AnyArray, IntArray
from swarmwire.comms.errors import BadFrame
from swarmwire.comms.memory import GroupMemory, Layout, Memory
from swarmwire.comms.wire import frames
from swarmwire.comms.wire.checked import checked_array
from swarmwire.comms.wire.frames import Frame

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
