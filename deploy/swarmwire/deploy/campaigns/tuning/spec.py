"""A tuning: what is searched, for which goal, with which seeds, as people ask for it and as `tuning.json` says it."""

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
from swarmwire.deploy.campaigns.design import EXPECTED as OF_VARY
from swarmwire.deploy.campaigns.design import LIST, Range, Vary, toml_value, vary_of, whole_numbers
from swarmwire.deploy.campaigns.spec import Plan, SweepSpec, plan_of
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
    """What a goal makes of the runs of a point; NaN: no run gave a value."""

    value: float  # that Optuna is given
    statistic: float  # NaN also of a quantile of times beyond the limit
    censored: float  # share of the runs, 0 to 1; 0 of numbers
    undefined: int  # runs with nothing to measure


@dataclass(frozen=True)
class Goal:
    """A response's statistic over the seeds, and which way it is to go.

    The value that Optuna is given is that statistic. A quantile of a time that was not reached has none: it is known to
    lie beyond the limit, the longest duration that a run can have. Its value is then limit * (1 + share of runs
    censored): beyond any that was reached, and the further, the more runs did not come to it.
    """

    direction: Direction
    response: Response
    stat: Stat
    limit_s: float  # the longest duration of a run at any point that is searched

    @property
    def text(self) -> str:
        """As people write it."""
        return f"{self.direction} {self.response.column}.{self.stat}"

    def reached(self, sample: Sample) -> Reached:
        """What the runs of a point came to."""
        if not len(sample):
            return Reached(math.nan, math.nan, 0.0, sample.undefined)
        statistic, value = self._statistic(sample), math.nan
        value = self.limit_s * (1.0 + sample.censored) if math.isnan(statistic) else statistic
        return Reached(value, statistic, sample.censored, sample.undefined)

    def better(self, value: float, than: float) -> bool:
        """Whether one value is better than another."""
        return value < than if self.direction == "min" else value > than

    def _statistic(self, sample: Sample) -> float:
        if self.stat == "censored":
            return sample.censored
        if sample.kind == "time":
            curve = kaplan_meier(sample)
            if self.stat != "mean":
                return curve.quantile(SHARES[self.stat])
            # Of min(time, limit): every trial's mean is then up to the same time.
            return curve.restricted_mean(float(self.response.watched_s(np.array(self.limit_s))))
        if self.stat == "mean":
            return float(sample.value.mean())
        return float(np.quantile(sample.value, SHARES[self.stat]))


def goal_of(text: str, responses: Iterable[Response], limit_s: float) -> Goal:
    """The goal that a text says; BadInput unless it is one of these responses, with a way to go."""
    direction, _, name = text.strip().partition(" ")
    if direction not in ("min", "max") or not name.strip():
        raise BadInput("--goal", "", f"{EXPECTED_GOAL}; got {text!r}")
    response, stat = find_statistic(name.strip(), responses, "--goal")
    return Goal("min" if direction == "min" else "max", response, stat, limit_s)


def sample_of(rows: Sequence[Row], response: Response) -> Sample:
    """The values of a response in rows of a point, none of which failed, by seed."""
    value = np.array([_number(row.get(response.column)) for row in rows])
    end_s = np.array([row["sim_time_s"] for row in rows], np.float64)
    return response_sample(response, value, end_s, np.array([row["seed"] for row in rows], np.int64))


def _number(cell: Any) -> float:
    return math.nan if cell is None else float(cell)


EXPECTED_SEARCH = (
    "expected PATH=LOW:HIGH, such as radio.range_m=1:5, with :log for equal ratios, or choices: PATH=a,b,c"
)
Parameter = int | float | str  # as Optuna knows it: of choices the text
MAX_TRIALS = 100_000
MAX_PARALLEL = 1000
OPTION = "--check-seeds"
ABOUT = "tuning.json"
FORMAT = 1
NEAR_END = 0.01  # of a range


@dataclass(frozen=True)
class Search:
    """One path that is searched: choices, or where there are none the numbers from low to high, both ends included."""

    path: str
    low: float = 0.0
    high: float = 0.0
    whole: bool = False
    log: bool = False  # in equal ratios
    choices: tuple[Any, ...] = ()
    overrides: tuple[str, ...] = ()  # of each choice, for the scenario in the tuning's folder, whose files are copies

    @property
    def names(self) -> tuple[str, ...]:
        """The choices as texts, by which Optuna knows them."""
        return tuple(value_text(choice) for choice in self.choices)

    @property
    def trials(self) -> tuple[Any, ...]:
        """Values that must be fit for the scenario: all choices, or both ends."""
        return self.choices or (self._number(self.low), self._number(self.high))

    def end_at(self, parameter: Parameter) -> float | None:
        """The end of the range at which the parameter is, within 1 % of the range; None: at neither, or a choice."""
        if self.choices:
            return None
        low, high, at = self.low, self.high, float(parameter)
        if self.log:
            low, high, at = math.log(low), math.log(high), math.log(at)
        margin = NEAR_END * (high - low)
        return self.low if at <= low + margin else self.high if at >= high - margin else None

    def value(self, parameter: Parameter) -> Any:
        """The scenario's value that a parameter stands for."""
        return self.choices[self.names.index(str(parameter))] if self.choices else parameter

    def override(self, parameter: Parameter) -> str:
        """The same as for `--set`, of the scenario in the tuning's folder."""
        if self.choices:
            return self.overrides[self.names.index(str(parameter))]
        return f"{self.path}={toml_value(parameter)}"

    def _number(self, end: float) -> float:
        return int(end) if self.whole else end


