"""The folder of a campaign while it is written: finished pieces at once, one table of all runs at the end.

    campaign.json, scenario/       from what it is made; written first
    parts/part-RUN.parquet         rows of a finished piece, named after its first run
    series/part-RUN.parquet        its tick series, written before its rows, named after the first run in it
    summary.parquet                all rows, by run; once it is there the campaign is over, and the parts go
    series/worker-N.parquet        all tick series, by run

Each file is written aside and renamed, so that what has its name is whole.
"""

import fcntl
import os
import shutil
from collections.abc import Generator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING

from swarmwire.comms.errors import BadInput
from swarmwire.deploy.campaign.campaign import SCENARIO_FOLDER, Campaign
from swarmwire.deploy.campaign.row import FAILED
from swarmwire.deploy.campaign.series_files import join_series, series_part, sort_out_series
from swarmwire.deploy.campaign.storage import storing
from swarmwire.deploy.campaign.task import PieceResult, Row
from swarmwire.metrics.record.names import SCENARIO
from swarmwire.metrics.record.part_files import PARQUET
from swarmwire.metrics.whole_file import written_aside

if TYPE_CHECKING:
    import polars as pl

SUMMARY, PARTS, SERIES, RUNS = "summary.parquet", "parts", "series", "runs"


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

    @property
    def is_over(self) -> bool:
        """Whether the table of all runs is there."""
        return (self.path / SUMMARY).exists()

    def run_folder(self, run: int) -> Path:
        """Where a run that is recorded in full has its folder."""
        return (self.path / RUNS / f"run-{run:06d}").absolute()

    @contextmanager
    def taken(self) -> Generator[None]:
        """Keep the folder for this process while the block lasts; BadInput if another process has it."""
        descriptor = os.open(self.path, os.O_RDONLY)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)  # let go by the system, however we end
            yield
        except BlockingIOError:
            raise BadInput(str(self.path), "", "another process is at work on this campaign") from None
        finally:
            os.close(descriptor)

    def clear(self) -> None:
        """Take away what a killed campaign left half done."""
        with storing(self.path):
            for folder in (self.path, self.path / PARTS, self.path / SERIES, self.path / RUNS):
                for aside in folder.glob(".aside-*"):
                    shutil.rmtree(aside) if aside.is_dir() else aside.unlink()
            if self.is_over:
                self._remove_parts()
            sort_out_series(self.path / SERIES, self.ended())

    def keep(self, result: PieceResult) -> None:
        """Write the rows and the series of a finished piece."""
        points = self.campaign.points
        rows: list[Row] = [{**row, **points[row["point"]]} for row in result.rows]
        with storing(self.path):
            if result.series is not None:
                first = next(row["run"] for row in rows if row["ended"] != FAILED)
                _write(series_part(self.path / SERIES, first), result.series)
            _write(self._part(rows[0]["run"]), _parquet(self._columns.frame(rows)))

    def rows(self) -> "pl.DataFrame":
        """All rows that are there, by run."""
        import polars as pl

        files = [self.path / SUMMARY] if self.is_over else self._parts()
        return self._columns.joined([self._columns.frame([]), *(pl.read_parquet(file) for file in files)])

    def ended(self) -> dict[int, str]:
        """By run that has a row: how it ended."""
        rows = self.rows()
        return dict(zip(rows["run"], rows["ended"], strict=True))

    def forget_failed(self) -> None:
        """Take away the rows of runs that failed, so that they are missing."""
        import polars as pl

        with storing(self.path):
            rows = self.rows()
            left = rows.filter(pl.col("ended") != FAILED)
            if len(left) == len(rows):
                return
            before = self._parts()
            if len(left):
                kept = self._part(left["run"][0])
                _write(kept, _parquet(left))
                before = [part for part in before if part != kept]
            for part in before:
                part.unlink()
            (self.path / SUMMARY).unlink(missing_ok=True)

    def finish(self, files: int) -> None:
        """Make the table of all runs, and at most so many files of the series."""
        with storing(self.path):
            join_series(self.path / SERIES, files)
            if not self.is_over:
                _write(self.path / SUMMARY, _parquet(self.rows()))
            self._remove_parts()

    def _part(self, first_run: int) -> Path:
        return self.path / PARTS / f"part-{first_run:08d}.parquet"

    def _parts(self) -> list[Path]:
        return sorted((self.path / PARTS).glob("part-*.parquet"))

    def _remove_parts(self) -> None:
        for part in self._parts():
            part.unlink()
        if (self.path / PARTS).is_dir():
            (self.path / PARTS).rmdir()


def _parquet(frame: "pl.DataFrame") -> bytes:
    # In memory first: what a full disk then says is an OSError.
    file = BytesIO()
    frame.write_parquet(file, **PARQUET)
    return file.getvalue()


def _write(path: Path, data: bytes) -> None:
    path.parent.mkdir(exist_ok=True)
    with written_aside(path) as aside:
        aside.write_bytes(data)
