"""One table of a run folder on its way to disk: chunks through a bounded queue, a thread that writes them."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from queue import Full, Queue
from threading import Thread
from typing import TYPE_CHECKING, Any

from swarmwire.comms.errors import RecordFailed
from swarmwire.metrics.record.part_files import join_parts, part_file, write_file

if TYPE_CHECKING:
    import polars as pl

WAITING_CHUNKS = 4  # at most, beside the one that is being written


@dataclass(frozen=True, slots=True)
class Chunk:
    """Rows of a table: how many, and how the thread makes a frame of them, or of those worth keeping."""

    rows: int
    frame: "Callable[[], pl.DataFrame]"


class TableWriter:
    """Writes a table of this name and schema (name to polars type) into a run folder.

    While the queue is full `put` holds its caller back, or, if it `may_drop`, drops the chunk and counts its rows. Once
    the disk refuses a part, `put` and `close` say so by RecordFailed; what was written stays.
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
                self.dropped += chunk.rows  # taken all the same, so that nobody waits for room
                continue
            try:
                self._write(chunk.frame())
            except BaseException as error:  # noqa: BLE001 - polars panics outside Exception; the caller is told
                self._fault = error
                self.dropped += chunk.rows

    def _write(self, frame: "pl.DataFrame") -> None:
        if not len(frame):
            return
        write_file(frame, part_file(self._folder, self._name, self._parts))
        self._parts += 1
        self.rows += len(frame)

    def _write_empty(self) -> None:
        import polars as pl

        write_file(pl.DataFrame(schema=self._schema), part_file(self._folder, self._name, 0))

    def _refuse(self) -> None:
        if self._fault is not None:
            raise self._failed(self._fault) from self._fault

    def _failed(self, fault: BaseException) -> RecordFailed:
        return RecordFailed(f"{self._folder / self._name}: {fault}; what was written before stays")
