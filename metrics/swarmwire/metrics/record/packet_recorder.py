"""The table `packets`: what became of each packet for each receiver within reach; of all packets, or of a share."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.clock import Clock
from swarmwire.comms.errors import BadInput
from swarmwire.comms.interfaces import Observer
from swarmwire.comms.truth import PacketCounts, ReceptionRecords, Static, Truth
from swarmwire.metrics.network.geometry_tick import POSES_KEPT_S
from swarmwire.metrics.record.chunk_limit import ChunkLimit
from swarmwire.metrics.record.packet_columns import PacketColumns, PacketSample, packet_schema
from swarmwire.metrics.record.table_writer import Chunk, TableWriter

CHUNK_ROWS = 100_000


class PacketRecorder(Observer):
    """Observer that writes `packets.parquet`, a row per (packet, receiver it might have reached).

    Receivers out of range are counted in `ticks` and the summary alone, and what is in flight at the end has no row.
    A share below 1 keeps whole packets, chosen by arena seed, sender and sequence number: the same in every layout.
    Summary part: `record_packets`: rows written, rows dropped (in real time only; all, not the share), and the share.
    """

    def __init__(
        self,
        folder: Path,
        clock: Clock,
        share: float = 1.0,
        topics: Mapping[int, str] | None = None,
        may_drop: bool = False,
    ) -> None:
        """Record a share of the packets, above 0 to 1; `topics` names messages by their tag, others show as 0x1a2b."""
        if not 0.0 < share <= 1.0:
            raise BadInput("", "packets", f"expected a share above 0 and at most 1, got {share!r}")
        self._folder, self._clock, self._may_drop = folder, clock, may_drop
        self._share, self._topics = share, dict(topics or {})

    def begin(self, static: Static) -> None:
        """Open the table."""
        self._static = static
        self._sample = PacketSample(self._share, static.seeds)
        self._writer = TableWriter(self._folder, "packets", packet_schema(), self._may_drop)
        self._limit = ChunkLimit(CHUNK_ROWS, self._clock)
        self._parts: list[ReceptionRecords] = []
        self._rows, self._first_tick = 0, 0
        self._poses: list[FloatArray] = []  # of the chunk's ticks and some before

    def see(self, truth: Truth) -> None:
        """Take what ended by this tick."""
        if not self._poses:
            self._first_tick = truth.tick
        self._poses.append(truth.pose)
        if truth.finished is not None and len(truth.finished.sender):
            self._parts.append(truth.finished)
            self._rows += len(truth.finished.sender)
        if self._limit.reached(self._rows):
            self._hand_over()

    def end(self, last: PacketCounts | None) -> dict[str, Any]:
        """Write what is left and join the parts."""
        try:
            self._hand_over()
        finally:
            self._writer.close()
        return {
            "record_packets": {"rows": self._writer.rows, "dropped": self._writer.dropped, "share": self._share},
        }

    def _hand_over(self) -> None:
        if self._parts:
            columns = PacketColumns(
                self._static, self._sample, self._topics, self._first_tick, list(self._poses), self._parts
            )
            self._writer.put(Chunk(self._rows, columns.frame))
        self._parts, self._rows = [], 0
        old = max(0, len(self._poses) - int(POSES_KEPT_S * self._static.rate_hz) - 1)
        del self._poses[:old]
        self._first_tick += old
        self._limit.restart()