def search_of(text: str) -> Vary:
    """What `--search PATH=…` says; BadInput if it is none of the forms."""
    where = f"--search {text}"
    try:
        vary = replace(vary_of(text), where=where)
    except BadInput as error:
        raise BadInput(where, "", EXPECTED_SEARCH if error.expected == OF_VARY else error.expected) from None
    if isinstance(vary.values, Range) and vary.values.count is not None:
        raise vary.refused(EXPECTED_SEARCH)
    return vary


def search_from(vary: Vary, is_whole: Callable[[str], bool]) -> Search:
    """The search over what varies; numbers are whole where the scenario's are. BadInput for an empty range."""
    of = vary.values
    if not isinstance(of, Range):
        search = Search(vary.path, choices=of)
        if len(set(search.names)) < len(of):
            raise vary.refused("expected different choices")
        return search
    whole, low, high = is_whole(vary.path), float(of.first), float(of.last)
    if whole:
        low, high = float(math.floor(low + 0.5)), float(math.floor(high + 0.5))
    if low >= high:
        raise vary.refused(f"expected LOW below HIGH{', as whole numbers' if whole else ''}")
    if whole and of.log and low < 1:
        raise vary.refused("expected LOW of at least 1 for equal ratios (log)")
    return Search(vary.path, low, high, whole, of.log)


@dataclass(frozen=True)
class TuningSpec:
    """A tuning as people ask for it."""

    scenario: Path
    searched: tuple[Vary, ...]
    goal: str
    seeds: tuple[int, ...]  # of each trial
    check_seeds: tuple[int, ...]  # others, on which the best is checked
    trials: int
    parallel_trials: int
    sampler_seed: int
    overrides: tuple[str, ...] = ()


@dataclass(frozen=True)
class TuningPlan:
    """A tuning that can be run: `spec`, and what it comes to."""

    spec: TuningSpec
    scenario: Scenario  # with the overrides
    searches: tuple[Search, ...]
    ends: tuple[Plan, ...]  # of each search: the scenario at its choices, or both ends
    goal: Goal
    code: tuple[str, ...]  # the specs of users' classes


def tuning_plan(spec: TuningSpec) -> TuningPlan:
    """Check a tuning; BadInput for anything that is invalid."""
    _check_numbers(spec)
    _check_paths(spec.searched)
    own = plan_of(SweepSpec(spec.scenario, spec.seeds, overrides=spec.overrides))
    is_whole = whole_numbers(own.scenario)
    searches = tuple(search_from(vary, is_whole) for vary in spec.searched)
    ends = tuple(_ends(spec, vary, search) for vary, search in zip(spec.searched, searches, strict=True))
    plans = (own, *ends)
    responses = {of.column: of for plan in plans for of in plan.responses}
    limit_s = max(plan.at(point).duration_s for plan in plans for point in plan.points)
    goal = goal_of(spec.goal, responses.values(), limit_s)
    code = tuple(dict.fromkeys(spec for plan in plans for spec in plan.code))
    return TuningPlan(spec, own.scenario, searches, ends, goal, code)


def check_trials(trials: int) -> None:
    """BadInput unless so many trials make sense."""
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
    for place, vary in enumerate(searched):
        for other in searched[:place]:
            one, two = f"{vary.path}.", f"{other.path}."
            if one.startswith(two) or two.startswith(one):
                raise vary.refused(f"expected each path once, and none within another: {other.path} is searched, too")


def _ends(spec: TuningSpec, vary: Vary, search: Search) -> Plan:
    """The scenario at all choices of a search, or at both its ends, all else as it is; BadInput if one is no good."""
    try:
        ends = Vary(vary.path, search.trials, vary.where)
        return plan_of(SweepSpec(spec.scenario, spec.seeds, (ends,), LIST, overrides=spec.overrides))
    except BadInput as error:
        if error.where.startswith("--vary "):  # elsewhere than at the path itself
            raise BadInput(vary.where, error.key, error.expected) from None
        raise


def fresh_seeds(given: str, used: tuple[int, ...]) -> tuple[int, ...]:
    """So many seeds after the largest that was used, or those listed; BadInput unless they are all fresh."""
    seeds = seed_list(given, OPTION)
    if given.strip().isdecimal():
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
    """tuning.json: all that a tuning is made from."""

    overrides: tuple[str, ...]  # of all trials, which the scenario in the folder has in it
    searches: tuple[Search, ...]
    goal: Goal
    robots: int  # in an arena, at most, at either end of any range
    seeds: tuple[int, ...]  # the same in every trial
    check_seeds: tuple[int, ...]
    trials: int
    parallel_trials: int  # that are proposed together
    sampler_seed: int

    def overrides_of(self, parameters: Mapping[str, Parameter]) -> tuple[str, ...]:
        """A trial's parameters as for `--set`, of the scenario in the folder."""
        return tuple(search.override(parameters[search.path]) for search in self.searches)


def scenario_file(folder: Path) -> Path:
    """The scenario in a tuning's folder, as tasks name it."""
    return (folder / SCENARIO_FOLDER / SCENARIO).absolute()


def read_tuning(folder: Path) -> Tuning:
    """The tuning of this folder; BadInput if there is none, if it is damaged, or of another format."""
    return read_json(Tuning, folder / ABOUT, FORMAT)


def write_tuning(tuning: Tuning, folder: Path) -> None:
    """Write `tuning.json`; OSError if the disk will not."""
    write_text(folder / ABOUT, json.dumps({"format": FORMAT, **asdict(tuning)}, indent=1) + "\n")
