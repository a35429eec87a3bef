"""Specification of a tuning (searched paths, goal and seeds), its check, and the model of `tuning.json`."""

import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np

from swarmwire.comms.base.atomic import write_text
from swarmwire.comms.base.config import read_json
from swarmwire.comms.base.errors import BadInput
from swarmwire.deploy.campaigns.columns import Row
from swarmwire.deploy.campaigns.design import EXPECTED as EXPECTED_VARY
from swarmwire.deploy.campaigns.design import LIST, ParameterRange, Vary, toml_value, vary_of, whole_numbers
from swarmwire.deploy.campaigns.spec import CampaignPlan, SweepSpec, plan_of
from swarmwire.deploy.runs.config import MAX_SEED, seed_list
from swarmwire.metrics.records.campaign.campaign_json import (
    SCENARIO_FOLDER,
    Provenance,
    Response,
    Stat,
    find_statistic,
    value_text,
)
from swarmwire.metrics.records.campaign.folder import response_sample
from swarmwire.metrics.records.run_folder.layout import SCENARIO
from swarmwire.metrics.statistics.sample import Sample
from swarmwire.metrics.statistics.survival import kaplan_meier
from swarmwire.world.scenario.scenario import Scenario

Direction = Literal["min", "max"]
SHARES: dict[Stat, float] = {"q25": 0.25, "q50": 0.5, "q75": 0.75}
EXPECTED_GOAL = 'expected "min RESPONSE.STAT" or "max RESPONSE.STAT", such as "min aggregation_time_s.q50"'


class Reached(NamedTuple):
    """Evaluation of a goal for the runs of a point; NaN: no run has a value."""

    value: float  # value for Optuna
    statistic: float  # NaN also for a quantile of times beyond the limit
    censored: float  # share of the runs, 0 to 1; 0 for numbers
    undefined: int  # runs without a value


@dataclass(frozen=True)
class Goal:
    """A response's statistic over the seeds, and the direction to optimise it.

    Optuna's value is that statistic. A quantile of times beyond the limit, the longest duration of a run, has no
    statistic: its value is limit * (1 + censored share), which is beyond any time, and increases with the censored
    runs.
    """

    direction: Direction
    response: Response
    stat: Stat
    limit_s: float  # the longest duration of a run at any searched point

    @property
    def text(self) -> str:
        """The goal in the form that `goal_of` parses."""
        return f"{self.direction} {self.response.column}.{self.stat}"

    def reached(self, sample: Sample) -> Reached:
        """Evaluate the runs of a point."""
        if not len(sample):
            return Reached(math.nan, math.nan, 0.0, sample.undefined)
        statistic, value = self._statistic(sample), math.nan
        value = self.limit_s * (1.0 + sample.censored) if math.isnan(statistic) else statistic
        return Reached(value, statistic, sample.censored, sample.undefined)

    def better(self, value: float, than: float) -> bool:
        """Return True if `value` is better than `than`."""
        return value < than if self.direction == "min" else value > than

    def _statistic(self, sample: Sample) -> float:
        if self.stat == "censored":
            return sample.censored
        if sample.kind == "time":
            curve = kaplan_meier(sample)
            if self.stat != "mean":
                return curve.quantile(SHARES[self.stat])
            # The mean of min(time, limit) has the same restriction time in every trial.
            return curve.restricted_mean(float(self.response.watched_s(np.array(self.limit_s))))
        if self.stat == "mean":
            return float(sample.value.mean())
        return float(np.quantile(sample.value, SHARES[self.stat]))


def goal_of(text: str, responses: Iterable[Response], limit_s: float) -> Goal:
    """Parse a goal such as "max order"; BadInput unless it has a direction and one of these responses."""
    direction, _, name = text.strip().partition(" ")
    if direction not in ("min", "max") or not name.strip():
        raise BadInput("--goal", "", f"{EXPECTED_GOAL}; got {text!r}")
    response, stat = find_statistic(name.strip(), responses, "--goal")
    return Goal("min" if direction == "min" else "max", response, stat, limit_s)


def sample_of(rows: Sequence[Row], response: Response) -> Sample:
    """Return the values of a response in the rows of a point, none of which failed."""
    value = np.array([_number(row.get(response.column)) for row in rows])
    end_s = np.array([row["sim_time_s"] for row in rows], np.float64)
    return response_sample(response, value, end_s, np.array([row["seed"] for row in rows], np.int64))


def _number(cell: Any) -> float:
    return math.nan if cell is None else float(cell)


