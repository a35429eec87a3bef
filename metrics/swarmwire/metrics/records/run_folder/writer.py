"""Writer of a table: numbered part files during a run, one file at its end.

`NAME/part-000000.parquet` and so on become `NAME.parquet`. Each file is written atomically, since a Parquet file that
is cut off is unreadable.
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

# Level 3 saves nothing on poses. Statistics of lists would take seven times as long as everything else.
PARQUET: dict[str, Any] = {"compression": "zstd", "compression_level": 1, "statistics": False}
MAX_CHUNK_S = 2.0  # wall time; a run that is killed loses at most this and the unfinished tick
MAX_QUEUED_CHUNKS = 2  # not counting the chunk that is being written


@dataclass(frozen=True, slots=True)
class Chunk:
    """Rows of a table: their number, and a function that builds their frame, or a sample of them, in the thread."""

    rows: int
    frame: Callable[[], pl.DataFrame]


class TableWriter:
    """Writes a table of this name and schema (name to polars type) into a run folder.

    While the queue is full, `put` blocks its caller, or, with `may_drop`, drops the chunk and counts its rows. Once a
    part cannot be written, `put` and `close` raise RecordFailed; the parts on disk stay.
    """

    def __init__(self, folder: Path, name: str, schema: Mapping[str, Any], may_drop: bool = False) -> None:
        self.rows, self.dropped = 0, 0  # rows in the files so far, and rows that were dropped
        self._folder, self._name, self._schema, self._may_drop = folder, name, schema, may_drop
        self._parts = 0
        self._fault: BaseException | None = None
        self._queue: Queue[Chunk | None] = Queue(MAX_QUEUED_CHUNKS)
        (folder / name).mkdir()
        self._thread = Thread(target=self._work, name=f"record {name}", daemon=True)
        self._thread.start()

    def put(self, chunk: Chunk) -> None:
        """Queue rows, to be written after earlier ones."""
        self._raise_fault()
        if not self._may_drop:
            self._queue.put(chunk)
            return
        try:
            self._queue.put_nowait(chunk)
        except Full:
            self.dropped += chunk.rows

    def close(self) -> None:
        """Wait for the thread and join the parts; call it once. A table without rows gets a file, too."""
        self._queue.put(None)
        self._thread.join()
        self._raise_fault()
        try:
            if not self._parts:
                self._write_empty()
            join_parts(self._folder, self._name)
        except Exception as error:
            raise self._failure(error) from error

    def _work(self) -> None:
        while (chunk := self._queue.get()) is not None:
            if self._fault is not None:
                self.dropped += chunk.rows  # popped nevertheless, so that `put` never blocks
                continue
            try:
                self._write(chunk.frame())
            except BaseException as error:  # noqa: BLE001 - polars panics outside Exception; `put` raises it
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

    def _raise_fault(self) -> None:
        if self._fault is not None:
            raise self._failure(self._fault) from self._fault

    def _failure(self, fault: BaseException) -> RecordFailed:
        return RecordFailed(f"{self._folder / self._name}: {fault}; earlier rows remain")


class ChunkLimit:
    """Size and time limit of the chunk that began at creation or at the last `restart`."""

    def __init__(self, size: int, clock: Clock) -> None:
        """Limit the chunk to this size, in rows or bytes, and to 2 s of `clock`."""
        self._size, self._clock = size, clock
        self.restart()

    def restart(self) -> None:
        """Begin a new chunk."""
        self._due_ns = self._clock.now_ns() + to_ns(MAX_CHUNK_S)

    def reached(self, size: int) -> bool:
        """Return True if a chunk of this size should be written now."""
        return size >= self._size or self._clock.now_ns() >= self._due_ns


def table_file(folder: Path, name: str) -> Path:
    """Return the path of the table of a run that ended."""
    return folder / f"{name}.parquet"


def part_file(folder: Path, name: str, number: int) -> Path:
    """Return the path of a part of a table whose run is live or was killed."""
    return folder / name / f"part-{number:06d}.parquet"


def parts_of(folder: Path, name: str) -> list[Path]:
    """Return the parts on disk, in order; none after they were joined."""
    return sorted((folder / name).glob("part-*.parquet"))


def scan_files(files: list[Path]) -> pl.LazyFrame:
    """Return the rows of a table's files, one or more, in order.

    A column that only later files have is null in earlier rows; in a column of fixed-length lists each item is null.
    Raises polars' errors for files that are damaged or have other types.
    """
    first, schema = pl.read_parquet_schema(files[0]), pl.read_parquet_schema(files[-1])
    added = {name: kind for name, kind in schema.items() if name not in first}
    if not added:
        return pl.scan_parquet(files)
    table = pl.scan_parquet(files, schema=schema, missing_columns="insert")
    lists = {name: kind for name, kind in added.items() if isinstance(kind, pl.Array)}
    return table.with_columns(
        pl.col(name).fill_null(pl.lit([None] * kind.size, dtype=kind)) for name, kind in lists.items()
    )


def write_file(frame: pl.DataFrame, path: Path) -> None:
    """Write a frame atomically; OSError if it cannot be written."""
    data = BytesIO()  # a full disk then raises OSError, not an error of polars
    frame.write_parquet(data, **PARQUET)
    write_bytes(path, data.getbuffer())


def join_parts(folder: Path, name: str) -> None:
    """Join the parts to one file in a streaming manner, and remove them; the file does not depend on their sizes."""
    parts, joined = parts_of(folder, name), table_file(folder, name)
    if len(parts) == 1:
        parts[0].replace(joined)
    else:
        with atomic_write(joined) as temporary:
            scan_files(parts).sink_parquet(temporary, **PARQUET)

        for part in parts:
            part.unlink()
    (folder / name).rmdir()
