"""Tables of poses, `.csv` and `.parquet`: a row per sample with t_s, robot, x_m, y_m and, if present, z_m, heading_rad.

The columns may be in any order, and others are ignored. Rows may be sorted by time or by robot. An empty heading is one
that is not given.
"""

from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from swarmwire.comms.base.arrays import FloatArray, IntArray
from swarmwire.comms.base.errors import BadInput
from swarmwire.world.motion.traces.lines import MAX_NUMBER, refuse_empty
from swarmwire.world.motion.traces.trace import PLANE, MotionTrace, T

NEEDED = ("t_s", "robot", "x_m", "y_m")
NUMBERS = ("t_s", "x_m", "y_m")
OPTIONAL = {"z_m": 0.0, "heading_rad": np.nan}  # with the number where the table lacks the column
HEADER_LINES = 1


def read(path: Path) -> MotionTrace:
    """Read a table; its robots are in the order of their first rows."""
    table = TraceTable(path)
    names, first, order = table.robots()
    rows = table.numbers() if order is None else table.numbers()[order]
    t_s = rows[:, T]
    goes_back = t_s[1:] < t_s[:-1]
    goes_back[first[1:-1] - 1] = False  # from the last sample of a robot to the first one of the next
    if goes_back.any():
        sample = int(np.argmax(goes_back)) + 1
        row = sample if order is None else int(order[sample])
        raise table.refused(row, "t_s", f"expected rising times of each robot, got {t_s[sample]:g} s")
    return MotionTrace(names, first, rows)


def write(path: Path, trace: MotionTrace) -> None:
    """Write a table sorted by robot and time."""
    import polars as pl

    robot = np.repeat(np.arange(len(trace.names), dtype=np.uint32), np.diff(trace.first))
    frame = pl.DataFrame(
        {
            "t_s": trace.t_s,
            "robot": pl.Series(trace.names).gather(pl.Series(robot)),
            "x_m": trace.x_m,
            "y_m": trace.y_m,
            "z_m": trace.z_m,
            "heading_rad": pl.Series(trace.heading_rad, nan_to_null=True),
        }
    )
    if path.suffix.lower() == ".parquet":
        frame.write_parquet(path)
    else:
        frame.write_csv(path)


@contextmanager
def refuse_damage(path: Path) -> Generator[None]:
    """Raise BadInput if a table cannot be read within the context."""
    import polars as pl

    try:
        yield
    except OSError as error:
        raise BadInput(str(path), "", f"expected a readable file: {error.strerror}") from None
    except pl.exceptions.NoDataError:
        raise refuse_empty(path) from None
    except (pl.exceptions.PolarsError, pl.exceptions.PanicException) as error:
        reason = str(error).partition("\n")[0]
        raise BadInput(str(path), "", f"expected an intact table: {reason}") from None


class TraceTable:
    """The columns of a file; BadInput names its row or line, and the column."""

    def __init__(self, path: Path) -> None:
        """Read the columns that a trace has; BadInput if one is missing, or there is no row."""
        self._path, self._is_csv = path, path.suffix.lower() == ".csv"
        self._frame = self._read()
        if not len(self._frame):
            raise refuse_empty(path)

    def _read(self) -> Any:
        import polars as pl

        with refuse_damage(self._path), self._path.open("rb") as file:
            if self._is_csv:
                frame = pl.read_csv(file, infer_schema=False).rename(str.strip)
                return frame.select(pl.col(self._columns(frame.columns)).str.strip_chars())
            columns = self._columns(list(pl.read_parquet_schema(file)))
            file.seek(0)
            return pl.read_parquet(file, columns=columns)

    def _columns(self, columns: list[str]) -> list[str]:
        for column in NEEDED:
            if column not in columns:
                raise BadInput(str(self._path), column, f"is missing; the table has {', '.join(columns)}")
        return [column for column in (*NEEDED, *OPTIONAL) if column in columns]

    def numbers(self) -> FloatArray:
        """Return the rows of a trace, (rows, 3) or, with heights or headings, (rows, 5)."""
        import polars as pl

        columns = {name: self._numbers(name) for name in (*NUMBERS, *OPTIONAL) if name in self._frame.columns}
        if len(columns) > PLANE:
            lacking = {name: pl.repeat(number, len(self._frame), eager=True) for name, number in OPTIONAL.items()}
            columns = {**lacking, **columns}
        return pl.DataFrame(columns).select(NUMBERS + tuple(OPTIONAL)[: len(columns) - PLANE]).to_numpy(order="c")

    def _numbers(self, column: str) -> Any:
        """Return a column; BadInput for its first cell that is no number. A heading may be empty or NaN."""
        import polars as pl

        cells = self._frame[column]
        if not (cells.dtype.is_numeric() or cells.dtype in (pl.String, pl.Null)):
            raise BadInput(str(self._path), column, f"expected numbers, got the type {cells.dtype}")
        numbers = cells.cast(pl.Float64, strict=False)
        is_valid = numbers.is_between(-MAX_NUMBER, MAX_NUMBER)
        if column == "heading_rad":
            is_valid = is_valid | numbers.is_nan() | cells.is_null()
        is_valid = is_valid.fill_null(False)
        if not is_valid.all():
            row = int((~is_valid).arg_max())
            raise self.refused(row, column, f"expected a number of at most {MAX_NUMBER:g}, got {cells[row]!r}")
        return numbers

    def robots(self) -> tuple[tuple[str, ...], IntArray, IntArray | None]:
        """Return the names of the robots by first appearance, the bounds of each one's rows, and the order of the rows.

        Without an order, the rows of each robot are together already.
        """
        import polars as pl

        cells = self._frame["robot"]
        if cells.null_count():
            raise self.refused(int(cells.is_null().arg_max()), "robot", "expected the name of a robot")
        if not (cells.dtype.is_integer() or cells.dtype in (pl.String, pl.Categorical, pl.Enum)):
            raise BadInput(str(self._path), "robot", f"expected names or numbers, got the type {cells.dtype}")
        named = cells if cells.dtype.is_integer() else cells.cast(pl.String)
        stretches = named.rle().struct.unnest()
        names, counts, order = stretches["value"], stretches["len"].to_numpy(), None
        if names.n_unique() < len(names):
            names = named.unique(maintain_order=True)
            kind = pl.UInt16 if len(names) < 1 << 16 else pl.UInt32  # 16 bits are sorted in a fifth of the time
            if named.dtype == pl.String:
                index = named.cast(pl.Enum(names)).to_physical().cast(kind).to_numpy()
            else:
                index = named.replace_strict(names, range(len(names)), return_dtype=kind).to_numpy()
            counts, order = np.bincount(index), np.argsort(index, kind="stable")
        return tuple(map(str, names.to_list())), np.cumsum([0, *counts], dtype=np.int64), order

    def refused(self, row: int, column: str, expected: str) -> BadInput:
        """Return a BadInput about a row."""
        key = f"line {row + 1 + HEADER_LINES}" if self._is_csv else f"row {row + 1}"
        return BadInput(str(self._path), f"{key}, {column}", expected)
