"""A tuning: what is searched, for which goal, with which seeds, as people ask for it and as `tuning.json` says it."""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from math import floor
from pathlib import Path
from typing import Any

from swarmwire.comms.config import did_you_mean, read_json
from swarmwire.comms.errors import BadInput
from swarmwire.deploy.campaign.design import EXPECTED as OF_VARY
from swarmwire.deploy.campaign.design import LIST, Range, Vary, toml_value, vary_of, whole_numbers
from swarmwire.deploy.campaign.spec import Plan, SweepSpec, plan_of
from swarmwire.deploy.config import LARGEST_SEED, seed_list
from swarmwire.deploy.tuning.goal import Goal, goal_of
from swarmwire.metrics.atomic import write_text
from swarmwire.metrics.campaign.spec import SCENARIO_FOLDER, Provenance, value_text
from swarmwire.metrics.run_folder.layout import SCENARIO
from swarmwire.world.scenario.scenario import Scenario

EXPECTED = "expected PATH=LOW:HIGH, such as radio.range_m=1:5, with :log for equal ratios, or choices: PATH=a,b,c"
Parameter = int | float | str  # as Optuna knows it: of choices the text
SAMPLERS = ("tpe", "random")
MAX_TRIALS = 100_000
MAX_PARALLEL = 1000
OPTION = "--check-seeds"
ABOUT = "tuning.json"
FORMAT = 1


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
        raise BadInput(where, "", EXPECTED if error.expected == OF_VARY else error.expected) from None
    if isinstance(vary.values, Range) and vary.values.count is not None:
        raise vary.refused(EXPECTED)
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
        low, high = float(floor(low + 0.5)), float(floor(high + 0.5))
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
    sampler: str
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
    if spec.sampler not in SAMPLERS:
        raise BadInput("--sampler", "", f"expected {did_you_mean(SAMPLERS, spec.sampler)}; got {spec.sampler!r}")
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
        if first + len(seeds) - 1 > LARGEST_SEED:
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
    sampler: str
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
