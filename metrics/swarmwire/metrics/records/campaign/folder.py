"""A campaign's folder, read back: finished, ended early, or still running; and parts of it, as a person names them.

`FOLDER@radio.loss=0.4` are the design points at which the parameter has this value.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
import polars as pl

from swarmwire.comms.base.arrays import AnyArray, BoolArray, FloatArray, IntArray
from swarmwire.comms.base.config import did_you_mean
from swarmwire.comms.base.errors import BadInput
from swarmwire.metrics.records.campaign.spec import (
    FAILED,
    PARTS,
    STOP_TIME,
    STOPPED,
    SUMMARY,
    Campaign,
    Point,
    Response,
    Statistic,
    find_response,
    find_statistic,
    point_text,
    read_campaign,
    same_value,
    value_from,
    value_text,
)
from swarmwire.metrics.records.table_file import corruption_errors, read_parquet, refuse_corrupt
from swarmwire.metrics.statistics.sample import Sample, number_sample, time_sample

SIM_TIME = "sim_time_s"
MAX_RETRIES = 3  # times that the parts of a running campaign may be joined while they are read
NUMBERS = ("run", "point", "seed")
NEEDED = (*NUMBERS, "ended", SIM_TIME)


class CampaignFolder:
    """The campaign and the results of its runs, as they are on disk at the first access.

    BadInput where it is no campaign, is of another format, or a file is damaged.
    """

    def __init__(self, path: Path | str) -> None:
        """Read `campaign.json`; BadInput unless the folder holds a campaign."""
        self.path = Path(path)
        if not self.path.is_dir():
            raise BadInput(str(path), "", "expected a campaign's folder: there is none")
        self.about: Campaign = read_campaign(self.path)
        self._samples: dict[str, tuple[Sample, ...]] = {}

    @property
    def parameters(self) -> tuple[str, ...]:
        """Paths of the parameters that are varied, in the order in which they were named."""
        return tuple(self.about.vary)

    @property
    def points(self) -> tuple[Point, ...]:
        """The design points; a point's number is its place here."""
        return self.about.points

    @property
    def responses(self) -> tuple[Response, ...]:
        """What was measured of each run."""
        return self.about.responses

    @cached_property
    def runs(self) -> pl.DataFrame:
        """A row per run that has ended, sorted by run: `summary.parquet`, or what parts there are so far.

        Columns: run, point, seed, one of each parameter, ended, error, ticks, sim_time_s, responses, timing_wall_s, …
        Before the first run has ended there may be no columns but the first of these.
        """
        for _ in range(MAX_RETRIES):
            files = self._files()
            try:
                frames = [read_parquet(file) for file in files]
            except BadInput:
                if all(file.exists() for file in files):
                    raise
                continue  # it finished just now, and its parts went
            for file, frame in zip(files, frames, strict=True):
                _check_columns(file, frame, self.responses)
            if not frames:
                return pl.DataFrame(schema=dict.fromkeys(NEEDED, pl.Int64) | {"ended": pl.String, SIM_TIME: pl.Float64})
            try:
                return pl.concat(frames, how="diagonal_relaxed").unique("run", keep="last").sort("run")
            except corruption_errors():
                refuse_corrupt(files)
                raise
        raise BadInput(str(self.path), PARTS, "expected files that stay while they are read")

    @property
    def missing(self) -> tuple[int, ...]:
        """Numbers of the runs that have no row (yet)."""
        there: set[int] = set(self._column("run").tolist())
        return tuple(run for run in range(self.about.runs) if run not in there)

    @property
    def finished(self) -> bool:
        """Whether every run has ended, well or not."""
        return not self.missing

    def response(self, name: str) -> Response:
        """The response of this column, or of a bare metric's last value; BadInput names those that there are."""
        return find_response(name, self.responses, str(self.path))

    def statistic(self, name: str) -> Statistic:
        """The statistic that `COLUMN.STAT` names; BadInput if there is none."""
        return find_statistic(name, self.responses, str(self.path))

    def sample(self, column: str, point: int) -> Sample:
        """The values of a response over the seeds of a design point, in the order of the campaign's seeds.

        A number that is null is undefined; a time that is null is right-censored at its run's end. BadInput for an
        response or a point that there is not.
        """
        response = self.response(column)
        if not 0 <= point < len(self.points):
            raise BadInput(str(self.path), "point", f"expected 0 to {len(self.points) - 1}, got {point}")
        if response.column not in self._samples:
            self._samples[response.column] = self._of_all_points(response)
        return self._samples[response.column][point]

    def _of_all_points(self, response: Response) -> tuple[Sample, ...]:
        """Read once: a report asks for every response at every point."""
        order = np.argsort(self._column("point"), kind="stable")
        value, end_s = self._numbers(response.column)[order], self._numbers(SIM_TIME)[order]
        seed, well = self._column("seed")[order].astype(np.int64), self._ended_well[order]
        edges = np.searchsorted(self._column("point")[order], np.arange(len(self.points) + 1)).tolist()
        stopped = self._stopped[order] & (response.column != STOP_TIME)
        return tuple(
            _sample(response, value[here], end_s[here], seed[here], well[here], stopped[here])
            for here in (slice(start, end) for start, end in pairwise(edges))
        )

    @cached_property
    def _ended_well(self) -> BoolArray:
        """Of each run (runs,) whether it did; comparing texts takes longer than a sample."""
        return self.runs.select(pl.col("ended") != FAILED).to_series().to_numpy()

    @cached_property
    def _stopped(self) -> BoolArray:
        """Of each run (runs,) whether a stop condition ended it."""
        return self.runs.select(pl.col("ended") == STOPPED).to_series().to_numpy()

    def _column(self, name: str) -> AnyArray:
        return self.runs[name].to_numpy()

    def _numbers(self, name: str) -> FloatArray:
        """A column of numbers (runs,), NaN where it is null; all NaN before any run has this column."""
        if name not in self.runs.columns:
            return np.full(len(self.runs), np.nan)
        return self.runs[name].cast(pl.Float64).fill_null(float("nan")).to_numpy()

    def _files(self) -> list[Path]:
        """The table, and parts: those of a campaign that was taken up again are newer than the table."""
        whole = self.path / SUMMARY
        parts = (self.path / PARTS).glob("*.parquet")
        found = sorted(part for part in parts if not part.name.startswith("."))  # what is being written starts so
        return [whole, *found] if whole.exists() else found


