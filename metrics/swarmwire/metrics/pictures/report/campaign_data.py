"""The data of a campaign's report: responses and their samples, levels of parameters, slices of the design, texts."""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import product, zip_longest
from math import prod
from statistics import median
from typing import TypeGuard

import numpy as np

from swarmwire.comms.base.arrays import BoolArray, FloatArray, IntArray
from swarmwire.metrics.records.campaign.campaign_json import Point, Response, Value, find_response, value_text
from swarmwire.metrics.records.campaign.folder import CampaignFolder
from swarmwire.metrics.statistics.sample import Sample, SeedTable, by_seed
from swarmwire.metrics.statistics.summary import Summary, summary
from swarmwire.metrics.statistics.survival import kaplan_meier

MAX_SHOWN = 8  # responses, without names
PREFERRED = (
    "stop_time_s",
    "target_best.final",
    "target_mean.final",
    "order.final",
    "largest_component.final",
    "radio.link_pdr",
)
_ENDINGS = {
    "final": " at the end",
    "mean": ", mean over the run",
    "min": ", least in the run",
    "max": ", greatest in the run",
}
_TITLES = {
    "radio.pdr": "PDR: received / intended",
    "radio.link_pdr": "link PDR: received / in range",
    "stop_time_s": "time to the stop condition in s",
    "radio.sent": "packets sent",
    "radio.intended": "intended receivers",
    "radio.in_range": "receivers in range",
}
_DIGITS = 3  # significant digits of a number without a spread
_DIGITS_OF_SPREAD = 2
_MAX_DIGITS = 5
_MAX_DECIMALS = 6
_MIN_WITH_EXPONENT = 1e7
_NOT_IN_FILE_NAMES = re.compile(r"[^A-Za-z0-9._-]+")
MAX_LEVELS = 16  # more numbers are grouped into ranges
_BINS = 8
MAX_SLICES = 4
_EMPTY_SAMPLE = Sample(np.empty(0), np.empty(0, np.bool_), np.empty(0, np.int64))


def response_title(response: Response) -> str:
    """Return the title of a response with its unit, "aggregation time in s"; its label if it has one."""
    if response.label:
        return response.label
    if response.column in _TITLES:
        return _TITLES[response.column]
    name, _, ending = response.column.rpartition(".")
    if ending not in _ENDINGS or not name:
        name, ending = response.column, ""
    name = name.removesuffix(f"_{response.unit}") if response.unit else name
    words = name.replace("_", " ")
    unit = f" in {response.unit}" if response.unit else ""
    return f"{words}{unit}{_ENDINGS[ending]}" if ending else f"{words}{unit}"


def short_value(value: Value) -> str:
    """Return the text of a parameter's value; six digits of a float."""
    return value_text(value, 6)


@dataclass(frozen=True)
class Rounding:
    """The number format of a response's values."""

    decimals: int | None  # None: with an exponent

    def text(self, value: float) -> str:
        """Return the number with a true minus, or a dash for NaN."""
        if not math.isfinite(value):
            return "–"
        if self.decimals is None:
            return f"{value:.{_DIGITS - 1}e}".replace("-", "−")
        rounded = f"{value:,.{self.decimals}f}".replace("-", "−")
        return rounded.lstrip("−") if not rounded.strip("−0.,") else rounded  # no minus before zero


def rounding_of(values: Sequence[float], spreads: Sequence[float] = ()) -> Rounding:
    """Return the rounding for these values, by their spreads; values that are not finite are ignored."""
    sizes = [abs(float(value)) for value in values if math.isfinite(value) and value]
    if not sizes:
        return Rounding(0)
    greatest, widths = max(sizes), [spread for spread in spreads if math.isfinite(spread) and spread > 0.0]
    if greatest >= _MIN_WITH_EXPONENT:
        return Rounding(None)
    if all(size.is_integer() for size in sizes):
        return Rounding(0)
    needed = _decimals(median(widths), _DIGITS_OF_SPREAD) if widths else _decimals(median(sizes), _DIGITS)
    decimals = max(0, min(needed, _decimals(greatest, _MAX_DIGITS)))
    return Rounding(decimals if decimals <= _MAX_DECIMALS else None)


def _decimals(value: float, digits: int) -> int:
    """Return the number of decimals for this many significant digits of the value."""
    return digits - 1 - math.floor(math.log10(value))


def figure_name(*parts: str) -> str:
    """Return the name of a figure's file: `survival-aggregation_time_s-radio.loss`."""
    return "-".join(_NOT_IN_FILE_NAMES.sub("-", part) for part in parts)


