"""Writer of a campaign's folder: a part for each finished task, and one table of all runs at the end.

    campaign.json, scenario/       provenance; written first
    parts/part-N.parquet           rows of a finished task, numbered in the order of their ends
    series/part-RUN.parquet        its tick series, written before its rows, named after their first run
    summary.parquet                all rows, by run; then the parts are removed (until then, parts have precedence)
    series/worker-N.parquet        all tick series, by run: a few files, each of consecutive runs

Each file is written atomically.
"""

import shutil
from collections.abc import Collection, Generator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING

from swarmwire.comms.base.atomic import atomic_write, make_subfolder, refuse_link, write_bytes
from swarmwire.comms.base.errors import BadInput, SwarmwireError
from swarmwire.deploy.campaigns.columns import COUNTS, ResultColumns, Row
from swarmwire.deploy.campaigns.worker import TaskResult
from swarmwire.metrics.records.campaign.campaign_json import FAILED, PARTS, SCENARIO_FOLDER, SERIES, SUMMARY, Campaign
from swarmwire.metrics.records.run_folder.layout import SCENARIO
from swarmwire.metrics.records.run_folder.writer import PARQUET
from swarmwire.metrics.records.table_file import corruption_errors, read_parquet, refuse_corrupt

if TYPE_CHECKING:
    import polars as pl

RUNS = "runs"
NUMBERED = "part-" + "[0-9]" * 8 + ".parquet"
ROWS_LOST = "without the file, --resume repeats its runs"
SERIES_LOST = "without the file its runs stay in the table, but not their series"


class StorageFailed(SwarmwireError):
    """The folder of a campaign or of a tuning cannot be written."""


@contextmanager
def storing(folder: Path, command: str = "sweep") -> Generator[None]:
    """Turn errors of the disk in the block into StorageFailed, one line; `command --resume` continues the folder."""
    try:
        yield
    except (OSError, *corruption_errors()) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        text = f"{folder}: cannot be written: {reason}; finished rows are kept: swarmwire {command} --resume {folder}"
        raise StorageFailed(text) from error


class CampaignWriter:
    """Writes and resumes the folder of a campaign. StorageFailed if it cannot be written.

    Attributes:
        path: the folder.
        campaign: content of its `campaign.json`.
    """

    def __init__(self, path: Path, campaign: Campaign) -> None:
        self.path, self.campaign, self._columns = path, campaign, ResultColumns(campaign)

    @property
    def scenario(self) -> Path:
        """Absolute path of the scenario's file, for tasks."""
        return (self.path / SCENARIO_FOLDER / SCENARIO).absolute()

    def run_folder(self, run: int) -> Path:
        """Return the path of the run folder of a recorded run."""
        return (self.path / RUNS / f"run-{run:06d}").absolute()

    def clear(self) -> None:
        """Remove incomplete files of a killed campaign."""
        with storing(self.path):
            subfolders = [self.path / name for name in (PARTS, SERIES, RUNS)]
            for folder in subfolders:
                refuse_link(folder)
            for folder in (self.path, *subfolders):
                for temporary in folder.glob(".aside-*"):
                    is_folder = temporary.is_dir() and not temporary.is_symlink()
                    shutil.rmtree(temporary) if is_folder else temporary.unlink()
            _remove_stale_series(self.path / SERIES, self.ended())

    def write(self, result: TaskResult) -> None:
        """Write the rows and the series of a finished task."""
        points = self.campaign.points
        rows: list[Row] = [{**row, **points[row["point"]]} for row in result.rows]
        with storing(self.path):
            if result.series is not None:
                first = next(row["run"] for row in rows if row["ended"] != FAILED)
                _write(self.path / SERIES / f"part-{first:08d}.parquet", result.series)
            _write(self._next_part(), _parquet(self._columns.frame(rows)))

    def rows(self) -> "pl.DataFrame":
        """Read all rows on disk, by run; BadInput names a file that is damaged, or of another campaign."""
        summary = self.path / SUMMARY
        files = [*([summary] if summary.exists() else []), *_parts(self.path / PARTS)]
        empty = self._columns.frame([])
        tables = [_table(file, empty.schema, self.campaign.runs) for file in files]
        try:
            return self._columns.joined([empty, *tables])
        except corruption_errors():
            refuse_corrupt(files, ROWS_LOST)
            raise

    def ended(self) -> dict[int, str]:
        """Return the value of the column `ended` of each run that has a row."""
        rows = self.rows()
        return dict(zip(rows["run"], rows["ended"], strict=True))

    def finish(self, files: int) -> None:
        """Write the table of all runs, and join the series to at most `files` new files."""
        with storing(self.path):
            _join_series(self.path / SERIES, files)
            parts = _parts(self.path / PARTS)
            if parts:
                _write(self.path / SUMMARY, _parquet(self.rows()))
            for part in parts:
                part.unlink()
            if (self.path / PARTS).is_dir() and not any((self.path / PARTS).iterdir()):
                (self.path / PARTS).rmdir()

    def _next_part(self) -> Path:
        """Return the next part's path; if two parts have a row of a run, the later one has precedence."""
        last = max(map(_number, _parts(self.path / PARTS)), default=-1)
        return self.path / PARTS / f"part-{last + 1:08d}.parquet"


