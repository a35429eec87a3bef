"""Expectations of runs and campaigns, such as `order.final >= 0.9`, and whether the results meet them.

An expectation of a campaign is met at a design point if the 95 % interval of the statistic lies wholly on the side that
it names. Intervals of fewer than MIN_RUNS runs are too narrow: they meet nothing, as do failed and missing runs.
"""

import math
import operator
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, cast

import numpy as np

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.config import did_you_mean
from swarmwire.comms.base.errors import BadInput
from swarmwire.metrics.records.campaign.campaign_json import CAMPAIGN_FILE, FINAL, LINK_PDR, STOP_TIME, Stat, point_text
from swarmwire.metrics.records.campaign.folder import PointSelection, select
from swarmwire.metrics.records.run_folder.reader import RunFolder
from swarmwire.metrics.statistics.bootstrap import binomial_interval
from swarmwire.metrics.statistics.sample import Interval, Sample, number_sample
from swarmwire.metrics.statistics.summary import interval_text, quantile_text, summary
from swarmwire.metrics.text import counted, number_text

COMPARISONS: dict[str, Callable[[float, float], bool]] = {
    ">=": operator.ge,
    "<=": operator.le,
    ">": operator.gt,
    "<": operator.lt,
}
GRAMMAR = re.compile(
    r"\s*(?P<name>[^\s<>=]+)\s*(?P<comparison>[<>]=?)\s*(?P<bound>[^\s<>=]+)"
    r"(?:\s+in\s+(?P<percent>[\d.]+)\s*%\s+of\s+runs)?\s*"
)
EXAMPLES = "such as 'order.final >= 0.9' or 'radio.pdr > 0.5 in 80 % of runs'"
COUNTS = "counts."
MIN_RUNS = 6  # with fewer, more than 2 x 2.5 % of samples lie wholly on one side of their median: 2 / 2^5 = 6 %
USUAL = (STOP_TIME, "radio.pdr", LINK_PDR)  # beside last values of metrics, in suggestions


@dataclass(frozen=True)
class Expectation:
    """A bound of a response; with `share` of each run, at least in this share of the runs, else of a statistic."""

    text: str  #: as the user wrote it
    name: str  #: the response, or a statistic of it
    comparison: str
    bound: float
    share: float | None  #: 0 to 1

    def holds(self, value: float) -> bool:
        """Return True if a value meets the bound; NaN never does."""
        return COMPARISONS[self.comparison](value, self.bound)

    def holds_within(self, interval: Interval) -> bool:
        """Return True if all values of an interval meet the bound."""
        return self.holds(interval.low) and self.holds(interval.high)


class Verdict(NamedTuple):
    """Whether an expectation is met at one design point, or by one run."""

    expectation: Expectation
    at: str  #: the design point: `radio.loss=0.4`; empty for a run, or where nothing was varied
    is_met: bool
    measured: str  #: what was measured, for people

    @property
    def title(self) -> str:
        """The expectation and its design point."""
        return f"{self.expectation.text} at {self.at}" if self.at else self.expectation.text


def parse_expectation(text: str) -> Expectation:
    """Parse `NAME >= NUMBER`, also with `in 80 % of runs`; BadInput for any other text."""
    match = GRAMMAR.fullmatch(text)
    if match is None:
        raise BadInput("expectation", text, f"expected a name, one of {' '.join(COMPARISONS)} and a number, {EXAMPLES}")
    bound, percent = _number(match["bound"], text), match["percent"]
    share = None if percent is None else _number(percent, text) / 100.0
    if share is not None and share > 1.0:
        raise BadInput("expectation", text, f"expected a share up to 100 %, {EXAMPLES}")
    return Expectation(text.strip(), match["name"], match["comparison"], bound, share)


def _number(digits: str, text: str) -> float:
    try:
        value = float(digits)
    except ValueError:
        value = math.nan
    if math.isnan(value):
        raise BadInput("expectation", text, f"expected a number, {EXAMPLES}; got {digits!r}")
    return value


def verdicts(text: str, expectations: Sequence[Expectation]) -> list[Verdict]:
    """Return the verdicts on a run's folder, or at each design point of a campaign (`FOLDER@radio.loss=0.4`: of these).

    BadInput if there is neither, or for a name without values.
    """
    folder = Path(text)
    if folder.is_dir() and not (folder / CAMPAIGN_FILE).exists():
        return _run_verdicts(RunFolder(folder), expectations)
    selection = select(text)
    return [_point_verdict(selection, point, each) for each in expectations for point in selection.points]


def _point_verdict(selection: PointSelection, point: int, expectation: Expectation) -> Verdict:
    campaign, seeds = selection.campaign, len(selection.campaign.about.seeds)
    at = point_text(campaign.points[point])
    statistic = campaign.statistic(expectation.name)
    if (
        expectation.share is not None
        and expectation.name.endswith(f".{statistic.stat}")
        and expectation.name != statistic.response.column
    ):
        raise BadInput("expectation", expectation.text, f"expected a response with a share of runs: {expectation.name}")
    sample = campaign.sample(statistic.response.column, point)
    missing = seeds - len(sample) - sample.failed - sample.undefined
    if missing or sample.failed:
        faults = [
            f"{counted(count, 'run')} {fault}"
            for count, fault in ((sample.failed, "failed"), (missing, "missing"))
            if count
        ]
        return Verdict(expectation, at, False, f"{' and '.join(faults)} of {seeds}")
    return _verdict(expectation, at, sample, statistic.stat)


