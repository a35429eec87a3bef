"""The tick series of a campaign on disk: a part per task while it goes on, a few files once it is over."""

from collections.abc import Collection
from pathlib import Path

from swarmwire.metrics.atomic import atomic_write
from swarmwire.metrics.run_folder.writer import PARQUET
from swarmwire.metrics.table_file import corruption_errors, read_parquet, refuse_corrupt

MEND = "without the file its runs stay in the table, but not their series"


def series_part(folder: Path, run: int) -> Path:
    """The part whose first run is this."""
    return folder / f"part-{run:08d}.parquet"


def sort_out_series(folder: Path, done: Collection[int]) -> None:
    """Take away parts of tasks whose rows were never written (runs that are not in `done`), or that were joined."""
    parts, files = _parts(folder), list(folder.glob("worker-*.parquet"))
    if not parts:
        return
    joined: set[int] = {run for file in files for run in _runs(file)}
    for part in parts:
        run = int(part.stem.partition("-")[2])
        if run not in done or run in joined:
            part.unlink()


def join_series(folder: Path, files: int) -> None:
    """Make of all parts at most so many files, `worker-N.parquet`, each a stretch of runs; read part by part."""
    import polars as pl

    parts = _parts(folder)
    for part in parts:
        _runs(part)  # damaged files are told by their name, before anything is joined
    first, count = len(list(folder.glob("worker-*.parquet"))), min(files, len(parts))
    for number in range(count):
        share = parts[len(parts) * number // count : len(parts) * (number + 1) // count]
        with atomic_write(folder / f"worker-{first + number}.parquet") as aside:
            try:
                pl.concat([pl.scan_parquet(part) for part in share], how="diagonal").sink_parquet(aside, **PARQUET)
            except corruption_errors():
                refuse_corrupt(share, MEND)
                raise
        for part in share:
            part.unlink()


def _runs(file: Path) -> set[int]:
    """Whose series it holds; BadInput if it is damaged."""
    return set(read_parquet(file, ["run"], MEND)["run"])


def _parts(folder: Path) -> list[Path]:
    return sorted(folder.glob("part-" + "[0-9]" * 8 + ".parquet"))