def _parts(folder: Path) -> list[Path]:
    return sorted(folder.glob(NUMBERED))


def _number(part: Path) -> int:
    return int(part.stem.partition("-")[2])


def _table(file: Path, schema: "pl.Schema", runs: int) -> "pl.DataFrame":
    """Read the rows in a file; BadInput unless it has this campaign's columns and runs."""
    import polars as pl

    frame = read_parquet(file, advice=ROWS_LOST)
    counts = dict.fromkeys((name for name in frame.columns if name.startswith(COUNTS)), pl.Int64())
    for name, kind in {**schema, **counts}.items():
        if frame.schema.get(name) != kind:
            raise BadInput(str(file), name, f"expected this column of the campaign's table, as {kind}; {ROWS_LOST}")
    if not frame["run"].is_between(0, runs - 1).fill_null(value=False).all():
        raise BadInput(str(file), "run", f"expected runs from 0 to {runs - 1}; {ROWS_LOST}")
    if frame["ended"].null_count():
        raise BadInput(str(file), "ended", f"expected how each run ended; {ROWS_LOST}")
    return frame


def _remove_stale_series(folder: Path, done: Collection[int]) -> None:
    """Remove parts of tasks whose rows were never written (runs not in `done`), and parts that were joined."""
    parts = _parts(folder)
    joined: set[int] = {run for file in folder.glob("worker-*.parquet") for run in _runs(file)} if parts else set()
    for part in parts:
        if _number(part) not in done or _number(part) in joined:
            part.unlink()


def _join_series(folder: Path, files: int) -> None:
    """Join all parts to at most `files` files `worker-N.parquet` of consecutive runs, in a streaming manner."""
    import polars as pl

    parts = _parts(folder)
    for part in parts:
        _runs(part)  # raises BadInput for a damaged file before any part is joined
    first, count = len(list(folder.glob("worker-*.parquet"))), min(files, len(parts))
    for number in range(count):
        share = parts[len(parts) * number // count : len(parts) * (number + 1) // count]
        with atomic_write(folder / f"worker-{first + number}.parquet") as temporary:
            try:
                pl.concat([pl.scan_parquet(part) for part in share], how="diagonal").sink_parquet(temporary, **PARQUET)
            except corruption_errors():
                refuse_corrupt(share, SERIES_LOST)
                raise
        for part in share:
            part.unlink()


def _runs(file: Path) -> set[int]:
    """Return the runs whose series are in a file; BadInput if it is damaged."""
    return set(read_parquet(file, ["run"], SERIES_LOST)["run"])


def _parquet(frame: "pl.DataFrame") -> bytes:
    file = BytesIO()  # a full disk then raises OSError in `_write`, not an error of polars
    frame.write_parquet(file, **PARQUET)
    return file.getvalue()


def _write(path: Path, data: bytes) -> None:
    make_subfolder(path.parent)
    write_bytes(path, data)