@dataclass(frozen=True)
class Levels:
    """The levels of a parameter, in ascending order of numbers, else in the order of the design."""

    path: str
    labels: tuple[str, ...]  # (levels,)
    number: FloatArray | None  # (levels,) value, or mean of a range; None: not numeric
    of_point: IntArray  # (points,) level of each design point
    means: tuple[str, ...] = ()  # (levels,) short labels of ranges: their means
    label: str = ""  # the parameter's text in figures, by default its path

    @property
    def title(self) -> str:
        """Text of the parameter in figures."""
        return self.label or self.path

    @property
    def short(self) -> tuple[str, ...]:
        """Labels for axes, (levels,)."""
        return self.means or self.labels

    def __len__(self) -> int:
        return len(self.labels)

    def points(self, level: int) -> list[int]:
        """Return the design points at this level."""
        return np.flatnonzero(self.of_point == level).tolist()


def levels_of(path: str, points: tuple[Point, ...]) -> Levels:
    """Return the levels of a parameter; more than MAX_LEVELS numbers become ranges with equally many points."""
    values = [point[path] for point in points]
    if all(_is_number(value) for value in values):
        return _numeric_levels(path, np.array(values, dtype=np.float64))
    texts = [short_value(value) for value in values]
    labels = tuple(dict.fromkeys(texts))
    return Levels(path, labels, None, np.array([labels.index(text) for text in texts]))


def _numeric_levels(path: str, values: FloatArray) -> Levels:
    distinct, of_point = np.unique(values, return_inverse=True)
    if len(distinct) <= MAX_LEVELS:
        return Levels(path, tuple(f"{value:.6g}" for value in distinct), distinct, of_point)
    edges = np.unique(np.quantile(values, np.linspace(0.0, 1.0, _BINS + 1)))
    of_point = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, len(edges) - 2)
    of_point = np.unique(of_point, return_inverse=True)[1]  # without empty ranges
    ranges = [values[of_point == level] for level in range(int(of_point.max()) + 1)]
    decimals = max(0, 1 - math.floor(math.log10(float(np.ptp(values)) / len(ranges))))
    labels = tuple(f"{part.min():.{decimals}f}–{part.max():.{decimals}f}" for part in ranges)
    means = np.array([part.mean() for part in ranges])
    return Levels(path, labels, means, of_point, tuple(f"{mean:.2g}" for mean in means))


def _is_number(value: Value) -> TypeGuard[float]:
    return isinstance(value, int | float) and not isinstance(value, bool)


@dataclass(frozen=True)
class Slice:
    """A subset of the design points."""

    label: str  # common values of the points, "robots.flock.count 20"; empty for all points
    short: str  # the values without paths
    points: frozenset[int]

    def cell(self, *coordinates: tuple[Levels, int]) -> tuple[int, ...]:
        """Return the points of the slice at these levels."""
        points = set(self.points)
        for levels, level in coordinates:
            points &= set(levels.points(level))
        return tuple(sorted(points))