def _verdict(expectation: Expectation, at: str, sample: Sample, stat: Stat) -> Verdict:
    """Return the verdict on a sample whose runs have all ended."""
    runs = len(sample) + sample.undefined
    if expectation.share is not None:
        # A time that was not observed meets no upper bound, and a lower one if it was watched for so long.
        unobserved = sample.value if expectation.comparison in (">=", ">") else np.inf
        holds = [expectation.holds(value) for value in np.where(sample.observed, sample.value, unobserved).tolist()]
        low, high = (float(end[0]) for end in binomial_interval(np.array([sum(holds)]), np.array([runs])))
        measured = f"{sum(holds)} of {counted(runs, 'run')}, {low:.0%} to {high:.0%}"
        return Verdict(expectation, at, low >= expectation.share, measured)
    if sample.undefined:
        return Verdict(expectation, at, False, f"{sample.undefined} of {counted(runs, 'run')} without a value")
    of_all = summary(sample)
    intervals = {"q50": of_all.q50_interval, "mean": of_all.mean_interval}
    if stat not in intervals:
        expected = f"expected a median or a mean, which have intervals: {stat} has none"
        raise BadInput("expectation", expectation.text, expected)
    value = of_all.q50 if stat == "q50" else of_all.mean
    if runs < MIN_RUNS:
        measured = f"{number_text(value)}, {counted(runs, 'run')}: at least {MIN_RUNS} are needed"
        return Verdict(expectation, at, False, measured)
    measured = f"{quantile_text(value, of_all.limit)} ({interval_text(intervals[stat])}), {counted(runs, 'run')}"
    return Verdict(expectation, at, expectation.holds_within(intervals[stat]), measured)


def _run_verdicts(run: RunFolder, expectations: Sequence[Expectation]) -> list[Verdict]:
    content = run.summary
    if content is None:
        raise BadInput(str(run.path), "", "expected a run that has ended: it has no summary")
    return summary_verdicts(content, expectations, str(run.path))


def summary_verdicts(content: dict[str, Any], expectations: Sequence[Expectation], where: str) -> list[Verdict]:
    """Return the verdicts on a run by its summary; several arenas are runs of one sample.

    BadInput, with `where`, for a name without values.
    """
    values = _run_values(content)
    rows: list[Verdict] = []
    for expectation in expectations:
        name = expectation.name if expectation.name in values else expectation.name + FINAL
        if name not in values and not name.startswith(COUNTS):
            names = [column.removesuffix(FINAL) for column in values if column.endswith(FINAL) or column in USUAL]
            raise BadInput(where, expectation.name, f"expected {did_you_mean(names, expectation.name)}")
        unfaulted: FloatArray = np.zeros(len(content["by_arena"]))
        numbers = values.get(name, unfaulted)
        if content["ended"] in ("failed", "interrupted"):
            rows.append(Verdict(expectation, "", False, f"the run was {content['ended']}"))
        elif len(numbers) == 1:
            number = float(numbers[0])
            rows.append(Verdict(expectation, "", expectation.holds(number), f"{number_text(number)}, 1 run"))
        else:
            rows.append(_verdict(expectation, "", number_sample(numbers), "q50"))
    return rows


def _run_values(content: dict[str, Any]) -> dict[str, FloatArray]:
    """Return the numbers of a summary by the names of a campaign's columns, one per arena; NaN: undefined."""
    arenas: int = content["arenas"]
    metrics, radio = (part if arenas > 1 else [part] for part in (content["metrics"], content["radio"]))
    rows: list[dict[str, float | None]] = []
    for index, arena in enumerate(content["by_arena"]):
        row: dict[str, float | None] = {key: arena[key] for key in ("ticks", "sim_time_s", STOP_TIME)}
        for name, statistics in metrics[index].items():
            row |= {f"{name}.{statistic}": value for statistic, value in statistics.items()}
        row |= _flat("radio.", radio[index] or {}) | _flat(COUNTS, arena["counts"])
        rows.append(row)
    names = dict.fromkeys(name for row in rows for name in row)
    return {name: np.array([_or_nan(row.get(name)) for row in rows]) for name in names}


def _flat(prefix: str, table: dict[str, Any]) -> dict[str, float | None]:
    """Return the numbers of nested tables, their keys joined by dots."""
    flat: dict[str, float | None] = {}
    for key, value in table.items():
        if isinstance(value, dict):
            flat |= _flat(f"{prefix}{key}.", cast("dict[str, Any]", value))
        elif value is None or isinstance(value, int | float):
            flat[prefix + key] = value
    return flat


def _or_nan(value: float | None) -> float:
    return math.nan if value is None else float(value)
