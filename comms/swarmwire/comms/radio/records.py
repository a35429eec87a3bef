"""Tables that the radio medium reports in each tick.

`ReceptionRecords` has a row per link, `TransmissionRecords` a row per packet, `PacketCounts` a row per arena.
"""

from collections.abc import Sequence
from dataclasses import fields, replace
from typing import Any

import numpy as np

from swarmwire.comms.base.arrays import BoolArray, FloatArray, IntArray
from swarmwire.comms.base.tick_record import tick_record
from swarmwire.comms.robot.packets import Payloads, offsets

# `TransmissionRecords.fate` of a packet that went on air; each of its receivers has a fate of its own.
ON_AIR = 0


@tick_record
class ReceptionRecords:
    """Links whose fate became final since the last tick: a row per (packet, receiver it might have reached).

    A packet that never went on air (queue full, too large, sender dead, its radio off) has one row, with receiver
    NO_ROBOT.
    Receivers out of range appear in `PacketCounts` only.
    """

    arena: IntArray  #: (k,)
    sender: IntArray  #: (k,) index in the arena
    receiver: IntArray  #: (k,) index in the arena; NO_ROBOT: all intended receivers
    receivers: IntArray  #: (k,) number of intended receivers in this row: 1, or all of them
    to: IntArray  #: (k,) index in the arena of the addressed robot, or BROADCAST
    sequence: IntArray  #: (k,)
    sent_at_ns: IntArray  #: (k,)
    on_air_at_ns: IntArray  #: (k,)
    final_at_ns: IntArray  #: (k,) time at which the fate became final, see `RadioMedium`
    fate: IntArray  #: (k,) a Fate
    size_bytes: IntArray  #: (k,) payload with its tag
    tag: IntArray  #: (k,) tag of the message's class
    rssi_dbm: FloatArray | None = None  #: (k,) power at the receiver; None: the radio model has none
    payload: IntArray | None = None  #: (k,) row of `payloads`; None: not recorded
    payloads: Payloads | None = None

    def in_arenas(self, arenas: BoolArray) -> "ReceptionRecords":
        """Return the links of the selected arenas (arenas,)."""
        index = np.flatnonzero(arenas[self.arena])
        columns = {name: column[index] for name, column in _columns(self).items()}
        return replace(self, **columns)

    @classmethod
    def joined(cls, parts: "list[ReceptionRecords]") -> "ReceptionRecords":
        """Return the links of all parts, one or more; all have the same optional columns."""
        filled = [part for part in parts if len(part.arena)]
        if len(filled) < 2:
            return filled[0] if filled else parts[0]
        columns = _joined_columns(filled)
        if all(part.payload is not None and part.payloads is not None for part in filled):
            tables = [part.payloads for part in filled if part.payloads is not None]
            first = offsets(np.array([len(table) for table in tables]))
            columns["payload"] += np.repeat(first[:-1], [len(part.arena) for part in filled])
            return replace(filled[0], **columns, payloads=Payloads.joined(tables))
        return replace(filled[0], **columns)


@tick_record
class TransmissionRecords:
    """Packets whose transmission ended since the last tick, a row each: they came off air, or never went on air.

    The times of a packet that was retransmitted are those of one attempt.
    """

    arena: IntArray  #: (k,)
    sender: IntArray  #: (k,) index in the arena
    to: IntArray  #: (k,) index in the arena of the addressed robot, or BROADCAST
    sequence: IntArray  #: (k,)
    intended: IntArray  #: (k,) number of intended receivers
    out_of_range: IntArray  #: (k,) number of these that were out of range; 0 if the packet was never on air
    fate: IntArray  #: (k,) ON_AIR, or the Fate of a packet that never went on air
    on_air_at_ns: IntArray  #: (k,)
    off_air_at_ns: IntArray  #: (k,) equal to on_air_at_ns if the packet was never on air

    def in_arenas(self, arenas: BoolArray) -> "TransmissionRecords":
        """Return the packets of the selected arenas (arenas,)."""
        index = np.flatnonzero(arenas[self.arena])
        return TransmissionRecords(**{name: column[index] for name, column in _columns(self).items()})

    @classmethod
    def joined(cls, parts: "list[TransmissionRecords]") -> "TransmissionRecords":
        """Return the packets of all parts, one or more."""
        return cls(**_joined_columns([part for part in parts if len(part.arena)] or parts[:1]))


def _columns(table: ReceptionRecords | TransmissionRecords) -> dict[str, Any]:
    """Return the arrays of a table by name, without those that are None; `payloads` is no array."""
    columns = ((field.name, getattr(table, field.name)) for field in fields(table) if field.name != "payloads")
    return {name: column for name, column in columns if column is not None}


def _joined_columns(tables: Sequence[ReceptionRecords] | Sequence[TransmissionRecords]) -> dict[str, Any]:
    """Return the concatenated arrays of tables with the same columns, by name."""
    return {name: np.concatenate([getattr(table, name) for table in tables]) for name in _columns(tables[0])}


@tick_record
class PacketCounts:
    """Packets counted since the last tick, a row per arena; over a run the fates add up to the intended receivers."""

    sent: IntArray  #: (arenas,) packets handed to the radio
    intended: IntArray  #: (arenas,) intended receivers of these packets
    in_range: IntArray  #: (arenas,) receivers in range, see `Fate`, of the fates that became final
    fates: IntArray  #: (arenas, fates) fates that became final

    def __add__(self, other: "PacketCounts") -> "PacketCounts":
        """Return the sums of both."""
        return PacketCounts(
            self.sent + other.sent,
            self.intended + other.intended,
            self.in_range + other.in_range,
            self.fates + other.fates,
        )

    def in_arenas(self, arenas: BoolArray) -> "PacketCounts":
        """Return the counts of the selected arenas (arenas,), and 0 in the others."""
        return PacketCounts(
            self.sent * arenas, self.intended * arenas, self.in_range * arenas, self.fates * arenas[:, None]
        )
