"""A CSV file that only ever grows by whole lines, and whose disk may be full."""

import csv
import io
import os
from contextlib import suppress
from pathlib import Path

MOST_WAITING = 1 << 20  # bytes that may wait for a flush


class RowFile:
    """Rows are kept until `flush`; what cannot be written then is dropped and counted.

    Attributes:
        lost_rows: how many rows were dropped.
        fault: why the last flush failed, or None.
    """

    def __init__(self, path: Path, columns: tuple[str, ...]) -> None:
        self.lost_rows = 0
        self.fault: OSError | None = None
        self._file = path.open("wb", buffering=0)
        self._whole_bytes = 0  # up to the last line that is whole
        self._header = (",".join(columns) + "\n").encode()
        self._waiting = io.StringIO()
        self._rows = 0  # that wait
        self._writer = csv.writer(self._waiting, lineterminator="\n")

    def write(self, row: tuple[object, ...]) -> None:
        """Add a row; None is an empty field."""
        self._writer.writerow(row)
        self._rows += 1
        if self._waiting.tell() > MOST_WAITING:
            self.flush()

    def flush(self) -> None:
        """Hand the rows to the disk, whole lines only."""
        rows = self._waiting.getvalue().encode()
        try:
            self._append(rows if self._whole_bytes else self._header + rows)
            self.fault = None
        except OSError as error:
            self.lost_rows += self._rows
            self.fault = error
        self._rows = 0
        self._waiting.seek(0)
        self._waiting.truncate()

    def _append(self, data: bytes) -> None:
        left = memoryview(data)
        try:
            while left:
                left = left[self._file.write(left) or 0 :]
        except OSError:
            with suppress(OSError):  # what is no regular file has no end to cut off
                os.ftruncate(self._file.fileno(), self._whole_bytes)
                self._file.seek(self._whole_bytes)
            raise
        self._whole_bytes += len(data)

    def close(self) -> None:
        """Flush and close; safe to call more than once."""
        if not self._file.closed:
            self.flush()
            self._file.close()
