"""Packets as tables: payloads, sent and received packets, their fates, and the transmit statuses of their senders.

Agents hand `SentPackets` to the radio medium and get `ReceivedPackets`. For every intended receiver a packet ends in
exactly one `Fate`. The sender of a unicast packet may also get a `TxStatuses` row: the result at its own radio, which
is less than the fate.
"""

from dataclasses import replace
from itertools import accumulate

import numpy as np

from swarmwire.comms.base.arrays import BoolArray, ByteArray, FloatArray, IntArray
from swarmwire.comms.base.config import ExplainedEnum
from swarmwire.comms.base.sentinels import NO_TAG, NO_TX_STATUS
from swarmwire.comms.base.tick_record import tick_record

TAG_BYTES = 2  # the tag at the start of a payload identifies the class of its message


class Fate(ExplainedEnum):
    """The final state of a packet at one intended receiver; a member's value is its column in `PacketCounts.fates`.

    A receiver is within reach if it is at most `range_m` away (unit disk), or if the mean power there, after path loss,
    shadowing and walls, is at least the sensitivity, or it received the packet all the same (PHY). A trace may put
    links without values out of reach. A receiver is in range if it is within reach and not BLOCKED.
    """

    RECEIVED = 0, "reached the receiver"
    OUT_OF_RANGE = 1, "the receiver was out of the radio's reach when the packet went on air"
    BLOCKED = 2, "an obstacle stood in the line of sight"
    LOST = 3, "within reach, but lost by the medium's fixed loss, or a trace's delivery ratio"
    QUEUE_FULL = 4, "the sender's queue was full, or it waited there too long: never on air"
    TOO_LARGE = 5, "above the medium's largest payload: never on air"
    IN_FLIGHT = 6, "queued or on its way when the run ended"
    SENDER_DEAD = 7, "the sender died before the packet went on air"
    RECEIVER_DEAD = 8, "within reach, but dead when the packet went on air, or before it was handed over"
    BLACKOUT = 9, "the sender's radio was off, or that of a receiver within reach"
    PARTITIONED = 10, "within reach, but a partition kept the two apart when the packet went on air"
    TOO_WEAK = 11, "within reach on average, but too weak for the receiver's noise when the packet was on air"
    COLLIDED = 12, "other packets disturbed it, or the receiver was receiving another or sending"
    BURST = 13, "lost by a burst, while the link was in its bad state"
    CHANNEL_BUSY = 14, "the sender found the medium busy each time it listened: never on air"
    JAMMED = 15, "a jammer disturbed it: without the jammer it would have been received"
    DUTY_CYCLE = 16, "the sender would have exceeded its airtime of an hour: never on air"
    NOT_LISTENING = 17, "the receiver's scanner was off or on another channel while the packet was on air"


FATE_NAMES = tuple(fate.name.lower() for fate in Fate)  # names in summaries and tables, by value


