"""Packets as agents see them: one object each for an Agent, columns for a VectorAgent."""

from typing import Generic, TypeVar, cast

import numpy as np

from swarmwire.comms.arrays import FloatArray, IntArray
from swarmwire.comms.packets import Heard

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
    """All packets of one message class that n robots heard, k rows sorted by robot, then by time."""

    message: Columns  # every field of the message under its name, (k,) each

    def __init__(self, robots: int, table: Heard, fields: dict[str, FloatArray], needs: tuple[str, ...]) -> None:
        self._robots, self._table, self._needs = robots, table, needs
        self.message = Columns(fields)

    def __len__(self) -> int:
        return len(self._table)

    @property
    def row(self) -> IntArray:
        """The robot that heard it, 0 to n - 1, rising, (k,)."""
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
    def heard_at_ns(self) -> IntArray:
        """When it was heard, ns since the start of the run, (k,)."""
        return self._table.heard_at_ns

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
        """How many packets each robot heard, (n,)."""
        return np.bincount(self.row, minlength=self._robots)

    def sum(self, values: FloatArray) -> FloatArray:
        """The sum of `values` (k,) over the packets of each robot, in their order, (n,)."""
        return cast(FloatArray, np.bincount(self.row, weights=values, minlength=self._robots))

    def _given(self, need: str, column: str) -> FloatArray:
        if need not in self._needs:
            raise NotDeclared(
                f"reads {need!r} of a packet, which its needs do not name: {', '.join(self._needs) or 'none'}"
            )
        return self._table.given[column]


class Packet(Generic[M]):
    """One packet that a robot heard."""

    __slots__ = ("_all", "_at", "message")

    message: M  # what was sent, frozen; of a dict a copy

    def __init__(self, packets: Packets[M], at: int, message: M) -> None:
        self._all, self._at, self.message = packets, at, message

    @property
    def sender(self) -> int:
        """Index of the sender in the arena."""
        return int(self._all.sender[self._at])

    @property
    def sequence(self) -> int:
        """How many packets the sender had sent before this one."""
        return int(self._all.sequence[self._at])

    @property
    def heard_at_ns(self) -> int:
        """When it was heard, ns since the start of the run."""
        return int(self._all.heard_at_ns[self._at])

    @property
    def range_m(self) -> float:
        """Distance to the sender when the packet went on air."""
        return float(self._all.range_m[self._at])

    @property
    def bearing_rad(self) -> float:
        """Direction to the sender in this robot's frame when the packet went on air, in (-pi, pi]."""
        return float(self._all.bearing_rad[self._at])

    @property
    def rssi_dbm(self) -> float:
        """Strength of the received signal."""
        return float(self._all.rssi_dbm[self._at])
