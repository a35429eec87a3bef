"""Reader of a campaign's folder (finished, ended early, or still running), and selections of its design points.

`FOLDER@radio.loss=0.4` selects the design points at which the parameter has this value.
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
from swarmwire.metrics.records.campaign.campaign_json import (
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
    parse_value,
    point_text,
    read_campaign,
    same_value,
    value_text,
)
from swarmwire.metrics.records.table_file import corruption_errors, read_parquet, refuse_corrupt
from swarmwire.metrics.statistics.sample import Sample, number_sample, time_sample

SIM_TIME = "sim_time_s"
MAX_RETRIES = 3  # attempts to read the parts of a running campaign, which may be joined meanwhile
INTEGER_COLUMNS = ("run", "point", "seed")
REQUIRED_COLUMNS = (*INTEGER_COLUMNS, "ended", SIM_TIME)


class CampaignFolder:
    """The campaign and the results of its runs, read from disk at the first access.

    BadInput if it is no campaign, is of another format, or a file is damaged.
    """

    def __init__(self, path: Path | str) -> None:
        """Read `campaign.json`; BadInput unless this is a campaign's folder."""
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
        """The design points; a point's number is its index in this tuple."""
        return self.about.points

    @property
    def responses(self) -> tuple[Response, ...]:
        """The measured variables of each run."""
        return self.about.responses

    @cached_property
    def runs(self) -> pl.DataFrame:
        """A row per run that has ended, sorted by run: `summary.parquet`, or the parts written so far.

        Columns: run, point, seed, one of each parameter, ended, error, ticks, sim_time_s, responses, timing_wall_s, …
        Before the first run has ended there may be only run, point, seed, ended and sim_time_s.
        """
        for _ in range(MAX_RETRIES):
            files = self._files()
            try:
                frames = [read_parquet(file) for file in files]
            except BadInput:
                if all(file.exists() for file in files):
                    raise
                continue  # the campaign finished just now, and removed its parts
            for file, frame in zip(files, frames, strict=True):
                _check_columns(file, frame, self.responses)
            if not frames:
                types = dict.fromkeys(INTEGER_COLUMNS, pl.Int64) | {"ended": pl.String, SIM_TIME: pl.Float64}
                return pl.DataFrame(schema=types)
            try:
                return pl.concat(frames, how="diagonal_relaxed").unique("run", keep="last").sort("run")
            except corruption_errors():
                refuse_corrupt(files)
                raise
        raise BadInput(str(self.path), PARTS, "expected files that stay while they are read")

    @property
    def missing(self) -> tuple[int, ...]:
        """Numbers of the runs without a row (yet)."""
        ended: set[int] = set(self._column("run").tolist())
        return tuple(run for run in range(self.about.runs) if run not in ended)

    @property
    def finished(self) -> bool:
        """True if every run has ended, failed runs included."""
        return not self.missing

    def response(self, name: str) -> Response:
        """Return the response of this column, or of a metric's last value by its name; BadInput if there is none."""
        return find_response(name, self.responses, str(self.path))

    def statistic(self, name: str) -> Statistic:
        """Return the statistic that `COLUMN.STAT` names; BadInput if there is none."""
        return find_statistic(name, self.responses, str(self.path))

    def sample(self, column: str, point: int) -> Sample:
        """Return the values of a response over the seeds of a design point, in the order of the campaign's seeds.

        A null number is undefined; a null time is right-censored at its run's end. BadInput for an unknown response or
        point.
        """
        response = self.response(column)
        if not 0 <= point < len(self.points):
            raise BadInput(str(self.path), "point", f"expected 0 to {len(self.points) - 1}, got {point}")
        if response.column not in self._samples:
            self._samples[response.column] = self._all_samples(response)
        return self._samples[response.column][point]

    def _all_samples(self, response: Response) -> tuple[Sample, ...]:
        """Return the samples of all points; computed together, since a report reads every response at every point."""
        order = np.argsort(self._column("point"), kind="stable")
        value, end_s = self._numbers(response.column)[order], self._numbers(SIM_TIME)[order]
        seed, is_failed = self._column("seed")[order].astype(np.int64), self._is_failed[order]
        edges = np.searchsorted(self._column("point")[order], np.arange(len(self.points) + 1)).tolist()
        is_stopped = self._is_stopped[order] & (response.column != STOP_TIME)
        return tuple(
            _sample(response, value[rows], end_s[rows], seed[rows], is_failed[rows], is_stopped[rows])
            for rows in (slice(start, end) for start, end in pairwise(edges))
        )

    @cached_property
    def _is_failed(self) -> BoolArray:
        """True for each failed run, (runs,); cached, since comparing texts takes longer than a sample."""
        return self.runs.select(pl.col("ended") == FAILED).to_series().to_numpy()

    @cached_property
    def _is_stopped(self) -> BoolArray:
        """True for each run that a stop condition ended, (runs,)."""
        return self.runs.select(pl.col("ended") == STOPPED).to_series().to_numpy()

    def _column(self, name: str) -> AnyArray:
        return self.runs[name].to_numpy()

    def _numbers(self, name: str) -> FloatArray:
        """Return a column of numbers (runs,), NaN for null; all NaN while no run has this column."""
        if name not in self.runs.columns:
            return np.full(len(self.runs), np.nan)
        return self.runs[name].cast(pl.Float64).fill_null(float("nan")).to_numpy()

    def _files(self) -> list[Path]:
        """Return the files with rows: the table, then parts, which are newer if the campaign was resumed."""
        table = self.path / SUMMARY
        # Temporary files start with a dot.
        parts = sorted(part for part in (self.path / PARTS).glob("*.parquet") if not part.name.startswith("."))
        return [table, *parts] if table.exists() else parts


