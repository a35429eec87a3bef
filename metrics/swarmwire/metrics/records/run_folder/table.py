"""Interface of a recorded table: schema, recorder and checks. Each table is one file, and one line in `tables.py`."""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import Any, ClassVar

import polars as pl

from swarmwire.comms.base.clock import Clock
from swarmwire.comms.base.errors import RecordFailed
from swarmwire.comms.observe.interfaces import Observer
from swarmwire.comms.observe.truth import Static, Truth
from swarmwire.comms.radio.records import PacketCounts, ReceptionRecords, TransmissionRecords
from swarmwire.metrics.measures.measure import Metrics
from swarmwire.metrics.records.run_folder.writer import table_file, write_file

BROKEN_OFF = ("interrupted", "left", "failed")  # ends of runs that may come within a tick, which no observer sees
ROBOTS = ("sender", "receiver", "to")  # columns with indices of robots


class TableState(StrEnum):
    """State of a part of a run folder."""

    INTACT = "intact"
    NOT_RECORDED = "not recorded"  # absent, and not expected
    PARTIAL = "partial"  # readable, but not to the end of the run
    MISSING = "missing"
    DAMAGED = "damaged"
    DIFFERS = "differs"  # readable, but different from the summary


Verdict = tuple[TableState, str] | None  # None: table and summary agree, or there is nothing to compare


@dataclass(frozen=True)
class RecordOptions:
    """The tables to record, and their folder.

    Attributes:
        metrics: source of the metrics' columns; must see each tick before the recorders.
        packets: share of the packets, 0 to 1; 0: none.
        topics: names of messages by tag; others show as 0x1a2b.
        links: record the table of links.
        may_drop: drop rows if the disk is slow, rather than delay the run: for real time.
    """

    folder: Path
    metrics: Metrics
    clock: Clock
    packets: float = 0.0
    topics: Mapping[int, str] = field(default_factory=dict[int, str])
    links: bool = False
    may_drop: bool = False


class RecordedTable(ABC):
    """A recorded table.

    Attributes:
        name: name of the table, of its file, and of its key in the summary's `record`.
        always: True if every run that records tables has it.
        types: polars' type of each column, if it is the same in every run.
        may_be_null: columns that may have missing values.
        optional: columns of the schema that a table may lack.
        row_bytes: least size of a row in a file, in bytes, of a table without an upper bound of its rows.
    """

    name: ClassVar[str]
    always: ClassVar[bool] = False
    types: ClassVar[dict[str, Any]] = {}
    may_be_null: ClassVar[tuple[str, ...]] = ()
    optional: ClassVar[tuple[str, ...]] = ()
    row_bytes: ClassVar[float] = math.inf

    def schema(self, static: Static | None = None) -> dict[str, Any]:
        """Return the polars type of each column; empty if it depends on the run and `static` is None."""
        return self.types

    @abstractmethod
    def recorder(self, options: RecordOptions) -> Observer | None:
        """Return the observer that writes the table; None if the options exclude it."""

    @abstractmethod
    def max_rows(self, static: Static, ticks: int) -> int:
        """Return the largest number of rows of a run with this many ticks, or with `row_bytes` of most runs.

        A table with more rows is not read, unless its files are at least as large as `row_bytes` says.
        """

    @abstractmethod
    def compare(self, files: list[Path], summary: Mapping[str, Any] | None) -> Verdict:
        """Compare the rows with the summary; without a summary, check that they are complete."""

    def columns(self) -> Collection[str]:
        """Return the columns that the table has in every run."""
        return self.schema().keys()

    def size_fault(self, table: pl.LazyFrame, static: Static, ticks: int, size_bytes: int) -> str | None:
        """Return a wrong type or number of rows of files of this size, in words; reads only their footers."""
        fault = self.type_fault(table, static)
        if fault is not None:
            return fault
        limit = max(self.max_rows(static, ticks), int(size_bytes / self.row_bytes))
        rows = table.select(pl.len()).collect().item()
        return f"{rows} rows, of a run that writes {limit} at most" if rows > limit else None

    def reach(self, table: pl.LazyFrame) -> str:
        """Return the end of a table with one or more rows, such as its last tick, in words."""
        return ""

    def fault(self, table: pl.LazyFrame, static: Static | None) -> str | None:
        """Return the first fault in words, or None; without `static` robots and arenas are not checked."""
        return self.type_fault(table, static) or self.value_fault(table, static)

    def type_fault(self, table: pl.LazyFrame, static: Static | None) -> str | None:
        """Return a missing column, or a wrong type, in words."""
        schema = table.collect_schema()
        for column, kind in self.schema(static).items():
            if column not in schema:
                if column not in self.optional:
                    return f"no column {column}"
            elif schema[column] != kind:
                return f"{column} is of type {schema[column]}, expected {kind}"
        return None

    def value_fault(self, table: pl.LazyFrame, static: Static | None) -> str | None:
        """Return a value that is missing, no number, below 0, or an unknown index, in words."""
        faults: dict[str, pl.Expr] = {}
        limits = {} if static is None else {"arena": static.arenas, **dict.fromkeys(ROBOTS, static.robots)}
        for column, kind in table.collect_schema().items():
            values = pl.col(column)
            if column not in self.may_be_null:
                faults[f"{column} is null"] = values.is_null()
                if kind.is_float():
                    faults[f"{column} is no finite number"] = ~values.is_finite()
            if kind.is_integer():
                faults[f"{column} is below 0"] = values < 0
            if column in limits:
                faults[f"{column} is beyond {limits[column] - 1}, the last of static.json"] = values >= limits[column]
        counts = table.select(expression.sum().alias(text) for text, expression in faults.items()).collect().row(0)
        for text, rows in zip(faults, counts, strict=True):
            if rows:
                return f"{text} in {rows} row{'s' if rows != 1 else ''}"
        return None


