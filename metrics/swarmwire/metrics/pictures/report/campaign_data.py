"""The data of a campaign's report: samples of responses, levels of parameters, slices of the design, and texts."""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import product
from math import prod
from statistics import median
from typing import TypeGuard

import numpy as np

from swarmwire.comms.base.arrays import BoolArray, FloatArray, IntArray
from swarmwire.metrics.records.campaign.folder import CampaignFolder
from swarmwire.metrics.records.campaign.spec import Point, Response, Value, find_response, value_text
from swarmwire.metrics.statistics.sample import Sample, SeedTable, by_seed
from swarmwire.metrics.statistics.summary import Summary, summary
from swarmwire.metrics.statistics.survival import kaplan_meier

_ENDINGS = {
    "final": " at the end",
    "mean": ", mean over the run",
    "min": ", least in the run",
    "max": ", greatest in the run",
}
_KNOWN = {
    "radio.pdr": "PDR: received / intended",
    "radio.link_pdr": "link PDR: received / in range",
    "stop_time_s": "time to the stop condition in s",
    "radio.sent": "packets sent",
    "radio.intended": "intended receivers",
    "radio.in_range": "receivers in range",
}
_DIGITS = 3  # of a number whose spread is not known
_DIGITS_OF_SPREAD = 2
_MAX_DIGITS = 5
_MAX_DECIMALS = 6
_PLAIN_UP_TO = 1e7
_OTHERS = re.compile(r"[^A-Za-z0-9._-]+")
MAX_LEVELS = 16  # of numbers, beyond which they are put together
_BINS = 8
MAX_SLICES = 4
_NOTHING = Sample(np.empty(0), np.empty(0, np.bool_), np.empty(0, np.int64))


def response_title(response: Response) -> str:
    """The title of a response, with its unit: "aggregation time in s"; its label if it has one."""
    if response.label:
        return response.label
    if response.column in _KNOWN:
        return _KNOWN[response.column]
    name, _, ending = response.column.rpartition(".")
    if ending not in _ENDINGS or not name:
        name, ending = response.column, ""
    name = name.removesuffix(f"_{response.unit}") if response.unit else name
    words = name.replace("_", " ")
    unit = f" in {response.unit}" if response.unit else ""
    return f"{words}{unit}{_ENDINGS[ending]}" if ending else f"{words}{unit}"


def short_value(value: Value) -> str:
    """A parameter's value; six digits of a number that need not be whole."""
    return value_text(value, 6)


@dataclass(frozen=True)
class Rounding:
    """How the values of one response are written."""

    decimals: int | None  # None: with an exponent

    def text(self, value: float) -> str:
        """The number, with a true minus; a dash for none."""
        if not math.isfinite(value):
            return "–"
        if self.decimals is None:
            return f"{value:.{_DIGITS - 1}e}".replace("-", "−")
        rounded = f"{value:,.{self.decimals}f}".replace("-", "−")
        return rounded.lstrip("−") if not rounded.strip("−0.,") else rounded  # no minus before nothing


def rounding_of(values: Sequence[float], spreads: Sequence[float] = ()) -> Rounding:
    """The rounding for these values, by their spreads; values that are not finite are ignored."""
    known = [abs(value) for value in values if math.isfinite(value) and value]
    if not known:
        return Rounding(0)
    greatest, widths = max(known), [spread for spread in spreads if math.isfinite(spread) and spread > 0.0]
    if greatest >= _PLAIN_UP_TO:
        return Rounding(None)
    if all(value.is_integer() for value in map(float, known)):
        return Rounding(0)
    needed = _decimals(median(widths), _DIGITS_OF_SPREAD) if widths else _decimals(median(known), _DIGITS)
    decimals = max(0, min(needed, _decimals(greatest, _MAX_DIGITS)))
    return Rounding(decimals if decimals <= _MAX_DECIMALS else None)


def _decimals(value: float, digits: int) -> int:
    """The number of decimals that shows this many digits of the value."""
    return digits - 1 - math.floor(math.log10(value))


def figure_name(*of: str) -> str:
    """The name of a figure's file: `survival-aggregation_time_s-radio.loss`."""
    return "-".join(_OTHERS.sub("-", part) for part in of)


