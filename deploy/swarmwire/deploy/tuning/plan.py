"""What people ask of a tuning, checked at the door: both ends of every range, every choice, the goal, the seeds."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from swarmwire.comms.config import did_you_mean
from swarmwire.comms.errors import BadInput
from swarmwire.deploy.campaign.design import LIST
from swarmwire.deploy.campaign.plan import Asked, Plan, planned
from swarmwire.deploy.campaign.vary import Vary
from swarmwire.deploy.campaign.whole_numbers import whole_numbers
from swarmwire.deploy.tuning.goal import Goal, goal_of
from swarmwire.deploy.tuning.search import Search, search_from
from swarmwire.world.scenario.scenario import Scenario

SAMPLERS = ("tpe", "random")
MAX_TRIALS = 100_000
MAX_AT_ONCE = 1000


@dataclass(frozen=True)
class TuningAsked:
    """A tuning as people ask for it."""

    scenario: Path
    searched: tuple[Vary, ...]
    goal: str
    seeds: tuple[int, ...]  # of each trial
    check_seeds: tuple[int, ...]  # others, on which the best is checked
    trials: int
    batch: int
    sampler: str
    sampler_seed: int
    overrides: tuple[str, ...] = ()


@dataclass(frozen=True)
class TuningPlan:
    """A tuning that can be run: `asked`, and what it comes to."""

    asked: TuningAsked
    scenario: Scenario  # with the overrides
    searches: tuple[Search, ...]
    ends: tuple[Plan, ...]  # of each search: the scenario at its choices, or both ends
    goal: Goal
    code: tuple[str, ...]  # the specs of users' classes


def planned_tuning(asked: TuningAsked) -> TuningPlan:
    """The plan of what was asked; BadInput for all that is no good."""
    _check_numbers(asked)
    _check_paths(asked.searched)
    own = planned(Asked(asked.scenario, asked.seeds, overrides=asked.overrides))
    is_whole = whole_numbers(own.scenario)
    searches = tuple(search_from(vary, is_whole) for vary in asked.searched)
    ends = tuple(_ends(asked, vary, search) for vary, search in zip(asked.searched, searches, strict=True))
    plans = (own, *ends)
    responses = {of.column: of for plan in plans for of in plan.responses}
    limit_s = max(plan.at(point).duration_s for plan in plans for point in plan.points)
    goal = goal_of(asked.goal, responses.values(), limit_s)
    code = tuple(dict.fromkeys(spec for plan in plans for spec in plan.code))
    return TuningPlan(asked, own.scenario, searches, ends, goal, code)


def check_trials(trials: int) -> None:
    """BadInput unless so many trials make sense."""
    if not 0 < trials <= MAX_TRIALS:
        raise BadInput("--trials", "", f"expected 1 to {MAX_TRIALS}, got {trials}")


def _check_numbers(asked: TuningAsked) -> None:
    check_trials(asked.trials)
    if not 0 < asked.batch <= MAX_AT_ONCE:
        raise BadInput("--batch", "", f"expected 1 to {MAX_AT_ONCE}, got {asked.batch}")
    if asked.sampler not in SAMPLERS:
        raise BadInput("--sampler", "", f"expected {did_you_mean(SAMPLERS, asked.sampler)}; got {asked.sampler!r}")
    if asked.sampler_seed < 0:
        raise BadInput("--sampler-seed", "", f"expected a whole number of at least 0, got {asked.sampler_seed}")


def _check_paths(searched: Sequence[Vary]) -> None:
    if not searched:
        raise BadInput("--search", "", "is missing: expected PATH=LOW:HIGH or PATH=a,b,c, once for each parameter")
    for place, vary in enumerate(searched):
        for other in searched[:place]:
            one, two = f"{vary.path}.", f"{other.path}."
            if one.startswith(two) or two.startswith(one):
                raise vary.refused(f"expected each path once, and none within another: {other.path} is searched, too")


def _ends(asked: TuningAsked, vary: Vary, search: Search) -> Plan:
    """The scenario at all choices of a search, or at both its ends, all else as it is; BadInput if one is no good."""
    try:
        ends = Vary(vary.path, search.trials, vary.said)
        return planned(Asked(asked.scenario, asked.seeds, (ends,), LIST, overrides=asked.overrides))
    except BadInput as error:
        if error.where.startswith("--vary "):  # elsewhere than at the path itself
            raise BadInput(vary.said, error.key, error.expected) from None
        raise