@tick_record
class Payloads:
    """A table of encoded messages: row p is data[offset[p]:offset[p + 1]] and starts with the message's tag."""

    data: ByteArray  #: (bytes,)
    offset: IntArray  #: (rows + 1,), starts at 0, never falls

    def __len__(self) -> int:
        return len(self.offset) - 1

    @property
    def sizes(self) -> IntArray:
        """Size of each row in bytes, tag included, (rows,)."""
        return self.offset[1:] - self.offset[:-1]

    def tags(self) -> IntArray:
        """The 2-byte tag of each row as a number, (rows,); NO_TAG for a row that is too short to have one."""
        has_tag = self.sizes >= TAG_BYTES
        if has_tag.all():
            return self._tags_at(self.offset[:-1])
        tags = np.full(len(self), NO_TAG, np.int64)
        tags[has_tag] = self._tags_at(self.offset[:-1][has_tag])
        return tags

    def _tags_at(self, start: IntArray) -> IntArray:
        return self.data[start].astype(np.int64) | self.data[start + 1].astype(np.int64) << 8

    def select(self, index: IntArray) -> "Payloads":
        """The rows `index` (k,), in its order; an index may repeat."""
        sizes = self.sizes
        if len(index) and (sizes == sizes[0]).all():  # usual case: rows of one size, copied as a 2-D array
            data = self.data.reshape(len(self), sizes[0]).take(index, axis=0)
            return Payloads(data.reshape(-1), np.arange(len(index) + 1) * sizes[0])
        sizes = sizes[index]
        offset = offsets(sizes)
        first = np.repeat(self.offset[index] - offset[:-1], sizes)
        return Payloads(self.data[first + np.arange(offset[-1])], offset)

    def span(self, first: int, last: int) -> "Payloads":
        """The rows from `first` to `last` - 1, without a copy of their bytes."""
        offset = self.offset[first : last + 1]
        return Payloads(self.data[offset[0] : offset[-1]], offset - offset[0])

    def row(self, index: int) -> bytes:
        """A row as bytes."""
        return self.data[self.offset[index] : self.offset[index + 1]].tobytes()

    @classmethod
    def from_rows(cls, rows: list[bytes]) -> "Payloads":
        """A table of these encoded messages."""
        data = np.frombuffer(b"".join(rows), np.uint8)
        return cls(data, np.array([0, *accumulate(map(len, rows))]))

    @classmethod
    def from_row(cls, row: bytes) -> "Payloads":
        """A table of one encoded message."""
        return cls(np.frombuffer(row, np.uint8), np.array((0, len(row))))

    @classmethod
    def joined(cls, parts: "list[Payloads]") -> "Payloads":
        """The rows of all parts, in order."""
        if not parts:
            return _NO_PAYLOADS
        data = np.concatenate([part.data for part in parts])
        return cls(data, offsets(np.concatenate([part.sizes for part in parts])))


def offsets(sizes: IntArray) -> IntArray:
    """The start of each row, computed from the rows' sizes, and the end of the last row, (rows + 1,)."""
    out = np.zeros(len(sizes) + 1, np.int64)
    np.cumsum(sizes, out=out[1:])
    return out


_NOTHING = np.empty(0, np.int64)
_NO_PAYLOADS = Payloads.from_rows([])


@tick_record
class SentPackets:
    """Packets that agents sent in one tick; the packets of one sender stand in the order of its `send` calls."""

    sender: IntArray  # (k,) robot row: arena x robots + index
    to: IntArray  # (k,) index of the addressed robot in its arena, BROADCAST or, between loop and medium, NOWHERE
    payloads: Payloads  # (k,)
    tx_status_id: IntArray | None = None  # (k,) id of the packet's tx status, or NO_TX_STATUS; None: all NO_TX_STATUS

    def __len__(self) -> int:
        return len(self.sender)

    @property
    def tx_status_ids(self) -> IntArray:
        """`tx_status_id`, (k,), with NO_TX_STATUS in place of None."""
        return np.full(len(self), NO_TX_STATUS) if self.tx_status_id is None else self.tx_status_id

    def select(self, index: IntArray) -> "SentPackets":
        """The packets `index` (k,), in its order."""
        tx_status_id = None if self.tx_status_id is None else self.tx_status_id[index]
        return SentPackets(self.sender[index], self.to[index], self.payloads.select(index), tx_status_id)

    @classmethod
    def none(cls) -> "SentPackets":
        """No packets."""
        return _NO_PACKETS

    @classmethod
    def joined(cls, parts: "list[SentPackets]") -> "SentPackets":
        """The packets of all parts."""
        if len(parts) == 1:
            return parts[0]
        if not parts:
            return cls.none()
        return cls(
            np.concatenate([part.sender for part in parts]),
            np.concatenate([part.to for part in parts]),
            Payloads.joined([part.payloads for part in parts]),
            np.concatenate([part.tx_status_ids for part in parts])
            if any(part.tx_status_id is not None for part in parts)
            else None,
        )


_NO_PACKETS = SentPackets(_NOTHING, _NOTHING, _NO_PAYLOADS)


