"""Tables in files, CSV or Parquet: what is damaged or does not fit is refused in one line."""

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
import polars as pl

from swarmwire.comms.base.arrays import BoolArray, FloatArray
from swarmwire.comms.base.errors import BadInput

SUFFIXES = (".csv", ".parquet")


def corruption_errors() -> tuple[type[BaseException], ...]:
    """What polars raises for a damaged file: its errors, and panics where its own assumptions break.

    A panic is no Exception; polars also prints it on stderr.
    """
    return (pl.exceptions.PolarsError, pl.exceptions.PanicException)


def read_parquet(file: Path, columns: list[str] | None = None, cure: str = "") -> pl.DataFrame:
    """What a Parquet file holds; BadInput names it if it is damaged or cannot be read, with what can be done."""
    try:
        return pl.read_parquet(file, columns=columns)
    except (OSError, *corruption_errors()) as error:
        panic = isinstance(error, pl.exceptions.PanicException)
        why = "polars gave up on it" if panic else str(error).partition("\n")[0]
        raise BadInput(str(file), "", f"expected a whole Parquet file: {why}{cure and '; '}{cure}") from None


def refuse_corrupt(files: Iterable[Path], cure: str = "") -> None:
    """BadInput for the first of these Parquet files that is damaged, or has a column of another type than one before.

    Used after reading them together failed, to find the file.
    """
    kinds: dict[str, pl.DataType] = {}
    for file in files:
        for name, kind in read_parquet(file, cure=cure).schema.items():
            if kinds.setdefault(name, kind) != kind:
                expected = f"expected {kinds[name]} as in the files before it, got {kind}"
                raise BadInput(str(file), name, f"{expected}{cure and '; '}{cure}")


class MeasuredTable:
    """A table as it lies on disk. Rows count from 1; a CSV's line of names is none of them."""

    def __init__(self, path: Path) -> None:
        """Read the file; BadInput for one that is neither CSV nor Parquet, or without a row."""
        self.where = str(path)
        self._frame = _read(path)
        if not len(self._frame):
            raise self.refused("", "expected at least one row")

    @property
    def columns(self) -> tuple[str, ...]:
        """The names of the columns."""
        return tuple(self._frame.columns)

    def need(self, columns: Sequence[str]) -> None:
        """BadInput unless there are all these columns."""
        for column in columns:
            if column not in self._frame.columns:
                raise self.refused(column, f"is missing; the file has {', '.join(self._frame.columns)}")

    def numbers(self, column: str) -> FloatArray:
        """A column (rows,), NaN where it is empty; BadInput for what is no finite number."""
        taken = self._frame[column]
        cast = taken.cast(pl.Float64, strict=False)
        known = taken.is_not_null().to_numpy()
        values = cast.to_numpy().astype(np.float64)
        self.refuse_where(known & ~np.isfinite(values), column, "expected a finite number, or nothing")
        return values

    def texts(self, column: str) -> list[str]:
        """A column of names (rows,); BadInput where one is empty."""
        taken = self._frame[column].cast(pl.String)
        self.refuse_where(taken.is_null().to_numpy(), column, "expected a name")
        return taken.to_list()

    def refuse_where(self, wrong: BoolArray, column: str, expected: str) -> None:
        """BadInput that names the first row (rows,) that is wrong; else nothing."""
        if wrong.any():
            raise self.refused(f"row {int(np.argmax(wrong)) + 1}, {column}", expected)

    def refused(self, key: str, expected: str) -> BadInput:
        """What to raise about this file."""
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