def _check_columns(file: Path, frame: pl.DataFrame, responses: Iterable[Response]) -> None:
    lacking = [name for name in NEEDED if name not in frame.columns]
    if lacking:
        raise BadInput(str(file), lacking[0], "expected this column of a campaign's table")
    for name in NUMBERS:
        if not frame.schema[name].is_integer() or frame[name].null_count():
            raise BadInput(str(file), name, "expected a column of whole numbers")
    for name in (SIM_TIME, *(response.column for response in responses)):
        kind = frame.schema.get(name)
        if kind is not None and not (kind.is_numeric() or frame[name].is_null().all()):
            raise BadInput(str(file), name, "expected a column of numbers")
    if frame.schema["ended"] != pl.String or frame["ended"].null_count():
        raise BadInput(str(file), "ended", "expected how each run ended")


def response_sample(response: Response, value: FloatArray, end_s: FloatArray, seed: IntArray) -> Sample:
    """The values of a response in runs that ended well, at `end_s`; NaN: censored there, or undefined."""
    if response.kind == "number":
        return number_sample(value, seed)
    observed = np.isfinite(value)
    return time_sample(np.where(observed, value, response.watched_s(end_s)), observed, seed)


def _sample(
    response: Response, value: FloatArray, end_s: FloatArray, seed: IntArray, well: BoolArray, stopped: BoolArray
) -> Sample:
    """Of all runs of a point, of which those that ended well have a part in it."""
    sample = response_sample(response, value[well], end_s[well], seed[well])
    first = sample.value[~sample.observed & stopped[well]] if response.kind == "time" else np.empty(0)
    return replace(sample, failed=int(np.count_nonzero(~well)), stopped_first=first)


