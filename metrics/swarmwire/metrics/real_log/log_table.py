"""A table of a robot's log: a CSV that may end in half a line, if the robot was killed."""

from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from swarmwire.comms.arrays import FloatArray, IntArray
from swarmwire.comms.errors import BadInput
from swarmwire.metrics.table_file import MeasuredTable, corruption_errors

if TYPE_CHECKING:
    import polars as pl

LATEST_S = 9e9  # whose nanoseconds fit an integer


class LogTable(MeasuredTable):
    """The whole lines of a file, of which there may be none.

    Attributes:
        half_line: whether the file ended in half a line, which was dropped.
    """

    def __init__(self, path: Path, columns: Sequence[str]) -> None:
        """Read the file, all columns as texts; BadInput unless it has these columns, or if a line has others."""
        import polars as pl

        self.where = str(path)
        whole, half = _whole_lines(path)
        self.half_line = half
        try:
            self._frame = pl.read_csv(BytesIO(whole), infer_schema=False) if whole else _empty(columns)
        except corruption_errors() as error:
            raise self.refused("", f"expected a table of a robot's log: {str(error).splitlines()[0]}") from None
        self.need(columns)

    def __len__(self) -> int:
        return len(self._frame)

    def known(self, column: str, expected: str) -> FloatArray:
        """A column (rows,) without empty fields; BadInput where there is one."""
        values = self.numbers(column)
        self.refuse_where(np.isnan(values), column, f"expected {expected}")
        return values

    def times_s(self) -> FloatArray:
        """The column t_s (rows,), UTC since 1970; BadInput for what is no time."""
        values = self.known("t_s", "a time in s")
        self.refuse_where(np.abs(values) >= LATEST_S, "t_s", "expected a time in s since 1970")
        return values

    def whole_numbers(self, column: str) -> IntArray:
        """A column (rows,) of whole numbers; BadInput for others."""
        values = self.known(column, "a whole number")
        self.refuse_where((np.abs(values) >= 2.0**53) | (values % 1 != 0), column, "expected a whole number")
        return values.astype(np.int64)

    def words(self, column: str) -> list[str]:
        """A column (rows,) of texts, of which some may be empty."""
        return self._frame[column].fill_null("").to_list()


def _whole_lines(path: Path) -> tuple[bytes, bool]:
    """The lines that were written to their end, and whether there was half of one more."""
    try:
        whole, end, half = path.read_bytes().rpartition(b"\n")
    except OSError as error:
        raise BadInput(str(path), "", f"expected a table of a robot's log: {error.strerror}") from None
    return whole + end, bool(half)


def _empty(columns: Sequence[str]) -> "pl.DataFrame":
    import polars as pl

    return pl.DataFrame(schema=dict.fromkeys(columns, pl.String))