@dataclass(frozen=True)
class Levels:
    """A parameter's levels, in ascending order of numbers, else in the order of the design."""

    path: str
    labels: tuple[str, ...]  # (l,)
    number: FloatArray | None  # (l,) the value, or the mean of those put together; None: no numbers
    of_point: IntArray  # (points,) the level of each design point
    means: tuple[str, ...] = ()  # (l,) if levels are ranges: the mean of each, which is shorter
    label: str = ""  # of the parameter, in figures in place of its path

    @property
    def title(self) -> str:
        """The parameter in figures."""
        return self.label or self.path

    @property
    def short(self) -> tuple[str, ...]:
        """Labels for axes: (l,)."""
        return self.means or self.labels

    def __len__(self) -> int:
        return len(self.labels)

    def points(self, level: int) -> list[int]:
        """The design points at this level."""
        return np.flatnonzero(self.of_point == level).tolist()


def levels_of(path: str, points: tuple[Point, ...]) -> Levels:
    """The levels of a parameter over all design points; more than MAX_LEVELS numbers become ranges, equally full."""
    values = [point[path] for point in points]
    if all(_is_number(value) for value in values):
        return _of_numbers(path, np.array(values, dtype=np.float64))
    texts = [short_value(value) for value in values]
    labels = tuple(dict.fromkeys(texts))
    return Levels(path, labels, None, np.array([labels.index(text) for text in texts]))


def _of_numbers(path: str, values: FloatArray) -> Levels:
    distinct, of_point = np.unique(values, return_inverse=True)
    if len(distinct) <= MAX_LEVELS:
        return Levels(path, tuple(f"{value:.6g}" for value in distinct), distinct, of_point)
    edges = np.unique(np.quantile(values, np.linspace(0.0, 1.0, _BINS + 1)))
    of_point = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, len(edges) - 2)
    of_point = np.unique(of_point, return_inverse=True)[1]  # a range may have been empty
    ranges = [values[of_point == level] for level in range(int(of_point.max()) + 1)]
    decimals = max(0, 1 - math.floor(math.log10(float(np.ptp(values)) / len(ranges))))
    labels = tuple(f"{part.min():.{decimals}f}–{part.max():.{decimals}f}" for part in ranges)
    means = np.array([part.mean() for part in ranges])
    return Levels(path, labels, means, of_point, tuple(f"{mean:.2g}" for mean in means))


def _is_number(value: Value) -> TypeGuard[float]:
    return isinstance(value, int | float) and not isinstance(value, bool)


@dataclass(frozen=True)
class Slice:
    """Some of the design points."""

    label: str  # the values that they share: "robots.flock.count 20", "" for all points
    short: str  # the values alone
    points: frozenset[int]

    def cell(self, *at: tuple[Levels, int]) -> tuple[int, ...]:
        """Those of its points that are at these levels."""
        found = set(self.points)
        for levels, level in at:
            found &= set(levels.points(level))
        return tuple(sorted(found))


