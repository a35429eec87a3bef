"""A recorded table: its schema, recorder and checks. Each table is one file, and one line in `tables.py`."""

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
from swarmwire.comms.radio.records import PacketCounts
from swarmwire.metrics.measures.measure import Metrics
from swarmwire.metrics.records.run_folder.writer import table_file, write_file

BROKEN_OFF = ("interrupted", "left", "failed")  # ends of runs that may come amid a tick, which no observer sees
ROBOTS = ("sender", "receiver", "to")  # columns with indices of robots


class TableState(StrEnum):
    """How a part of a run folder is."""

    INTACT = "intact"
    NOT_RECORDED = "not recorded"  # and nothing says that it should be there
    PARTIAL = "partial"  # readable, but not to the end of the run
    MISSING = "missing"
    DAMAGED = "damaged"
    DIFFERS = "differs"  # readable, but not what the summary says


Verdict = tuple[TableState, str] | None  # None: table and summary agree, or there is nothing to compare


@dataclass(frozen=True)
class RecordOptions:
    """Where tables are recorded, and which.

    Attributes:
        metrics: measures the metrics' columns; must see each tick before the recorders.
        packets: share of the packets, 0 to 1; 0: none.
        topics: names of messages by their tag; others show as 0x1a2b.
        links: also the table of links.
        may_drop: drop rows where the disk is slow, rather than delay the run: for real time.
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
        name: of the table, of its file, and of its key in the summary's `record`.
        always: every run that records tables has it.
        types: polars' type of each column, of a table that has the same in every run.
        may_be_null: columns that may have missing values.
        optional: columns that the schema has and a table may lack.
    """

    name: ClassVar[str]
    always: ClassVar[bool] = False
    types: ClassVar[dict[str, Any]] = {}
    may_be_null: ClassVar[tuple[str, ...]] = ()
    optional: ClassVar[tuple[str, ...]] = ()

    def schema(self, static: Static | None = None) -> dict[str, Any]:
        """The polars type of each column; empty if it depends on the run and `static` is None."""
        return self.types

    @abstractmethod
    def recorder(self, options: RecordOptions) -> Observer | None:
        """The observer that writes the table; None: the options leave it out."""

    @abstractmethod
    def max_rows(self, static: Static, ticks: int) -> int:
        """More rows than this no run of so many ticks writes: a table that claims more is not read."""

    @abstractmethod
    def compare(self, files: list[Path], summary: Mapping[str, Any] | None) -> Verdict:
        """Whether the rows add up to what the summary says; without a summary, whether they are complete."""

    def columns(self) -> Collection[str]:
        """The columns that every such table has."""
        return self.schema().keys()

    def size_fault(self, table: pl.LazyFrame, static: Static, ticks: int) -> str | None:
        """Another type or too many rows, in words; only the ends of the files are read, which state both."""
        fault = self.type_fault(table, static)
        if fault is not None:
            return fault
        rows, most = table.select(pl.len()).collect().item(), self.max_rows(static, ticks)
        return f"{rows} rows, of a run that writes {most} at most" if rows > most else None

    def reach(self, table: pl.LazyFrame) -> str:
        """How far the rows reach, in words; there is one at least."""
        return ""

    def fault(self, table: pl.LazyFrame, static: Static | None) -> str | None:
        """The first fault in words, None if there is none; without `static` robots and arenas are not checked."""
        return self.type_fault(table, static) or self.value_fault(table, static)

    def type_fault(self, table: pl.LazyFrame, static: Static | None) -> str | None:
        """A column that is missing, or of another type."""
        found = table.collect_schema()
        for column, kind in self.schema(static).items():
            if column not in found:
                if column not in self.optional:
                    return f"no column {column}"
            elif found[column] != kind:
                return f"{column} is of type {found[column]}, expected {kind}"
        return None

    def value_fault(self, table: pl.LazyFrame, static: Static | None) -> str | None:
        """A value that is missing, no number, below 0, or an index of nothing."""
        wrong: dict[str, pl.Expr] = {}
        below = {} if static is None else {"arena": static.arenas, **dict.fromkeys(ROBOTS, static.robots)}
        for column, kind in table.collect_schema().items():
            of = pl.col(column)
            if column not in self.may_be_null:
                wrong[f"{column} is null"] = of.is_null()
                if kind.is_float():
                    wrong[f"{column} is no finite number"] = ~of.is_finite()
            if kind.is_integer():
                wrong[f"{column} is below 0"] = of < 0
            if column in below:
                wrong[f"{column} is beyond {below[column] - 1}, the last of static.json"] = of >= below[column]
        counted = table.select(expression.sum().alias(text) for text, expression in wrong.items()).collect().row(0)
        for text, rows in zip(wrong, counted, strict=True):
            if rows:
                return f"{text} in {rows} row{'s' if rows != 1 else ''}"
        return None


class Totals(ABC):
    """What a table about the radio adds up over a run."""

    @abstractmethod
    def see(self, truth: Truth) -> None:
        """Add a tick."""

    @abstractmethod
    def frame(self) -> pl.DataFrame:
        """The table."""

    def about(self) -> dict[str, Any]:
        """More about the table for the summary."""
        return {}


class TotalsRecorder(Observer):
    """Writes a table about the radio as the run ends; without a radio nothing. A killed run leaves none.

    Summary part: `record_NAME`: rows written, rows dropped (0: no disk is in the way of adding up), and what the totals
    say besides. `end` raises RecordFailed if the disk refuses the table.
    """

    def __init__(self, folder: Path, name: str, kind: Callable[[Static], Totals]) -> None:
        self._folder, self._name, self._kind = folder, name, kind

    def begin(self, static: Static) -> None:
        """Start afresh."""
        self._has_radio, self._totals = False, self._kind(static)

    def see(self, truth: Truth) -> None:
        """Add a tick."""
        if truth.departed is not None and truth.finished is not None:
            self._has_radio = True
        self._totals.see(truth)

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
    """The values of this key of the summary, an item per arena: of a single arena the summary has no list."""
    return [summary[key]] if summary["arenas"] == 1 else summary[key]


def arena_ticks(summary: Mapping[str, Any]) -> list[int]:
    """How many ticks each arena took part in."""
    return [end["ticks"] for end in summary["by_arena"]]


def sums(table: pl.LazyFrame, columns: list[str]) -> list[dict[str, Any]]:
    """The sums of these columns, a row per arena."""
    return table.group_by("arena").agg(pl.col(columns).sum()).sort("arena").collect().to_dicts()


def compare_fates(
    counted: Mapping[tuple[int, str], int], fates: Collection[str], summary: Mapping[str, Any] | None
) -> Verdict:
    """Compare counts by (arena, fate) with the summary's `radio`.

    Runs that did not end by themselves are left out: their summary may count a broken-off tick that the tables lack.
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
