"""What is searched, as Optuna says it."""

from collections.abc import Mapping, Sequence

from optuna.distributions import (
    BaseDistribution,
    CategoricalDistribution,
    FloatDistribution,
    IntDistribution,
)

from swarmwire.deploy.tuning.goal import Goal
from swarmwire.deploy.tuning.search import Search


def space_of(searches: Sequence[Search]) -> Mapping[str, BaseDistribution]:
    """The distribution of each path."""
    return {search.path: _distribution(search) for search in searches}


def direction_of(goal: Goal) -> str:
    """Which way the value is to go."""
    return "minimize" if goal.direction == "min" else "maximize"


def _distribution(search: Search) -> BaseDistribution:
    if search.choices:
        return CategoricalDistribution(search.names)
    if search.whole:
        return IntDistribution(int(search.low), int(search.high), log=search.log)
    return FloatDistribution(search.low, search.high, log=search.log)