def slices_beside(folder: CampaignFolder, shown: Sequence[str], *, names_apart: bool = True) -> list[Slice]:
    """The design points, sliced by the parameters not shown: numbers of a grid at their middle value, names one by one.

    Numbers of other designs are taken together, and so are names unless `names_apart` and their combinations are
    MAX_SLICES at most.
    """
    whole = Slice("", "", frozenset(range(len(folder.points))))
    others = [levels_of(path, folder.points) for path in folder.parameters if path not in shown]
    others = [levels for levels in others if len(levels) > 1]
    if folder.about.design != "grid":
        others = [levels for levels in others if levels.number is None]
    names = prod(len(levels) for levels in others if levels.number is None)
    if not names_apart or names > MAX_SLICES:
        others = [levels for levels in others if levels.number is not None]
    choices = [range(len(levels)) if levels.number is None else [(len(levels) - 1) // 2] for levels in others]
    return [
        Slice(
            ", ".join(f"{levels.path} {levels.labels[at]}" for levels, at in zip(others, place, strict=True)),
            ", ".join(levels.labels[at] for levels, at in zip(others, place, strict=True)),
            frozenset(whole.cell(*zip(others, place, strict=True))),
        )
        for place in product(*choices)
    ]


class Samples:
    """The samples of a campaign, for the sections of its report. `points` are indices of design points."""

    def __init__(self, folder: CampaignFolder, labels: Mapping[str, str] | None = None) -> None:
        """`labels`: texts for parameters and for responses, as `find_response` names them; BadInput for others."""
        self.folder = folder
        self._labels = dict(labels or {})
        responses = {response.column: response for response in folder.responses}
        for name, label in self._labels.items():
            if name not in folder.parameters:
                known = (*folder.responses, *(Response(path, "", "number", "") for path in folder.parameters))
                column = find_response(name, known, "--label").column
                responses[column] = replace(responses[column], label=label)
        self.responses = tuple(responses.values())
        self._of_point = lru_cache(maxsize=None)(folder.sample)
        self._summary = lru_cache(maxsize=None)(self._new_summary)

    def levels(self, path: str) -> Levels:
        """The levels of a parameter over all design points."""
        return replace(levels_of(path, self.folder.points), label=self._labels.get(path, ""))

    def sample(self, response: Response, points: tuple[int, ...]) -> Sample:
        """The values of all runs of these points."""
        parts = [self._of_point(response.column, point) for point in points]
        if len(parts) == 1:
            return parts[0]
        return Sample(
            np.concatenate([part.value for part in parts] or [np.empty(0)]),
            np.concatenate([part.observed for part in parts] or [np.empty(0, np.bool_)]),
            np.concatenate([part.seed for part in parts] or [np.empty(0, np.int64)]),
            kind=response.kind,
            failed=sum(part.failed for part in parts),
            undefined=sum(part.undefined for part in parts),
            stopped_first=np.concatenate([part.stopped_first for part in parts] or [np.empty(0)]),
        )

    def all(self, response: Response) -> Sample:
        """The values of all runs."""
        return self.sample(response, tuple(range(len(self.folder.points))))

    def table(self, response: Response, rows: Sequence[tuple[int, ...]]) -> SeedTable:
        """The values of the points of each row; NaN where there is none.

        A time that was cut off counts as the time until then.
        """
        return _side_by_side([[self._of_point(response.column, point) for point in points] for points in rows])

    def reached(self, response: Response, rows: Sequence[tuple[int, ...]]) -> BoolArray:
        """Of the same shape: whether the value was observed, not cut off."""
        found = [[self._of_point(response.column, point) for point in points] for points in rows]
        observed = [[replace(sample, value=sample.observed.astype(np.float64)) for sample in row] for row in found]
        return _side_by_side(observed).value == 1.0

    def summary(self, response: Response, points: tuple[int, ...]) -> Summary:
        """The summary of these runs."""
        return self._summary(response, points)

    def quartiles(self, response: Response, points: tuple[int, ...]) -> tuple[float, float, float]:
        """A quarter, half and three quarters of the runs; inf: beyond the limit, NaN: no value."""
        sample = self.sample(response, points)
        if not len(sample):
            return (np.nan, np.nan, np.nan)
        if response.kind == "time":
            curve = kaplan_meier(sample)
            found = [curve.quantile(share) for share in (0.25, 0.5, 0.75)]
            return tuple(np.nan_to_num(found, nan=np.inf).tolist())
        return tuple(np.quantile(sample.value, (0.25, 0.5, 0.75)).tolist())

    def limit(self, response: Response) -> float | None:
        """Up to where the longest run that was cut off was followed; None: none was."""
        sample = self.all(response)
        cut_off = sample.value[~sample.observed]
        return float(cut_off.max()) if len(cut_off) else None

    def _new_summary(self, response: Response, points: tuple[int, ...]) -> Summary:
        return summary(self.sample(response, points))


def _side_by_side(rows: Sequence[Sequence[Sample]]) -> SeedTable:
    """The values of the first point of each row seed by seed, then those of the second, and so on."""
    turns = max(map(len, rows), default=0)
    blocks = [by_seed([row[turn] if turn < len(row) else _NOTHING for row in rows]) for turn in range(turns)]
    values = np.concatenate([np.empty((len(rows), 0)), *(block.value for block in blocks)], axis=1)
    return SeedTable(values, np.concatenate([np.empty(0, np.int64), *(block.seed for block in blocks)]))