class Totals(ABC):
    """Totals over a run, for a table about the radio."""

    def see(self, truth: Truth) -> None:
        """Add a tick."""
        if truth.departed is not None and truth.finished is not None:
            self.add(truth.departed, truth.finished)

    @abstractmethod
    def add(self, departed: TransmissionRecords, finished: ReceptionRecords) -> None:
        """Add packets: those that left their senders, and receptions whose fate is final."""

    @abstractmethod
    def frame(self) -> pl.DataFrame:
        """Return the table."""

    def about(self) -> dict[str, Any]:
        """Return more keys for the summary."""
        return {}


class TotalsRecorder(Observer):
    """Observer that writes a table about the radio at the end of the run, unless the run has no radio or is killed.

    Summary part: `record_NAME`: rows written, rows dropped (always 0), and the keys of `Totals.about`. `end` raises
    RecordFailed if the table cannot be written.
    """

    def __init__(self, folder: Path, name: str, kind: Callable[[Static], Totals]) -> None:
        self._folder, self._name, self._kind = folder, name, kind

    def begin(self, static: Static) -> None:
        """Start a run."""
        self._has_radio, self._totals = False, self._kind(static)

    def see(self, truth: Truth) -> None:
        """Add a tick."""
        if truth.departed is not None and truth.finished is not None:
            self._has_radio = True
        self._totals.see(truth)

    def see_last(self, departed: TransmissionRecords, finished: ReceptionRecords) -> None:
        """Add the last packets."""
        self._totals.add(departed, finished)

    def end(self, last: PacketCounts | None) -> dict[str, Any]:
        """Write the table."""
        if not self._has_radio:
            return {}
        frame = self._totals.frame()
        try:
            write_file(frame, table_file(self._folder, self._name))
        except OSError as error:
            raise RecordFailed(f"{self._folder / self._name}: {error}") from error
        return {f"record_{self._name}": {"rows": len(frame), "dropped": 0, **self._totals.about()}}


def per_arena(summary: Mapping[str, Any], key: str) -> list[Any]:
    """Return the values of this key of the summary, an item per arena; with a single arena the key has no list."""
    return [summary[key]] if summary["arenas"] == 1 else summary[key]


def arena_ticks(summary: Mapping[str, Any]) -> list[int]:
    """Return the number of ticks of each arena."""
    return [end["ticks"] for end in summary["by_arena"]]


def sums(table: pl.LazyFrame, columns: list[str]) -> list[dict[str, Any]]:
    """Return the sums of these columns, a row per arena."""
    return table.group_by("arena").agg(pl.col(columns).sum()).sort("arena").collect().to_dicts()


def compare_fates(
    counted: Mapping[tuple[int, str], int], fates: Collection[str], summary: Mapping[str, Any] | None
) -> Verdict:
    """Compare counts by (arena, fate) with the summary's `radio`.

    Runs that did not end by themselves are skipped: their summary may count an incomplete tick that the tables lack.
    """
    if summary is None or summary["ended"] in BROKEN_OFF:
        return None
    radios: list[dict[str, Any] | None] = per_arena(summary, "radio")
    for arena, radio in enumerate(radios):
        expected: dict[str, int] = radio["fates"] if radio else {}
        for fate in fates:
            rows = counted.get((arena, fate), 0)
            if rows != expected.get(fate, 0):
                return TableState.DIFFERS, f"{rows} {fate} (arena {arena}); the summary has {expected.get(fate, 0)}"
    return None