@dataclass(frozen=True)
class PointSelection:
    """Points of a campaign, by their numbers."""

    text: str  # FOLDER@path=value, for messages
    campaign: CampaignFolder
    points: tuple[int, ...]
    pinned: frozenset[str]  # parameters of which one value was chosen


def select(text: str) -> PointSelection:
    """What `FOLDER` or `FOLDER@path=value@path=value` names; BadInput if there is no such folder, path or value."""
    folder, settings = _folder_and_settings(text)
    campaign = CampaignFolder(folder)
    points = range(len(campaign.points))
    paths: list[str] = []
    for setting in settings:
        path, chosen = _setting(setting, text)
        if path not in campaign.parameters:
            raise BadInput(
                text, path, f"expected a parameter that was varied: {did_you_mean(campaign.parameters, path)}"
            )
        points = points_at(campaign, points, path, chosen, text)
        paths.append(path)
    return PointSelection(text, campaign, tuple(points), frozenset(paths))


def _folder_and_settings(text: str) -> tuple[str, list[str]]:
    """The longest folder that exists, whose path may have an @, and the settings behind it."""
    parts = text.split("@")
    paths = ["@".join(parts[:count]) for count in range(1, len(parts) + 1)]
    first_setting = next((place for place, part in enumerate(parts[1:], 1) if "=" in part), len(parts))
    count = max((count for count, path in enumerate(paths, 1) if Path(path).exists()), default=first_setting)
    return paths[count - 1], parts[count:]


def points_at(campaign: CampaignFolder, points: Sequence[int], path: str, text: str, where: str) -> list[int]:
    """Those of the points at which a parameter has the value that a person wrote; BadInput names those that it has."""
    value = value_from(text)
    found = [point for point in points if same_value(campaign.points[point][path], value)]
    if not found:
        known = dict.fromkeys(value_text(campaign.points[point][path]) for point in points)
        raise BadInput(where, path, f"expected {did_you_mean(known)}, got {text}")
    return found


def _setting(setting: str, where: str) -> tuple[str, str]:
    path, equals, value = (part.strip() for part in setting.partition("="))
    if not (path and equals and value):
        raise BadInput(where, setting, "expected path=value, such as radio.loss=0.4")
    return path, value


class PointPair(NamedTuple):
    """Numbers of two points."""

    first: int
    second: int


def shared_paths(first: PointSelection, second: PointSelection) -> tuple[str, ...]:
    """Parameters that must agree: both vary them, and for neither one value was chosen."""
    free = set(second.campaign.parameters) - first.pinned - second.pinned
    return tuple(path for path in first.campaign.parameters if path in free)


def point_pairs(first: PointSelection, second: PointSelection) -> list[PointPair]:
    """Points that agree in what both vary, in the first's order.

    BadInput if there are none, or if their pairs are ambiguous.
    """
    paths = shared_paths(first, second)
    if not paths and len(first.points) > 1 and len(second.points) > 1:
        expected = f"expected a parameter that both vary: {_paths(first)} and {_paths(second)}; choose points with @"
        raise BadInput(_both(first, second), "", expected)
    pairs = [
        PointPair(one, other)
        for one in first.points
        for other in second.points
        if all(same_value(first.campaign.points[one][path], second.campaign.points[other][path]) for path in paths)
    ]
    if not pairs:
        expected = f"expected design points in common: {_example(first, paths)} and {_example(second, paths)}"
        raise BadInput(_both(first, second), "", expected)
    return pairs


def _both(first: PointSelection, second: PointSelection) -> str:
    return f"{first.text}, {second.text}"


def _paths(of: PointSelection) -> str:
    return f"one varies {', '.join(of.campaign.parameters)}"


def _example(of: PointSelection, paths: tuple[str, ...]) -> str:
    first = point_text(of.campaign.points[of.points[0]], paths)
    return f"one has {first}" + (f" and {len(of.points) - 1} others" if len(of.points) > 1 else "")