EXPECTED_SEARCH = (
    "expected PATH=LOW:HIGH, such as radio.range_m=1:5, with :log for equal ratios, or choices: PATH=a,b,c"
)
Parameter = int | float | str  # Optuna's value: the text of a choice, or a number
MAX_TRIALS = 100_000
MAX_PARALLEL = 1000
OPTION = "--check-seeds"
TUNING_FILE = "tuning.json"
FORMAT = 1
NEAR_END = 0.01  # fraction of a range


@dataclass(frozen=True)
class Search:
    """A searched path: choices, or without choices the numbers from low to high, both ends included."""

    path: str
    low: float = 0.0
    high: float = 0.0
    whole: bool = False
    log: bool = False  # equal ratios

    choices: tuple[Any, ...] = ()
    overrides: tuple[str, ...] = ()  # override of each choice, for the scenario in the tuning's folder

    @property
    def names(self) -> tuple[str, ...]:
        """The choices as texts, which are Optuna's values."""
        return tuple(value_text(choice) for choice in self.choices)

    @property
    def trials(self) -> tuple[Any, ...]:
        """Values that must fit the scenario: all choices, or both ends."""
        return self.choices or (self._number(self.low), self._number(self.high))

    def end_at(self, parameter: Parameter) -> float | None:
        """Return the end of the range within 1 % of the range of the parameter; None: neither, or a choice."""
        if self.choices:
            return None
        low, high, number = self.low, self.high, float(parameter)
        if self.log:
            low, high, number = math.log(low), math.log(high), math.log(number)
        margin = NEAR_END * (high - low)
        return self.low if number <= low + margin else self.high if number >= high - margin else None

    def value(self, parameter: Parameter) -> Any:
        """Return the scenario's value of a parameter."""
        return self.choices[self.names.index(str(parameter))] if self.choices else parameter

    def override(self, parameter: Parameter) -> str:
        """Return the override of a parameter, for the scenario in the tuning's folder."""
        if self.choices:
            return self.overrides[self.names.index(str(parameter))]
        return f"{self.path}={toml_value(parameter)}"

    def _number(self, end: float) -> float:
        return int(end) if self.whole else end


def search_of(text: str) -> Vary:
    """Parse `PATH=…` of the option `--search`; BadInput for any other form."""
    where = f"--search {text}"
    try:
        vary = replace(vary_of(text), where=where)
    except BadInput as error:
        raise BadInput(where, "", EXPECTED_SEARCH if error.expected == EXPECTED_VARY else error.expected) from None
    if isinstance(vary.values, ParameterRange) and vary.values.count is not None:
        raise vary.refused(EXPECTED_SEARCH)
    return vary


def search_from(vary: Vary, is_whole: Callable[[str], bool]) -> Search:
    """Return the search over a varied path; numbers are whole if the scenario's are. BadInput for an empty range."""
    values = vary.values
    if not isinstance(values, ParameterRange):
        search = Search(vary.path, choices=values)
        if len(set(search.names)) < len(values):
            raise vary.refused("expected different choices")
        return search
    is_integer, low, high = is_whole(vary.path), float(values.first), float(values.last)
    if is_integer:
        low, high = float(math.floor(low + 0.5)), float(math.floor(high + 0.5))
    if low >= high:
        raise vary.refused(f"expected LOW below HIGH{', as whole numbers' if is_integer else ''}")
    if is_integer and values.log and low < 1:
        raise vary.refused("expected LOW of at least 1 for equal ratios (log)")
    return Search(vary.path, low, high, is_integer, values.log)


@dataclass(frozen=True)
class TuningSpec:
    """Specification of a tuning."""

    scenario: Path
    searched: tuple[Vary, ...]
    goal: str
    seeds: tuple[int, ...]  # seeds of each trial
    check_seeds: tuple[int, ...]  # other seeds, for the check of the best trial
    trials: int
    parallel_trials: int
    sampler_seed: int
    overrides: tuple[str, ...] = ()


@dataclass(frozen=True)
class TuningPlan:
    """A checked specification, with its scenario, searches and goal."""

    spec: TuningSpec
    scenario: Scenario  # the scenario with the overrides
    searches: tuple[Search, ...]
    ends: tuple[CampaignPlan, ...]  # plan of each search: the scenario at its choices, or at both ends
    goal: Goal
    code: tuple[str, ...]  # specs of users' classes


