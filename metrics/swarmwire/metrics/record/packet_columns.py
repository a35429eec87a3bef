"""The table of packets: a row per packet and receiver it might have reached, or per packet that never went on air."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from swarmwire.comms.arrays import AnyArray, BoolArray, FloatArray, IntArray, KeyArray
from swarmwire.comms.draws import LOW32, derive_key, purpose, uniform
from swarmwire.comms.packets import BROADCAST, FATE_NAMES
from swarmwire.comms.truth import NO_ROBOT, ReceptionRecords, Static
from swarmwire.metrics.network.geometry_tick import geometry_tick
from swarmwire.metrics.torus import shortest

if TYPE_CHECKING:
    import polars as pl

OTHERWISE = ("rssi_dbm", "payload", "payloads")  # of Finished: not joined as columns of numbers


def packet_schema() -> "dict[str, Any]":
    """The type of each column."""
    import polars as pl

    return {
        "arena": pl.Int32,
        "sender": pl.Int32,
        "receiver": pl.Int32,  # null: never on air
        "receivers": pl.Int32,
        "to": pl.Int32,  # null: a broadcast
        "sequence": pl.Int64,
        "sent_at_ns": pl.Int64,
        "on_air_at_ns": pl.Int64,
        "final_at_ns": pl.Int64,
        "fate": pl.Enum(FATE_NAMES),
        "rssi_dbm": pl.Float32,  # null: the radio knows none
        "size_bytes": pl.Int32,
        "topic": pl.String,
        "distance_m": pl.Float32,  # null: never on air, or longer ago than poses are kept
        "payload": pl.Binary,  # with its tag
    }


class PacketSample:
    """Which packets are recorded: a share of them, the same whatever the layout, each with all of its receivers."""

    def __init__(self, share: float, seeds: tuple[int, ...]) -> None:
        self._share = share
        self._keys: KeyArray = np.array([derive_key("recorded packets", seed) for seed in seeds], np.uint64)

    def __call__(self, finished: ReceptionRecords) -> BoolArray:
        """Whether to keep each row, (k,)."""
        if self._share >= 1.0:
            return np.ones(len(finished.sender), np.bool_)
        key, sequence = self._keys[finished.arena], finished.sequence
        drawn = uniform(key, purpose("packet"), finished.sender, sequence & LOW32, sequence >> 32)
        return drawn < self._share


@dataclass
class PacketColumns:
    """The links that ended in some ticks, and the poses of these and some ticks before, as references."""

    static: Static
    sample: PacketSample
    topics: Mapping[int, str]  # name of a message's class by its tag
    first_tick: int  # of `poses`
    poses: list[FloatArray]  # of each tick since, (rows, 3)
    parts: list[ReceptionRecords] = field(default_factory=list[ReceptionRecords])

    def frame(self) -> "pl.DataFrame":
        """The rows of the packets in the sample, as they ended."""
        import polars as pl

        keep = [self.sample(part) for part in self.parts]
        taken = {name: self._joined(name, keep) for name in ReceptionRecords.__slots__ if name not in OTHERWISE}
        fate, tag = taken.pop("fate"), taken.pop("tag")
        has_receiver, is_addressed = pl.Series(taken["receiver"] != NO_ROBOT), pl.Series(taken["to"] != BROADCAST)
        columns: dict[str, Any] = {
            **taken,
            "fate": pl.Series(FATE_NAMES).gather(fate),
            "rssi_dbm": self._rssi_dbm(keep),
            "topic": self._topic(tag),
            "distance_m": pl.Series(self._distance_m(taken)).fill_nan(None),
            "payload": pl.concat([_payload(part, rows) for part, rows in zip(self.parts, keep, strict=True)]),
        }
        schema = packet_schema()
        frame = pl.DataFrame({name: columns[name] for name in schema}, schema_overrides=schema)
        return frame.with_columns(receiver=pl.when(has_receiver).then("receiver"), to=pl.when(is_addressed).then("to"))

    def _joined(self, name: str, keep: list[BoolArray]) -> IntArray:
        return np.concatenate([getattr(part, name)[rows] for part, rows in zip(self.parts, keep, strict=True)])

    def _rssi_dbm(self, keep: list[BoolArray]) -> "pl.Series":
        import polars as pl

        none: AnyArray = np.full(1, np.nan)
        strengths = [none if part.rssi_dbm is None else part.rssi_dbm for part in self.parts]
        strengths = [np.broadcast_to(rssi, rows.shape)[rows] for rssi, rows in zip(strengths, keep, strict=True)]
        return pl.Series(np.concatenate(strengths)).fill_nan(None)

    def _topic(self, tag: IntArray) -> "pl.Series":
        import polars as pl

        known, place = np.unique(tag, return_inverse=True)
        return pl.Series([self.topics.get(one, f"0x{one:04x}") for one in known.tolist()], dtype=pl.String).gather(
            place
        )

    def _distance_m(self, links: Mapping[str, IntArray]) -> FloatArray:
        """Between sender and receiver when the packet went on air, (k,); NaN without a receiver or the tick's poses."""
        tick = geometry_tick(links["on_air_at_ns"], self.static.rate_hz) - self.first_tick
        known = np.flatnonzero((links["receiver"] != NO_ROBOT) & (tick >= 0) & (tick < len(self.poses)))
        distance_m = np.full(len(tick), np.nan)
        if len(known):
            place = np.stack([pose[:, :2] for pose in self.poses])
            first = links["arena"][known] * self.static.robots
            sender = place[tick[known], first + links["sender"][known]]
            receiver = place[tick[known], first + links["receiver"][known]]
            distance_m[known] = np.hypot(*shortest(sender - receiver, self.static).T)
        return distance_m


def _payload(part: ReceptionRecords, keep: BoolArray) -> "pl.Series":
    """The bytes of the rows to keep; each packet's are taken out once, however many receivers it has."""
    import polars as pl

    if part.payload is None or part.payloads is None:
        return pl.Series([None] * int(keep.sum()), dtype=pl.Binary)
    packet, place = np.unique(part.payload[keep], return_inverse=True)
    return pl.Series([part.payloads.row(row) for row in packet.tolist()], dtype=pl.Binary).gather(place)
