"""The table `radio_links`: a row per link and fate that occurred on it."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from swarmwire.comms.arrays import IntArray
from swarmwire.comms.interfaces import Observer
from swarmwire.comms.packets import FATE_NAMES, Fate
from swarmwire.comms.truth import NO_ROBOT, ReceptionRecords, Static, Truth
from swarmwire.metrics.run_folder.table import RecordOptions, Table, TotalsRecorder, Verdict, compare_fates
from swarmwire.metrics.run_folder.writer import scan_files

if TYPE_CHECKING:
    import polars as pl

FATES = len(FATE_NAMES)
# Fates that every receiver has on a link of its own.
LINK_FATES = tuple(
    FATE_NAMES[fate]
    for fate in (
        Fate.RECEIVED,
        Fate.BLOCKED,
        Fate.LOST,
        Fate.TOO_WEAK,
        Fate.COLLIDED,
        Fate.BURST,
        Fate.PARTITIONED,
        Fate.JAMMED,
    )
)
WAITING_ROWS = 250_000  # before they are added up


class RadioLinks(Table):
    """A row per link and fate that occurred on it.

    Columns: arena, sender and receiver (indices), fate, packets. Receivers out of range have no rows, nor has a packet
    that never went on air.
    """

    name = "radio_links"

    def schema(self, static: Static | None = None) -> dict[str, Any]:
        """The type of each column."""
        import polars as pl

        return {
            "arena": pl.Int32,
            "sender": pl.Int32,
            "receiver": pl.Int32,
            "fate": pl.Enum(FATE_NAMES),
            "packets": pl.Int64,
        }

    def recorder(self, options: RecordOptions) -> Observer | None:
        """A recorder, if links are to be recorded."""
        return LinkRecorder(options.folder) if options.links else None

    def compare(self, files: list[Path], summary: Mapping[str, Any] | None) -> Verdict:
        """As many packets of each fate that only links have, over all links."""
        import polars as pl

        found = scan_files(files).group_by("arena", "fate").agg(pl.col("packets").sum()).collect()
        return compare_fates(
            {(arena, fate): packets for arena, fate, packets in found.iter_rows()}, LINK_FATES, summary
        )


class LinkRecorder(TotalsRecorder):
    """Observer that writes `radio_links.parquet`."""

    name = "radio_links"

    def start(self, static: Static) -> None:
        """Nothing is counted so far."""
        self._counts = LinkCounts(static)

    def add(self, truth: Truth) -> None:
        """Add what a tick brought."""
        if truth.finished is not None:
            self._counts.see(truth.finished)

    def frame(self) -> "pl.DataFrame":
        """A row per arena, sender, receiver and fate."""
        import polars as pl

        columns: dict[str, Any] = dict(self._counts.columns())
        columns["fate"] = pl.Series(FATE_NAMES).gather(columns["fate"])
        return pl.DataFrame(columns, schema_overrides=RadioLinks().schema())


class LinkCounts:
    """Packets counted by (arena, sender, receiver, fate); memory grows with the links that occurred, not with time."""

    def __init__(self, static: Static) -> None:
        self._robots = static.robots
        self._key: IntArray = np.zeros(0, np.int64)  # rising
        self._packets: IntArray = np.zeros(0, np.int64)
        self._waiting: list[IntArray] = []
        self._rows = 0

    def see(self, finished: ReceptionRecords) -> None:
        """Add the links that ended in a tick."""
        rows = np.flatnonzero(finished.receiver != NO_ROBOT)
        link = (finished.arena[rows] * self._robots + finished.sender[rows]) * self._robots + finished.receiver[rows]
        self._waiting.append(link * FATES + finished.fate[rows])
        self._rows += len(rows)
        if self._rows >= WAITING_ROWS:
            self._add_up()

    def columns(self) -> dict[str, IntArray]:
        """arena, sender, receiver, fate and packets, a row per combination that occurred, in that order."""
        self._add_up()
        link, fate = np.divmod(self._key, FATES)
        row, receiver = np.divmod(link, self._robots)
        arena, sender = np.divmod(row, self._robots)
        return {"arena": arena, "sender": sender, "receiver": receiver, "fate": fate, "packets": self._packets}

    def _add_up(self) -> None:
        """Sort what waits and merge it in: so often that sorting costs little, so seldom that merging does."""
        new, counts = np.unique(np.concatenate([np.zeros(0, np.int64), *self._waiting]), return_counts=True)
        self._waiting, self._rows = [], 0
        self._key, place = np.unique(np.concatenate([self._key, new]), return_inverse=True)
        packets = np.zeros(len(self._key), np.int64)
        np.add.at(packets, place, np.concatenate([self._packets, counts]))
        self._packets = packets