@tick_record
class ReceivedPackets:
    """Packets that reached robots since the last tick, sorted by (receiver, received_at_ns, sender_index, sequence)."""

    receiver: IntArray  # (k,) robot row: arena x robots + index
    sender_index: IntArray  # (k,) index of the sender in the arena
    sequence: IntArray  # (k,) number of packets that the sender had sent before this packet
    received_at_ns: IntArray  # (k,)
    measured: dict[str, FloatArray]  # the receiver's measurements "range_m", "bearing_rad", "rssi_dbm", (k,) each
    payload: IntArray  # (k,) row in `payloads`
    payloads: Payloads  # one row per packet, shared by its receivers

    def __len__(self) -> int:
        return len(self.receiver)

    @classmethod
    def none(cls, measures: tuple[str, ...] = ()) -> "ReceivedPackets":
        """No packets; `measures` are the names of the columns in `measured`."""
        measured = {name: np.empty(0, np.float64) for name in measures}
        return cls(_NOTHING, _NOTHING, _NOTHING, _NOTHING, measured, _NOTHING, _NO_PAYLOADS)

    def select(self, index: IntArray) -> "ReceivedPackets":
        """The rows `index` (k,); the payload table stays shared."""
        return ReceivedPackets(
            self.receiver[index],
            self.sender_index[index],
            self.sequence[index],
            self.received_at_ns[index],
            {name: column[index] for name, column in self.measured.items()},
            self.payload[index],
            self.payloads,
        )

    @classmethod
    def joined(cls, parts: "list[ReceivedPackets]") -> "ReceivedPackets":
        """The packets of all parts, sorted; there is at least one part, and all have the same columns in `measured`."""
        filled = [part for part in parts if len(part)]
        if len(filled) < 2:
            return filled[0] if filled else parts[0]
        first_payload = offsets(np.array([len(part.payloads) for part in filled])).tolist()
        joined = cls(
            receiver=np.concatenate([part.receiver for part in filled]),
            sender_index=np.concatenate([part.sender_index for part in filled]),
            sequence=np.concatenate([part.sequence for part in filled]),
            received_at_ns=np.concatenate([part.received_at_ns for part in filled]),
            measured={name: np.concatenate([part.measured[name] for part in filled]) for name in filled[0].measured},
            payload=np.concatenate([part.payload + first for part, first in zip(filled, first_payload, strict=False)]),
            payloads=Payloads.joined([part.payloads for part in filled]),
        )
        order = np.lexsort((joined.sequence, joined.sender_index, joined.received_at_ns, joined.receiver))
        return joined.select(order)

    def compacted(self) -> "ReceivedPackets":
        """The same packets without the payloads that no robot received."""
        used, payload = np.unique(self.payload, return_inverse=True)
        return replace(self, payload=payload.reshape(-1), payloads=self.payloads.select(used))


class TxResult(ExplainedEnum):
    """The final result of a unicast packet at a sending radio that waits for acknowledgements.

    A packet without an acknowledgement may still have been received.
    """

    ACKNOWLEDGED = 0, "the receiver's radio acknowledged the packet"
    NO_ACKNOWLEDGEMENT = 1, "no acknowledgement of any attempt: the packet or its acknowledgement was lost"
    CHANNEL_BUSY = 2, "the radio found the medium busy each time it listened, and gave up"
    QUEUE_FULL = 3, "the radio's queue was full, or it waited there too long: never on air"
    TOO_LARGE = 4, "above the medium's largest payload: never on air"


@tick_record
class TxStatuses:
    """Unicast packets whose transmission ended at the sender's radio, sorted by (row, id)."""

    row: IntArray  #: (k,) sender: for a VectorAgent 0 to n - 1, between backend and medium arena x robots + index
    id: IntArray  #: (k,) as `send` returned it
    result: IntArray  #: (k,) TxResult

    def __len__(self) -> int:
        return len(self.row)

    @property
    def acknowledged(self) -> BoolArray:
        """True for the packets that certainly arrived, (k,)."""
        return self.result == TxResult.ACKNOWLEDGED

    def select(self, index: IntArray) -> "TxStatuses":
        """The rows `index` (k,), in its order."""
        return TxStatuses(self.row[index], self.id[index], self.result[index])

    @classmethod
    def joined(cls, parts: "list[TxStatuses]") -> "TxStatuses":
        """The tx statuses of all parts, sorted."""
        parts = [part for part in parts if len(part)]
        if not parts:
            return NO_TX_STATUSES
        row, id_, result = (np.concatenate([getattr(part, name) for part in parts]) for name in ("row", "id", "result"))
        return cls(row, id_, result).select(np.lexsort((id_, row)))


_NOTHING.setflags(write=False)
NO_TX_STATUSES = TxStatuses(_NOTHING, _NOTHING, _NOTHING)