def _check_columns(file: Path, frame: pl.DataFrame, responses: Iterable[Response]) -> None:
    missing = [name for name in REQUIRED_COLUMNS if name not in frame.columns]
    if missing:
        raise BadInput(str(file), missing[0], "expected this column of a campaign's table")
    for name in INTEGER_COLUMNS:
        if not frame.schema[name].is_integer() or frame[name].null_count():
            raise BadInput(str(file), name, "expected a column of whole numbers")
    for name in (SIM_TIME, *(response.column for response in responses)):
        kind = frame.schema.get(name)
        if kind is not None and not (kind.is_numeric() or frame[name].is_null().all()):
            raise BadInput(str(file), name, "expected a column of numbers")
    if frame.schema["ended"] != pl.String or frame["ended"].null_count():
        raise BadInput(str(file), "ended", "expected how each run ended")


def response_sample(response: Response, value: FloatArray, end_s: FloatArray, seed: IntArray) -> Sample:
    """Return the sample of a response in runs that ended at `end_s` without failure; NaN: censored or undefined."""
    if response.kind == "number":
        return number_sample(value, seed)
    observed = np.isfinite(value)
    return time_sample(np.where(observed, value, response.watched_s(end_s)), observed, seed)


def _sample(
    response: Response,
    value: FloatArray,
    end_s: FloatArray,
    seed: IntArray,
    is_failed: BoolArray,
    is_stopped: BoolArray,
) -> Sample:
    """Return the sample of all runs of a point; failed runs are counted only."""
    ended = ~is_failed
    sample = response_sample(response, value[ended], end_s[ended], seed[ended])
    first = sample.value[~sample.observed & is_stopped[ended]] if response.kind == "time" else np.empty(0)
    return replace(sample, failed=int(np.count_nonzero(is_failed)), stopped_first=first)


@dataclass(frozen=True)
class PointSelection:
    """Points of a campaign, by their numbers."""

    text: str  #: FOLDER@path=value, for messages
    campaign: CampaignFolder
    points: tuple[int, ...]
    pinned: frozenset[str]  #: parameters with a selected value


def select(text: str) -> PointSelection:
    """Return the points of `FOLDER` or `FOLDER@path=value@…`; BadInput for an unknown folder, path or value."""
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
    """Split a text into the longest folder that exists, whose path may have an @, and the settings after it."""
    parts = text.split("@")
    paths = ["@".join(parts[:count]) for count in range(1, len(parts) + 1)]
    first_setting = next((index for index, part in enumerate(parts[1:], 1) if "=" in part), len(parts))
    count = max((count for count, path in enumerate(paths, 1) if Path(path).exists()), default=first_setting)
    return paths[count - 1], parts[count:]


def points_at(campaign: CampaignFolder, points: Sequence[int], path: str, text: str, where: str) -> list[int]:
    """Return the points at which a parameter has the value of `text`; BadInput lists its values if none has it."""
    value = parse_value(text)
    matches = [point for point in points if same_value(campaign.points[point][path], value)]
    if not matches:
        values = dict.fromkeys(value_text(campaign.points[point][path]) for point in points)
        raise BadInput(where, path, f"expected {did_you_mean(values)}, got {text}")
    return matches


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
    """Return the parameters that must agree: both vary them, and neither selects a value."""
    free = set(second.campaign.parameters) - first.pinned - second.pinned
    return tuple(path for path in first.campaign.parameters if path in free)


def point_pairs(first: PointSelection, second: PointSelection) -> list[PointPair]:
    """Return the pairs of points that agree in the parameters that both vary, in the first's order.

    BadInput if there are none, or if their pairs are ambiguous.
    """
    paths, where = shared_paths(first, second), f"{first.text}, {second.text}"
    if not paths and len(first.points) > 1 and len(second.points) > 1:
        expected = f"expected a parameter that both vary: {_paths(first)} and {_paths(second)}; choose points with @"
        raise BadInput(where, "", expected)
    pairs = [
        PointPair(a, b)
        for a in first.points
        for b in second.points
        if all(same_value(first.campaign.points[a][path], second.campaign.points[b][path]) for path in paths)
    ]
    if not pairs:
        expected = f"expected design points in common: {_example(first, paths)} and {_example(second, paths)}"
        raise BadInput(where, "", expected)
    return pairs


def _paths(selection: PointSelection) -> str:
    return f"one varies {', '.join(selection.campaign.parameters)}"


def _example(selection: PointSelection, paths: tuple[str, ...]) -> str:
    first = point_text(selection.campaign.points[selection.points[0]], paths)
    others = len(selection.points) - 1
    return f"one has {first}" + (f" and {others} others" if others else "")
