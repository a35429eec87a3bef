"""The table `packets`: the fate of each packet, or of a share of them, at each receiver within reach."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import polars as pl

from swarmwire.comms.base.arrays import AnyArray, BoolArray, FloatArray, IntArray, KeyArray
from swarmwire.comms.base.clock import NS_PER_S, Clock
from swarmwire.comms.base.draws import LOW32, derive_key, purpose, uniform
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.base.sentinels import BROADCAST, NO_ROBOT, NOWHERE
from swarmwire.comms.observe.interfaces import Observer
from swarmwire.comms.observe.truth import Static, Truth
from swarmwire.comms.radio.records import PacketCounts, ReceptionRecords, TransmissionRecords
from swarmwire.comms.robot.packets import FATE_NAMES
from swarmwire.metrics.measures.torus import shortest_displacement
from swarmwire.metrics.records.run_folder.table import RecordedTable, RecordOptions, Verdict, compare_fates
from swarmwire.metrics.records.run_folder.writer import Chunk, ChunkLimit, TableWriter, scan_files

OPTIONAL_COLUMNS = ("rssi_dbm", "payload", "payloads")  # columns of `ReceptionRecords` that may be None
NO_ROWS = ("out_of_range", "in_flight")  # fates that have no row
CHUNK_ROWS = 100_000
PACKETS_PER_TICK = 100  # of a robot on average, in most runs
POSES_S = 5.0  # simulated time for which poses are stored; packets under way for longer have no distance


class PacketsTable(RecordedTable):
    """A row per packet and receiver within reach, if packets are recorded; `Fate` defines within reach.

    A packet has the key (arena, sender, sequence). There is no row if the receiver was out of range, the packet was in
    flight when the run ended, or it was addressed to no robot.

    Columns: arena, sender and receiver (indices; receiver null: never on air, `receivers` is the number of intended
    receivers), to (index of the addressed robot; null: a broadcast), sequence (number of earlier packets of the
    sender's radio), sent_at_ns, on_air_at_ns (of the attempt that decided the fate), final_at_ns (when the fate became
    final: the end of the airtime, for a received packet with all delays), fate, rssi_dbm (null: unknown), size_bytes,
    topic, distance_m (between the two when it went on air; null: unknown), payload (bytes, the tag first).
    """

    name = "packets"
    may_be_null = ("receiver", "to", "rssi_dbm", "distance_m", "payload")
    row_bytes = 1.0  # a robot may send any number of packets in a tick; a row takes about 5 bytes

    types: ClassVar = {
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
        "rssi_dbm": pl.Float32,  # null: unknown to the radio
        "size_bytes": pl.Int32,
        "topic": pl.String,
        "distance_m": pl.Float32,  # null: never on air, or under way for more than POSES_S
        "payload": pl.Binary,  # the tag first
    }

    def recorder(self, options: RecordOptions) -> Observer | None:
        """Return a recorder if the options include packets."""
        if not options.packets:
            return None
        return PacketRecorder(options.folder, options.clock, options.packets, options.topics, options.may_drop)

    def max_rows(self, static: Static, ticks: int) -> int:
        """Return a row per receiver of all packets, if robots send `PACKETS_PER_TICK`."""
        return PACKETS_PER_TICK * ticks * static.arenas * static.robots**2

    def compare(self, files: list[Path], summary: Mapping[str, Any] | None) -> Verdict:
        """Compare the receivers of each fate, if all packets of a run that ended by itself were recorded."""
        recorded: dict[str, Any] = {} if summary is None else summary["record"].get(self.name, {})
        if summary is None or recorded.get("share") != 1.0 or recorded["dropped"]:
            return None
        sums = scan_files(files).group_by("arena", "fate").agg(pl.col("receivers").sum()).collect()
        fates = [fate for fate in FATE_NAMES if fate not in NO_ROWS]
        return compare_fates({(arena, fate): number for arena, fate, number in sums.iter_rows()}, fates, summary)


class PacketRecorder(Observer):
    """Observer that writes `packets.parquet`, a row per packet and receiver within reach.

    Receivers out of range are counted in `ticks` and the summary only, and packets in flight at the end have no row. A
    share below 1 records all rows of some packets, drawn by arena seed, sender and sequence number: the same in every
    layout. Summary part: `record_packets`: rows written, rows dropped (in real time only; before the share is drawn),
    and the share.
    """

    def __init__(
        self,
        folder: Path,
        clock: Clock,
        share: float = 1.0,
        topics: Mapping[int, str] | None = None,
        may_drop: bool = False,
    ) -> None:
        """Record a share of the packets, above 0 to 1; `topics` has names of messages by tag, others show as 0x1a2b."""
        if not 0.0 < share <= 1.0:
            raise BadInput("", "packets", f"expected a share above 0 and at most 1, got {share!r}")
        self._folder, self._clock, self._may_drop = folder, clock, may_drop
        self._share, self._topics = share, dict(topics or {})

    def begin(self, static: Static) -> None:
        """Open the table."""
        self._static = static
        self._sample = PacketSample(self._share, static.seeds)
        self._writer = TableWriter(self._folder, "packets", PacketsTable.types, self._may_drop)
        self._limit = ChunkLimit(CHUNK_ROWS, self._clock)
        self._parts: list[ReceptionRecords] = []
        self._rows, self._first_tick = 0, 0
        self._positions: list[FloatArray] = []  # positions in the chunk's ticks and in earlier ones

    def see(self, truth: Truth) -> None:
        """Add the packets whose fate became final by this tick."""
        if not self._positions:
            self._first_tick = truth.tick
        self._positions.append(truth.position_m)
        if truth.finished is not None:
            self._add(truth.finished)
        if self._limit.reached(self._rows):
            self._write_chunk()

    def see_last(self, departed: TransmissionRecords, finished: ReceptionRecords) -> None:
        """Add the last packets."""
        self._add(finished)

    def end(self, last: PacketCounts | None) -> dict[str, Any]:
        """Write the last chunk and join the parts."""
        try:
            self._write_chunk()
        finally:
            self._writer.close()
        return {
            "record_packets": {"rows": self._writer.rows, "dropped": self._writer.dropped, "share": self._share},
        }

    def _add(self, finished: ReceptionRecords) -> None:
        if len(finished.sender):
            self._parts.append(finished)
            self._rows += len(finished.sender)

    def _write_chunk(self) -> None:
        if self._parts:
            columns = PacketColumns(
                self._static, self._sample, self._topics, self._first_tick, list(self._positions), self._parts
            )
            self._writer.put(Chunk(self._rows, columns.frame))
        self._parts, self._rows = [], 0
        old = max(0, len(self._positions) - int(POSES_S * self._static.rate_hz) - 1)
        del self._positions[:old]
        self._first_tick += old
        self._limit.restart()


class PacketSample:
    """Draw of the recorded packets: a share of them, the same for every layout, each with all of its receivers."""

    def __init__(self, share: float, seeds: tuple[int, ...]) -> None:
        self._share = share
        self._keys: KeyArray = np.array([derive_key("recorded packets", seed) for seed in seeds], np.uint64)

    def __call__(self, finished: ReceptionRecords) -> BoolArray:
        """Return True for the rows to record, (k,)."""
        if self._share >= 1.0:
            return np.ones(len(finished.sender), np.bool_)
        key, sequence = self._keys[finished.arena], finished.sequence
        drawn = uniform(key, purpose("packet"), finished.sender, sequence & LOW32, sequence >> 32)
        return drawn < self._share


@dataclass
class PacketColumns:
    """Links of a chunk of ticks, and the positions in these and earlier ticks, as references."""

    static: Static
    sample: PacketSample
    topics: Mapping[int, str]  # name of a message's class by its tag
    first_tick: int  # tick of the first item of `positions`
    positions: list[FloatArray]  # x, y, z in m in consecutive ticks, (rows, 3) each
    parts: list[ReceptionRecords] = field(default_factory=list[ReceptionRecords])

    def frame(self) -> pl.DataFrame:
        """Return the rows of the sampled packets, in the order of their final times."""
        keep = [self.sample(part) & (part.to != NOWHERE) for part in self.parts]
        names = [column.name for column in fields(ReceptionRecords) if column.name not in OPTIONAL_COLUMNS]
        numbers = {name: self._joined(name, keep) for name in names}
        fate, tag = numbers.pop("fate"), numbers.pop("tag")
        has_receiver, is_addressed = pl.Series(numbers["receiver"] != NO_ROBOT), pl.Series(numbers["to"] != BROADCAST)
        columns: dict[str, Any] = {
            **numbers,
            "fate": pl.Series(FATE_NAMES).gather(fate),
            "rssi_dbm": self._rssi_dbm(keep),
            "topic": self._topic(tag),
            "distance_m": pl.Series(self._distance_m(numbers)).fill_nan(None),
            "payload": pl.concat([_payload(part, rows) for part, rows in zip(self.parts, keep, strict=True)]),
        }
        schema = PacketsTable.types
        frame = pl.DataFrame({name: columns[name] for name in schema}, schema_overrides=schema)
        return frame.with_columns(receiver=pl.when(has_receiver).then("receiver"), to=pl.when(is_addressed).then("to"))

    def _joined(self, name: str, keep: list[BoolArray]) -> IntArray:
        return np.concatenate([getattr(part, name)[rows] for part, rows in zip(self.parts, keep, strict=True)])

    def _rssi_dbm(self, keep: list[BoolArray]) -> pl.Series:
        none: AnyArray = np.full(1, np.nan)
        strengths = [none if part.rssi_dbm is None else part.rssi_dbm for part in self.parts]
        strengths = [np.broadcast_to(rssi, rows.shape)[rows] for rssi, rows in zip(strengths, keep, strict=True)]
        return pl.Series(np.concatenate(strengths)).fill_nan(None)

    def _topic(self, tag: IntArray) -> pl.Series:
        tags, index = np.unique(tag, return_inverse=True)
        names = [self.topics.get(number, f"0x{number:04x}") for number in tags.tolist()]
        return pl.Series(names, dtype=pl.String).gather(index)

    def _distance_m(self, links: Mapping[str, IntArray]) -> FloatArray:
        """Return the distances when the packets went on air, (k,); NaN without a receiver or the tick's positions."""
        tick = geometry_tick(links["on_air_at_ns"], self.static.rate_hz) - self.first_tick
        rows = np.flatnonzero((links["receiver"] != NO_ROBOT) & (tick >= 0) & (tick < len(self.positions)))
        distance_m = np.full(len(tick), np.nan)
        if len(rows):
            position = np.stack(self.positions)
            first = links["arena"][rows] * self.static.robots
            sender = position[tick[rows], first + links["sender"][rows]]
            receiver = position[tick[rows], first + links["receiver"][rows]]
            away = sender - receiver
            flat_m = np.hypot(*shortest_displacement(away[:, :2], self.static).T)
            distance_m[rows] = np.hypot(flat_m, away[:, 2])
        return distance_m


def _payload(part: ReceptionRecords, keep: BoolArray) -> pl.Series:
    """Return the payloads of the rows to keep; each packet's bytes are extracted once."""
    if part.payload is None or part.payloads is None:
        return pl.Series([None] * int(keep.sum()), dtype=pl.Binary)
    packet, index = np.unique(part.payload[keep], return_inverse=True)
    return pl.Series([part.payloads.row(row) for row in packet.tolist()], dtype=pl.Binary).gather(index)


def geometry_tick(on_air_at_ns: IntArray, rate_hz: int) -> IntArray:
    """Return the last tick that starts no later than the packet goes on air, (k,): its poses define the distance."""
    return ((on_air_at_ns + 1) * rate_hz - 1) // NS_PER_S
