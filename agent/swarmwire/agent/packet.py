"""Received packets and tx statuses as agents see them: objects for an Agent, columns for a VectorAgent.

The measurements of the radio medium (range, bearing, RSSI) are read only if the agent's `needs` name them.
"""

from abc import ABC, abstractmethod
from bisect import bisect_left, bisect_right
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Generic, TypeVar, cast

import numpy as np

from swarmwire.comms.base.arrays import FloatArray, IntArray
from swarmwire.comms.robot.packets import TAG_BYTES, ReceivedPackets, TxResult

M = TypeVar("M", covariant=True)


@dataclass(frozen=True, slots=True)
class TxStatus:
    """The result of one unicast packet, to the knowledge of the sender's radio."""

    id: int  #: returned by `send`
    result: TxResult

    @property
    def acknowledged(self) -> bool:
        """True if the packet arrived; otherwise it may have arrived while its acknowledgement was lost."""
        return self.result == TxResult.ACKNOWLEDGED


class NotDeclared(AttributeError):
    """An agent reads a sensor or a measurement that its `needs` do not name."""


def undeclared(need: str, needs: tuple[str, ...], owner: str = "") -> NotDeclared:
    """Return the error with the declaration that fixes it; `owner` is a text such as " of a packet"."""
    declared, corrected = ", ".join(needs) or "none", ", ".join(f'"{name}"' for name in (*needs, need))
    comma = "" if needs else ","
    return NotDeclared(
        f"reads {need!r}{owner}, which its needs do not list ({declared}); declare needs = ({corrected}{comma})"
    )


class Columns:
    """The fields of k messages of one class, each a float64 array (k,) under its own name."""

    def __init__(self, fields: dict[str, FloatArray]) -> None:
        self._fields = fields

    def __getattr__(self, name: str) -> FloatArray:
        if name not in self._fields:
            raise AttributeError(f"the message has no field {name!r}; it has {', '.join(self._fields) or 'none'}")
        return self._fields[name]


class Packets(Generic[M]):
    """All packets of one message class that n robots received, k rows sorted by robot, then by time."""

    message: Columns  #: every field of the message under its name, (k,) each

    def __init__(
        self, robots: int, table: ReceivedPackets, fields: dict[str, FloatArray], needs: tuple[str, ...]
    ) -> None:
        self._robots, self._table, self._needs = robots, table, needs
        self.message = Columns(fields)

    def __len__(self) -> int:
        return len(self._table)

    @property
    def row(self) -> IntArray:
        """Row of the receiving robot, 0 to n - 1, rising, (k,)."""
        return self._table.receiver

    @property
    def sender(self) -> IntArray:
        """Index of the sender in the arena, (k,)."""
        return self._table.sender_index

    @property
    def sequence(self) -> IntArray:
        """Number of packets that the sender sent before this one, (k,)."""
        return self._table.sequence

    @property
    def received_at_ns(self) -> IntArray:
        """Time of reception, ns since the start of the run, (k,)."""
        return self._table.received_at_ns

    @property
    def range_m(self) -> FloatArray:
        """Distance in space to the sender when the packet went on air, (k,)."""
        return self._measured("radio.range", "range_m")

    @property
    def bearing_rad(self) -> FloatArray:
        """Direction to the sender in the receiver's frame when the packet went on air, in (-pi, pi], (k,)."""
        return self._measured("radio.bearing", "bearing_rad")

    @property
    def rssi_dbm(self) -> FloatArray:
        """Received signal strength (RSSI), (k,)."""
        return self._measured("radio.rssi", "rssi_dbm")

    def count(self) -> IntArray:
        """Number of packets that each robot received, (n,)."""
        return np.bincount(self.row, minlength=self._robots)

    def sum(self, values: FloatArray) -> FloatArray:
        """Sum of `values` (k,) over the packets of each robot, in their order, (n,)."""
        return cast(FloatArray, np.bincount(self.row, weights=values, minlength=self._robots))

    def _measured(self, need: str, column: str) -> FloatArray:
        return measured_column(self._table, self._needs, need, column)