def tuning_plan(spec: TuningSpec) -> TuningPlan:
    """Check a tuning; BadInput for an invalid specification."""
    _check_numbers(spec)
    _check_paths(spec.searched)
    baseline = plan_of(SweepSpec(spec.scenario, spec.seeds, overrides=spec.overrides))
    is_whole = whole_numbers(baseline.scenario)
    searches = tuple(search_from(vary, is_whole) for vary in spec.searched)
    ends = tuple(_ends(spec, vary, search) for vary, search in zip(spec.searched, searches, strict=True))
    plans = (baseline, *ends)
    responses = {response.column: response for plan in plans for response in plan.responses}
    limit_s = max(plan.scenario_at(point).duration_s for plan in plans for point in plan.points)
    goal = goal_of(spec.goal, responses.values(), limit_s)
    code = tuple(dict.fromkeys(spec for plan in plans for spec in plan.code))
    return TuningPlan(spec, baseline.scenario, searches, ends, goal, code)


def check_trials(trials: int) -> None:
    """Raise BadInput unless the number of trials is valid."""
    if not 0 < trials <= MAX_TRIALS:
        raise BadInput("--trials", "", f"expected 1 to {MAX_TRIALS}, got {trials}")


def _check_numbers(spec: TuningSpec) -> None:
    check_trials(spec.trials)
    if not 0 < spec.parallel_trials <= MAX_PARALLEL:
        raise BadInput("--parallel-trials", "", f"expected 1 to {MAX_PARALLEL}, got {spec.parallel_trials}")
    if spec.sampler_seed < 0:
        raise BadInput("--sampler-seed", "", f"expected a whole number of at least 0, got {spec.sampler_seed}")


def _check_paths(searched: Sequence[Vary]) -> None:
    if not searched:
        raise BadInput("--search", "", "is missing: expected PATH=LOW:HIGH or PATH=a,b,c, once for each parameter")
    for index, vary in enumerate(searched):
        for other in searched[:index]:
            first, second = f"{vary.path}.", f"{other.path}."
            if first.startswith(second) or second.startswith(first):
                raise vary.refused(f"expected each path once, and none within another: {other.path} is searched, too")


def _ends(spec: TuningSpec, vary: Vary, search: Search) -> CampaignPlan:
    """Return the plan of all choices of a search, or of both its ends; BadInput if one does not fit the scenario."""
    try:
        ends = Vary(vary.path, search.trials, vary.where)
        return plan_of(SweepSpec(spec.scenario, spec.seeds, (ends,), LIST, overrides=spec.overrides))
    except BadInput as error:
        if error.where.startswith("--vary "):  # the fault is at another key than the path
            raise BadInput(vary.where, error.key, error.expected) from None
        raise


def fresh_seeds(text: str, used: tuple[int, ...]) -> tuple[int, ...]:
    """Parse a number of seeds after the largest used one, or a list; BadInput unless they are all unused."""
    seeds = seed_list(text, OPTION)
    if text.strip().isdecimal():
        first = max(used) + 1
        if first + len(seeds) - 1 > MAX_SEED:
            raise BadInput(OPTION, "", "expected FIRST:END or a list: there are too few above the tuning's seeds")
        return tuple(range(first, first + len(seeds)))
    common = sorted(set(seeds) & set(used))
    if common:
        raise BadInput(OPTION, "", f"expected other seeds than those of the trials; {common[0]} is among both")
    return seeds


@dataclass(frozen=True)
class Tuning(Provenance):
    """Content of tuning.json."""

    overrides: tuple[str, ...]  # overrides of all trials; the scenario in the folder includes them
    searches: tuple[Search, ...]
    goal: Goal
    robots: int  # largest number of robots of an arena, at either end of any range
    seeds: tuple[int, ...]  # the same in every trial
    check_seeds: tuple[int, ...]
    trials: int
    parallel_trials: int  # number of trials that are proposed together
    sampler_seed: int

    def overrides_of(self, parameters: Mapping[str, Parameter]) -> tuple[str, ...]:
        """Return a trial's parameters as overrides of the scenario in the folder."""
        return tuple(search.override(parameters[search.path]) for search in self.searches)


def scenario_file(folder: Path) -> Path:
    """Return the absolute path of the scenario in a tuning's folder, for tasks."""
    return (folder / SCENARIO_FOLDER / SCENARIO).absolute()


def read_tuning(folder: Path) -> Tuning:
    """Read the tuning of this folder; BadInput if there is none, if it is damaged, or of another format."""
    return read_json(Tuning, folder / TUNING_FILE, FORMAT)


def write_tuning(tuning: Tuning, folder: Path) -> None:
    """Write `tuning.json`; OSError if it cannot be written."""
    write_text(folder / TUNING_FILE, json.dumps({"format": FORMAT, **asdict(tuning)}, indent=1) + "\n")
