"""The folder of a campaign while it is written: finished tasks at once, one table of all runs at the end.

    campaign.json, scenario/       from what it is made; written first
    parts/part-N.parquet           rows of a finished task, numbered as they came
    series/part-RUN.parquet        its tick series, written before its rows, named after the first run in it
    summary.parquet                all rows, by run; then the parts go (of runs that are tried again, parts come first)
    series/worker-N.parquet        all tick series, by run

Each file is written aside and renamed, so that what has its name is whole.
"""

import shutil
from collections.abc import Generator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING

from swarmwire.comms.errors import BadInput
from swarmwire.deploy.campaign.campaign import SCENARIO_FOLDER, Campaign
from swarmwire.deploy.campaign.columns import COUNTS
from swarmwire.deploy.campaign.series_files import join_series, series_part, sort_out_series
from swarmwire.deploy.campaign.storage import storing
from swarmwire.deploy.campaign.taken import taken
from swarmwire.deploy.campaign.task import Row, TaskResult
from swarmwire.metrics.atomic import atomic_write
from swarmwire.metrics.campaign.formats import FAILED, PARTS, SERIES, SUMMARY
from swarmwire.metrics.run_folder.layout import SCENARIO
from swarmwire.metrics.run_folder.writer import PARQUET
from swarmwire.metrics.table_file import corruption_errors, read_parquet, refuse_corrupt

if TYPE_CHECKING:
    import polars as pl

RUNS = "runs"
MEND = "without the file --resume runs again what it held"
NUMBER = "[0-9]" * 8


class CampaignFolder:
    """What is written into the folder of one campaign, and what is there already. StorageFailed if the disk refuses.

    Attributes:
        path: the folder.
        campaign: what stands in its `campaign.json`.
    """

    def __init__(self, path: Path, campaign: Campaign) -> None:
        self.path, self.campaign, self._columns = path, campaign, campaign.columns()

    @property
    def scenario(self) -> Path:
        """The scenario's file, as tasks name it."""
        return (self.path / SCENARIO_FOLDER / SCENARIO).absolute()

    def run_folder(self, run: int) -> Path:
        """Where a run that is recorded in full has its folder."""
        return (self.path / RUNS / f"run-{run:06d}").absolute()

    @contextmanager
    def taken(self) -> Generator[None]:
        """Keep the folder for this process while the block lasts; BadInput if another process has it."""
        with taken(self.path, "campaign"):
            yield

    def clear(self) -> None:
        """Take away what a killed campaign left half done."""
        with storing(self.path):
            for folder in (self.path, self.path / PARTS, self.path / SERIES, self.path / RUNS):
                for aside in folder.glob(".aside-*"):
                    shutil.rmtree(aside) if aside.is_dir() else aside.unlink()
            sort_out_series(self.path / SERIES, self.ended())

    def keep(self, result: TaskResult) -> None:
        """Write the rows and the series of a finished task."""
        points = self.campaign.points
        rows: list[Row] = [{**row, **points[row["point"]]} for row in result.rows]
        with storing(self.path):
            if result.series is not None:
                first = next(row["run"] for row in rows if row["ended"] != FAILED)
                _write(series_part(self.path / SERIES, first), result.series)
            _write(self._next_part(), _parquet(self._columns.frame(rows)))

    def rows(self) -> "pl.DataFrame":
        """All rows that are there, by run; BadInput names a file that is damaged, or of another campaign."""
        whole = self.path / SUMMARY
        files = [*([whole] if whole.exists() else []), *self._parts()]
        none = self._columns.frame([])
        tables = [_table(file, none.schema, self.campaign.runs) for file in files]
        try:
            return self._columns.joined([none, *tables])
        except corruption_errors():
            refuse_corrupt(files, MEND)
            raise

    def ended(self) -> dict[int, str]:
        """By run that has a row: how it ended."""
        rows = self.rows()
        return dict(zip(rows["run"], rows["ended"], strict=True))

    def finish(self, files: int) -> None:
        """Make the table of all runs, and at most so many new files of the series."""
        with storing(self.path):
            join_series(self.path / SERIES, files)
            parts = self._parts()
            if parts:
                _write(self.path / SUMMARY, _parquet(self.rows()))
            for part in parts:
                part.unlink()
            if (self.path / PARTS).is_dir() and not any((self.path / PARTS).iterdir()):
                (self.path / PARTS).rmdir()

    def _next_part(self) -> Path:
        """A name after all that are there: where two have a row of a run, that of the later counts."""
        last = max((int(part.stem.partition("-")[2]) for part in self._parts()), default=-1)
        return self.path / PARTS / f"part-{last + 1:08d}.parquet"

    def _parts(self) -> list[Path]:
        return sorted((self.path / PARTS).glob(f"part-{NUMBER}.parquet"))


def _table(file: Path, schema: "pl.Schema", runs: int) -> "pl.DataFrame":
    import polars as pl

    frame = read_parquet(file, cure=MEND)
    counts = dict.fromkeys((name for name in frame.columns if name.startswith(COUNTS)), pl.Int64())
    for name, kind in {**schema, **counts}.items():
        if frame.schema.get(name) != kind:
            raise BadInput(str(file), name, f"expected this column of the campaign's table, as {kind}; {MEND}")
    if not frame["run"].is_between(0, runs - 1).fill_null(value=False).all():
        raise BadInput(str(file), "run", f"expected runs from 0 to {runs - 1}; {MEND}")
    if frame["ended"].null_count():
        raise BadInput(str(file), "ended", f"expected how each run ended; {MEND}")
    return frame


def _parquet(frame: "pl.DataFrame") -> bytes:
    # In memory first: what a full disk then says is an OSError.
    file = BytesIO()
    frame.write_parquet(file, **PARQUET)
    return file.getvalue()


def _write(path: Path, data: bytes) -> None:
    path.parent.mkdir(exist_ok=True)
    with atomic_write(path) as aside:
        aside.write_bytes(data)