def slices_without(folder: CampaignFolder, shown: Sequence[str], *, names_apart: bool = True) -> list[Slice]:
    """Slice the design points by the parameters that are not shown: at the middle number of a grid, and at each name.

    Numbers of other designs are pooled. Names are pooled unless `names_apart`, with at most MAX_SLICES combinations.
    """
    all_points = Slice("", "", frozenset(range(len(folder.points))))
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
            ", ".join(f"{levels.path} {levels.labels[level]}" for levels, level in zip(others, choice, strict=True)),
            ", ".join(levels.labels[level] for levels, level in zip(others, choice, strict=True)),
            frozenset(all_points.cell(*zip(others, choice, strict=True))),
        )
        for choice in product(*choices)
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
                candidates = (*folder.responses, *(Response(path, "", "number", "") for path in folder.parameters))
                column = find_response(name, candidates, "--label").column
                responses[column] = replace(responses[column], label=label)
        self.responses = tuple(responses.values())
        self._of_point = lru_cache(maxsize=None)(folder.sample)
        self._summary = lru_cache(maxsize=None)(self._new_summary)

    def levels(self, path: str) -> Levels:
        """Return the levels of a parameter over all design points."""
        return replace(levels_of(path, self.folder.points), label=self._labels.get(path, ""))

    def sample(self, response: Response, points: tuple[int, ...]) -> Sample:
        """Return the values of all runs of these points."""
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
        """Return the values of all runs."""
        return self.sample(response, tuple(range(len(self.folder.points))))

    def table(self, response: Response, rows: Sequence[tuple[int, ...]]) -> SeedTable:
        """Return the values of the points of each row, padded with NaN.

        A censored time counts as the time until its run ended.
        """
        return _side_by_side([[self._of_point(response.column, point) for point in points] for points in rows])

    def reached(self, response: Response, rows: Sequence[tuple[int, ...]]) -> BoolArray:
        """Return, in the shape of `table`, True for values that were observed, not censored."""
        samples = [[self._of_point(response.column, point) for point in points] for points in rows]
        observed = [[replace(sample, value=sample.observed.astype(np.float64)) for sample in row] for row in samples]
        return _side_by_side(observed).value == 1.0

    def summary(self, response: Response, points: tuple[int, ...]) -> Summary:
        """Return the summary of the runs of these points."""
        return self._summary(response, points)

    def quartiles(self, response: Response, points: tuple[int, ...]) -> tuple[float, float, float]:
        """Return the quartiles of the runs of these points; inf: beyond the limit, NaN: no value."""
        sample = self.sample(response, points)
        if not len(sample):
            return (np.nan, np.nan, np.nan)
        if response.kind == "time":
            curve = kaplan_meier(sample)
            quartiles = [curve.quantile(share) for share in (0.25, 0.5, 0.75)]
            return tuple(np.nan_to_num(quartiles, nan=np.inf).tolist())
        return tuple(np.quantile(sample.value, (0.25, 0.5, 0.75)).tolist())

    def limit(self, response: Response) -> float | None:
        """Return the greatest censored value; None: no value is censored."""
        sample = self.all(response)
        censored = sample.value[~sample.observed]
        return float(censored.max()) if len(censored) else None

    def _new_summary(self, response: Response, points: tuple[int, ...]) -> Summary:
        return summary(self.sample(response, points))


def _side_by_side(rows: Sequence[Sequence[Sample]]) -> SeedTable:
    """Return the values of the first point of each row seed by seed, then those of the second, and so on."""
    blocks = [by_seed(list(column)) for column in zip_longest(*rows, fillvalue=_EMPTY_SAMPLE)]
    values = np.concatenate([np.empty((len(rows), 0)), *(block.value for block in blocks)], axis=1)
    return SeedTable(values, np.concatenate([np.empty(0, np.int64), *(block.seed for block in blocks)]))


@dataclass(frozen=True)
class ChosenResponses:
    """The responses of a campaign by their use in its report."""

    shown: tuple[Response, ...]
    others: tuple[Response, ...]  # not shown, although they vary
    constant: tuple[Response, ...]  # one value in all runs
    undefined: tuple[Response, ...]  # no value in any run


def choose_responses(samples: Samples, names: Sequence[str]) -> ChosenResponses:
    """Choose the responses of these names; without names at most MAX_SHOWN: times, final values, and the link PDR.

    BadInput for an unknown name.
    """
    named = tuple(dict.fromkeys(find_response(name, samples.responses) for name in names))
    unnamed = [response for response in samples.responses if response not in named]
    undefined = tuple(response for response in unnamed if not samples.all(response).observed.any())
    constant = tuple(response for response in unnamed if response not in undefined and not _varies(samples, response))
    varying = [response for response in samples.responses if response not in (*undefined, *constant)]
    usual = sorted((response for response in varying if response.is_usual), key=_rank)
    shown = named or tuple((usual or varying)[:MAX_SHOWN])
    others = tuple(response for response in varying if response not in shown)
    return ChosenResponses(shown, others, constant, undefined)


def _varies(samples: Samples, response: Response) -> bool:
    sample = samples.all(response)
    return bool(sample.value.min() < sample.value.max() or not sample.observed.all())


def _rank(response: Response) -> tuple[bool, bool, int]:
    """Return a sort key: times, then the scenario's metrics, then PREFERRED; others keep the campaign's order."""
    preference = PREFERRED.index(response.column) if response.column in PREFERRED else len(PREFERRED)
    return response.kind != "time", not response.listed, preference


@dataclass(frozen=True)
class CampaignData:
    """The samples of a campaign, and the responses that its report shows."""

    samples: Samples
    chosen: ChosenResponses

    @property
    def shown(self) -> tuple[Response, ...]:
        """Responses with figures and tables."""
        return self.chosen.shown

    @property
    def times(self) -> tuple[Response, ...]:
        """Shown responses that are times."""
        return tuple(response for response in self.shown if response.kind == "time")