class ReceivedLists(ABC):
    """The packets of a tick as Python lists, for agents that read them number by number."""

    __slots__ = ("_columns", "_needs")

    def __init__(self, needs: tuple[str, ...]) -> None:
        self._needs = needs
        self._columns: dict[str, list[Any]] = {}

    @abstractmethod
    def payloads(self, row: int, tag: int, size_bytes: int | None = None) -> Iterator[tuple[int, bytes, int, int]]:
        """Yield the payloads of one robot row with a tag and, unless it is None, of this size.

        Each is the index in the table, some bytes, and the start and end of the payload in them.
        """

    @abstractmethod
    def _list(self, name: str) -> list[Any]:
        """Return a column of `ReceivedPackets`, or a measurement in its `measured`."""

    def column(self, name: str) -> list[Any]:
        """Return a column of the table."""
        column = self._columns.get(name)
        if column is None:
            column = self._columns[name] = self._list(name)
        return column

    def measured(self, need: str, name: str) -> list[float]:
        """Return a measurement of the medium; NotDeclared if the agent's needs do not name it."""
        column = self._columns.get(name)
        if column is None:
            require_measure(self._needs, need)
            column = self._columns[name] = self._list(name)
        return column


class ListsOfTable(ReceivedLists):
    """The packets of several robots, from a table."""

    __slots__ = ("_data", "_offset", "_payload", "_receiver", "_table")

    def __init__(self, table: ReceivedPackets, needs: tuple[str, ...]) -> None:
        super().__init__(needs)
        self._table = table
        self._receiver: list[int] = table.receiver.tolist()  # rising
        self._payload: list[int] = table.payload.tolist()
        self._offset: list[int] = table.payloads.offset.tolist()
        self._data = table.payloads.data.tobytes()

    def payloads(self, row: int, tag: int, size_bytes: int | None = None) -> Iterator[tuple[int, bytes, int, int]]:
        """Yield the payloads of one robot row with a tag and, unless it is None, of this size."""
        data, offset = self._data, self._offset
        low, high = tag & 0xFF, tag >> 8
        for index in range(bisect_left(self._receiver, row), bisect_right(self._receiver, row)):
            payload = self._payload[index]
            start, end = offset[payload], offset[payload + 1]
            size = end - start
            fits = size >= TAG_BYTES if size_bytes is None else size == size_bytes
            if fits and data[start] == low and data[start + 1] == high:
                yield index, data, start, end

    def _list(self, name: str) -> list[Any]:
        column = self._table.measured[name] if name in self._table.measured else getattr(self._table, name)
        return column.tolist()


class Packet(Generic[M]):
    """One packet that a robot received."""

    __slots__ = ("_index", "_lists", "message")

    message: M  #: the message, frozen; a dict is a copy

    def __init__(self, lists: ReceivedLists, index: int, message: M) -> None:
        self._lists, self._index, self.message = lists, index, message

    @property
    def sender(self) -> int:
        """Index of the sender in the arena."""
        return self._lists.column("sender_index")[self._index]

    @property
    def sequence(self) -> int:
        """Number of packets that the sender sent before this one."""
        return self._lists.column("sequence")[self._index]

    @property
    def received_at_ns(self) -> int:
        """Time of reception, ns since the start of the run."""
        return self._lists.column("received_at_ns")[self._index]

    @property
    def range_m(self) -> float:
        """Distance in space to the sender when the packet went on air."""
        return self._lists.measured("radio.range", "range_m")[self._index]

    @property
    def bearing_rad(self) -> float:
        """Direction to the sender in this robot's frame when the packet went on air, in (-pi, pi]."""
        return self._lists.measured("radio.bearing", "bearing_rad")[self._index]

    @property
    def rssi_dbm(self) -> float:
        """Received signal strength (RSSI)."""
        return self._lists.measured("radio.rssi", "rssi_dbm")[self._index]


def measured_column(table: ReceivedPackets, needs: tuple[str, ...], need: str, column: str) -> FloatArray:
    """Return a measurement of the medium per packet, (k,); NotDeclared if the agent's needs do not name it."""
    require_measure(needs, need)
    return table.measured[column]


def require_measure(needs: tuple[str, ...], need: str) -> None:
    """Raise NotDeclared if the agent's needs do not name a measurement of the medium."""
    if need not in needs:
        raise undeclared(need, needs, " of a packet")
