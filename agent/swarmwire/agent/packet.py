"""What an Agent's radio tells of a packet that it is done with."""

from bisect import bisect_left, bisect_right
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Generic, TypeVar, cast

import numpy as np

from swarmwire.comms.arrays import FloatArray, IntArray
from swarmwire.comms.packets import TAG_BYTES, ReceivedPackets, TxResult


@dataclass(frozen=True, slots=True)
class TxStatus:
    """One addressed packet whose fate the sender's radio knows, as far as it can."""

    id: int  # that `send` returned
    result: TxResult

    @property
    def acknowledged(self) -> bool:
        """Whether it arrived for certain; if not, it may have arrived all the same, and its acknowledgement not."""
        return self.result == TxResult.ACKNOWLEDGED


# --- Packets as agents see them: one object each for an Agent, columns for a VectorAgent.


M = TypeVar("M", covariant=True)


class NotDeclared(AttributeError):
    """An agent reads what its `needs` do not name, or what its body or radio does not give."""


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

    message: Columns  # every field of the message under its name, (k,) each

    def __init__(
        self, robots: int, table: ReceivedPackets, fields: dict[str, FloatArray], needs: tuple[str, ...]
    ) -> None:
        self._robots, self._table, self._needs = robots, table, needs
        self.message = Columns(fields)

    def __len__(self) -> int:
        return len(self._table)

    @property
    def row(self) -> IntArray:
        """The robot that received it, 0 to n - 1, rising, (k,)."""
        return self._table.receiver

    @property
    def sender(self) -> IntArray:
        """Index of the sender in the arena, (k,)."""
        return self._table.sender

    @property
    def sequence(self) -> IntArray:
        """How many packets the sender had sent before this one, (k,)."""
        return self._table.sequence

    @property
    def received_at_ns(self) -> IntArray:
        """When it was received, ns since the start of the run, (k,)."""
        return self._table.received_at_ns

    @property
    def range_m(self) -> FloatArray:
        """Distance to the sender when the packet went on air, (k,)."""
        return self._given("radio.range", "range_m")

    @property
    def bearing_rad(self) -> FloatArray:
        """Direction to the sender in the receiver's frame when the packet went on air, in (-pi, pi], (k,)."""
        return self._given("radio.bearing", "bearing_rad")

    @property
    def rssi_dbm(self) -> FloatArray:
        """Strength of the received signal, (k,)."""
        return self._given("radio.rssi", "rssi_dbm")

    def count(self) -> IntArray:
        """How many packets each robot received, (n,)."""
        return np.bincount(self.row, minlength=self._robots)

    def sum(self, values: FloatArray) -> FloatArray:
        """The sum of `values` (k,) over the packets of each robot, in their order, (n,)."""
        return cast(FloatArray, np.bincount(self.row, weights=values, minlength=self._robots))

    def _given(self, need: str, column: str) -> FloatArray:
        return given_column(self._table, self._needs, need, column)


class ReceivedLists:
    """What the robots of a tick received, as Python's own lists: for agents that read it number by number."""

    __slots__ = ("_columns", "_data", "_needs", "_offset", "_payload", "_receiver", "_table")

    def __init__(self, table: ReceivedPackets, needs: tuple[str, ...]) -> None:
        self._table, self._needs = table, needs
        self._receiver: list[int] = table.receiver.tolist()
        self._payload: list[int] = table.payload.tolist()
        self._offset: list[int] = table.payloads.offset.tolist()
        self._data = table.payloads.data.tobytes()
        self._columns: dict[str, list[Any]] = {}

    def payloads(self, row: int, tag: int, size_bytes: int | None = None) -> Iterator[tuple[int, bytes, int, int]]:
        """What the robot of a row (rising) received with a tag and, if given, of this size.

        Each as its place, and the bytes with the span in which it stands.
        """
        data, offset = self._data, self._offset
        low, high = tag & 0xFF, tag >> 8
        for at in range(bisect_left(self._receiver, row), bisect_right(self._receiver, row)):
            payload = self._payload[at]
            start, end = offset[payload], offset[payload + 1]
            size = end - start
            fits = size >= TAG_BYTES if size_bytes is None else size == size_bytes
            if fits and data[start] == low and data[start + 1] == high:
                yield at, data, start, end

    def column(self, name: str) -> list[Any]:
        """A column of the table."""
        known = self._columns.get(name)
        if known is None:
            known = self._columns[name] = getattr(self._table, name).tolist()
        return known

    def given(self, need: str, name: str) -> list[float]:
        """What the medium tells; NotDeclared if the agent's needs do not name it."""
        known = self._columns.get(name)
        if known is None:
            known = self._columns[name] = given_column(self._table, self._needs, need, name).tolist()
        return known


class Packet(Generic[M]):
    """One packet that a robot received."""

    __slots__ = ("_all", "_at", "message")

    message: M  # what was sent, frozen; of a dict a copy

    def __init__(self, received: ReceivedLists, at: int, message: M) -> None:
        self._all, self._at, self.message = received, at, message

    @property
    def sender(self) -> int:
        """Index of the sender in the arena."""
        return self._all.column("sender")[self._at]

    @property
    def sequence(self) -> int:
        """How many packets the sender had sent before this one."""
        return self._all.column("sequence")[self._at]

    @property
    def received_at_ns(self) -> int:
        """When it was received, ns since the start of the run."""
        return self._all.column("received_at_ns")[self._at]

    @property
    def range_m(self) -> float:
        """Distance to the sender when the packet went on air."""
        return self._all.given("radio.range", "range_m")[self._at]

    @property
    def bearing_rad(self) -> float:
        """Direction to the sender in this robot's frame when the packet went on air, in (-pi, pi]."""
        return self._all.given("radio.bearing", "bearing_rad")[self._at]

    @property
    def rssi_dbm(self) -> float:
        """Strength of the received signal."""
        return self._all.given("radio.rssi", "rssi_dbm")[self._at]


def given_column(table: ReceivedPackets, needs: tuple[str, ...], need: str, column: str) -> FloatArray:
    """What the medium tells of packets, (k,); NotDeclared if an agent's needs do not name it."""
    if need not in needs:
        raise NotDeclared(f"reads {need!r} of a packet, which its needs do not name: {', '.join(needs) or 'none'}")
    return table.given[column]
