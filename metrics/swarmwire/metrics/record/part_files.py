"""A table on disk: numbered part files while a run goes on, one file once it is over.

`NAME/part-000000.parquet` and so on become `NAME.parquet`. Each file is written aside and renamed, so whatever carries
its name is whole: a Parquet file that is cut off is unreadable.
"""

from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

from swarmwire.metrics.atomic import atomic_write

if TYPE_CHECKING:
    import polars as pl

# Level 3 saves nothing on poses. Statistics of lists take seven times as long as all the rest.
PARQUET: dict[str, Any] = {"compression": "zstd", "compression_level": 1, "statistics": False}


def table_file(folder: Path, name: str) -> Path:
    """The table of a run that ended."""
    return folder / f"{name}.parquet"


def part_file(folder: Path, name: str, number: int) -> Path:
    """A part of a table whose run goes on, or was killed."""
    return folder / name / f"part-{number:06d}.parquet"


def parts_of(folder: Path, name: str) -> list[Path]:
    """The parts that are there, in order; none once they are joined."""
    return sorted((folder / name).glob("part-*.parquet"))


def scan_files(files: list[Path]) -> "pl.LazyFrame":
    """The rows of a table's files, one or more, in order.

    What only later files have, since it was not there to be told before, is null in the rows of those before, of lists
    of a fixed length each item. Raises what polars raises of files that are damaged or of other types.
    """
    import polars as pl

    first, schema = pl.read_parquet_schema(files[0]), pl.read_parquet_schema(files[-1])
    later = {name: kind for name, kind in schema.items() if name not in first}
    if not later:
        return pl.scan_parquet(files)
    table = pl.scan_parquet(files, schema=schema, missing_columns="insert")
    lists = {name: kind for name, kind in later.items() if isinstance(kind, pl.Array)}
    return table.with_columns(
        pl.col(name).fill_null(pl.lit([None] * kind.size, dtype=kind)) for name, kind in lists.items()
    )


def write_file(frame: "pl.DataFrame", path: Path) -> None:
    """Write a frame under this name, all of it or nothing; OSError if the disk will not have it."""
    data = BytesIO()  # in memory first: what a full disk then says is an OSError
    frame.write_parquet(data, **PARQUET)
    with atomic_write(path) as aside:
        aside.write_bytes(data.getbuffer())


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
