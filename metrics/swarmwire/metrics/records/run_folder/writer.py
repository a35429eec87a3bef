"""A table on disk: numbered part files during a run, one file at its end.

`NAME/part-000000.parquet` and so on become `NAME.parquet`. Each file is written aside and renamed, so a file of that
name is whole: a Parquet file that is cut off is unreadable.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from queue import Full, Queue
from threading import Thread
from typing import Any

import polars as pl

from swarmwire.comms.base.atomic import atomic_write, write_bytes
from swarmwire.comms.base.clock import Clock, to_ns
from swarmwire.comms.base.errors import RecordFailed

# Level 3 saves nothing on poses. Statistics of lists take seven times as long as all the rest.
PARQUET: dict[str, Any] = {"compression": "zstd", "compression_level": 1, "statistics": False}
MAX_S = 2.0  # of wall time: a run that is killed loses no more than this, and the tick under way
WAITING_CHUNKS = 2  # at most, beside the one that is being written


@dataclass(frozen=True, slots=True)
class Chunk:
    """Rows of a table: how many, and how the thread makes a frame of them, or of those worth keeping."""

    rows: int
    frame: Callable[[], pl.DataFrame]


class TableWriter:
    """Writes a table of this name and schema (name to polars type) into a run folder.

    While the queue is full `put` holds its caller back, or, if it `may_drop`, drops the chunk and counts its rows. Once
    the disk refuses a part, `put` and `close` raise RecordFailed; what was written stays.
    """

    def __init__(self, folder: Path, name: str, schema: Mapping[str, Any], may_drop: bool = False) -> None:
        self.rows, self.dropped = 0, 0  # rows in the files so far, and rows that never came there
        self._folder, self._name, self._schema, self._may_drop = folder, name, schema, may_drop
        self._parts = 0
        self._fault: BaseException | None = None
        self._queue: Queue[Chunk | None] = Queue(WAITING_CHUNKS)
        (folder / name).mkdir()
        self._thread = Thread(target=self._work, name=f"record {name}", daemon=True)
        self._thread.start()

    def put(self, chunk: Chunk) -> None:
        """Hand over rows, to be written after those before them."""
        self._refuse()
        if not self._may_drop:
            self._queue.put(chunk)
            return
        try:
            self._queue.put_nowait(chunk)
        except Full:
            self.dropped += chunk.rows

    def close(self) -> None:
        """Wait for the thread and join the parts; a table without rows gets a file too. Once only."""
        self._queue.put(None)
        self._thread.join()
        self._refuse()
        try:
            if not self._parts:
                self._write_empty()
            join_parts(self._folder, self._name)
        except Exception as error:
            raise self._failed(error) from error

    def _work(self) -> None:
        while (chunk := self._queue.get()) is not None:
            if self._fault is not None:
                self.dropped += chunk.rows  # taken all the same, so that `put` does not wait for room
                continue
            try:
                self._write(chunk.frame())
            except BaseException as error:  # noqa: BLE001 - polars panics outside Exception; the caller is told
                self._fault = error
                self.dropped += chunk.rows

    def _write(self, frame: pl.DataFrame) -> None:
        if not len(frame):
            return
        write_file(frame, part_file(self._folder, self._name, self._parts))
        self._parts += 1
        self.rows += len(frame)

    def _write_empty(self) -> None:
        write_file(pl.DataFrame(schema=self._schema), part_file(self._folder, self._name, 0))

    def _refuse(self) -> None:
        if self._fault is not None:
            raise self._failed(self._fault) from self._fault

    def _failed(self, fault: BaseException) -> RecordFailed:
        return RecordFailed(f"{self._folder / self._name}: {fault}; earlier rows remain")


class ChunkLimit:
    """Decides when the chunk is due that began at creation or at the last `restart`."""

    def __init__(self, size: int, clock: Clock) -> None:
        """It is due at this size, in rows or bytes, or 2 s of `clock` after it began."""
        self._size, self._clock = size, clock
        self.restart()

    def restart(self) -> None:
        """A new chunk begins."""
        self._due_ns = self._clock.now_ns() + to_ns(MAX_S)

    def reached(self, size: int) -> bool:
        """Whether a chunk of this size should be closed now."""
        return size >= self._size or self._clock.now_ns() >= self._due_ns


def table_file(folder: Path, name: str) -> Path:
    """The table of a run that ended."""
    return folder / f"{name}.parquet"


def part_file(folder: Path, name: str, number: int) -> Path:
    """A part of a table whose run is live or was killed."""
    return folder / name / f"part-{number:06d}.parquet"


def parts_of(folder: Path, name: str) -> list[Path]:
    """The parts that are there, in order; none once they are joined."""
    return sorted((folder / name).glob("part-*.parquet"))


def scan_files(files: list[Path]) -> pl.LazyFrame:
    """The rows of a table's files, one or more, in order.

    A column that only later files have is null in the rows before; in a column of fixed-length lists each item is null.
    Raises polars' errors for files that are damaged or have other types.
    """
    first, schema = pl.read_parquet_schema(files[0]), pl.read_parquet_schema(files[-1])
    later = {name: kind for name, kind in schema.items() if name not in first}
    if not later:
        return pl.scan_parquet(files)
    table = pl.scan_parquet(files, schema=schema, missing_columns="insert")
    lists = {name: kind for name, kind in later.items() if isinstance(kind, pl.Array)}
    return table.with_columns(
        pl.col(name).fill_null(pl.lit([None] * kind.size, dtype=kind)) for name, kind in lists.items()
    )


def write_file(frame: pl.DataFrame, path: Path) -> None:
    """Write a frame under this name, all of it or nothing; OSError if the disk will not have it."""
    data = BytesIO()  # in memory first: what a full disk then says is an OSError
    frame.write_parquet(data, **PARQUET)
    write_bytes(path, data.getbuffer())


def join_parts(folder: Path, name: str) -> None:
    """Make one file of the parts, which go; where they end does not show in it. Reads them piece by piece."""
    parts, whole = parts_of(folder, name), table_file(folder, name)
    if len(parts) == 1:
        parts[0].replace(whole)
    else:
        with atomic_write(whole) as aside:
            scan_files(parts).sink_parquet(aside, **PARQUET)
        for part in parts:
            part.unlink()
    (folder / name).rmdir()
