"""Tables in CSV or Parquet files; damaged or unsuitable files are refused in one line."""

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
import polars as pl

from swarmwire.comms.base.arrays import BoolArray, FloatArray
from swarmwire.comms.base.errors import BadInput

SUFFIXES = (".csv", ".parquet")


def corruption_errors() -> tuple[type[BaseException], ...]:
    """Return the exceptions that polars raises for a damaged file: its errors and its panics.

    A panic is no Exception; polars also prints it on stderr.
    """
    return (pl.exceptions.PolarsError, pl.exceptions.PanicException)


def read_parquet(file: Path, columns: list[str] | None = None, advice: str = "") -> pl.DataFrame:
    """Read a Parquet file; BadInput names the file if it is damaged or cannot be read, with advice to the user."""
    try:
        return pl.read_parquet(file, columns=columns)
    except (OSError, *corruption_errors()) as error:
        panic = isinstance(error, pl.exceptions.PanicException)
        reason = "polars gave up on it" if panic else str(error).partition("\n")[0]
        expected = f"expected an intact Parquet file: {reason}"
        raise BadInput(str(file), "", f"{expected}{advice and '; '}{advice}") from None


def refuse_corrupt(files: Iterable[Path], advice: str = "") -> None:
    """Raise BadInput for the first Parquet file that is damaged, or whose columns differ in type from those before.

    This finds the file after reading all of them together failed.
    """
    kinds: dict[str, pl.DataType] = {}
    for file in files:
        for name, kind in read_parquet(file, advice=advice).schema.items():
            if kinds.setdefault(name, kind) != kind:
                expected = f"expected {kinds[name]} as in the files before it, got {kind}"
                raise BadInput(str(file), name, f"{expected}{advice and '; '}{advice}")


class MeasuredTable:
    """A table of a user's file. Rows count from 1, without a CSV's header."""

    def __init__(self, path: Path) -> None:
        """Read the file; BadInput if it is neither CSV nor Parquet, or has no row."""
        self.where = str(path)
        self._frame = _read(path)
        if not len(self._frame):
            raise self.refused("", "expected at least one row")

    @property
    def columns(self) -> tuple[str, ...]:
        """The names of the columns."""
        return tuple(self._frame.columns)

    def need(self, columns: Sequence[str]) -> None:
        """Raise BadInput if a column is missing."""
        for column in columns:
            if column not in self._frame.columns:
                raise self.refused(column, f"is missing; the file has {', '.join(self._frame.columns)}")

    def numbers(self, column: str) -> FloatArray:
        """Return a column (rows,), NaN for empty cells; BadInput if a cell is no finite number."""
        cells = self._frame[column]
        values = cells.cast(pl.Float64, strict=False).to_numpy().astype(np.float64)
        is_filled = cells.is_not_null().to_numpy()
        self.refuse_where(is_filled & ~np.isfinite(values), column, "expected a finite number, or nothing")
        return values

    def texts(self, column: str) -> list[str]:
        """Return a column of names (rows,); BadInput if a cell is empty."""
        cells = self._frame[column].cast(pl.String)
        self.refuse_where(cells.is_null().to_numpy(), column, "expected a name")
        return cells.to_list()

    def refuse_where(self, wrong: BoolArray, column: str, expected: str) -> None:
        """Raise BadInput for the first row with `wrong` (rows,) True, if any."""
        if wrong.any():
            raise self.refused(f"row {int(np.argmax(wrong)) + 1}, {column}", expected)

    def refused(self, key: str, expected: str) -> BadInput:
        """Return a BadInput about this file."""
        return BadInput(self.where, key, expected)


def _read(path: Path) -> pl.DataFrame:
    if path.suffix.lower() not in SUFFIXES:
        raise BadInput(str(path), "", f"expected a file name that ends in {' or '.join(SUFFIXES)}")
    try:
        with path.open("rb") as file:
            if path.suffix.lower() == ".parquet":
                return pl.read_parquet(file)
            return pl.read_csv(file, infer_schema_length=None, null_values=["", "nan", "NaN", "null"])
    except OSError as error:
        raise BadInput(str(path), "", f"expected a readable file: {error.strerror}") from None
    except corruption_errors() as error:
        raise BadInput(str(path), "", f"expected a table: {str(error).splitlines()[0]}") from None
