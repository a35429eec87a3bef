"""What agents say that they do is the same however they are spread."""

from collections.abc import Sequence
from pathlib import Path

import pytest

from swarmwire.comms.interfaces import Observer
from swarmwire.comms.truth import Truth
from tests.support.deploy.runs import run_spread

PSO = Path(__file__).parents[3] / "scenarios" / "pso.toml"


class StatesSeen(Observer):
    """Observer that keeps the states of all ticks."""

    def __init__(self) -> None:
        self.ticks: list[list[str]] = []

    def see(self, truth: Truth) -> None:
        self.ticks.append([truth.states[code] for code in truth.state])


def states(runners: int | None, seeds: Sequence[int]) -> list[list[str]]:
    seen = StatesSeen()
    run_spread(PSO, runners, seeds=seeds, overrides=["duration_s=15"], observers=[seen])
    return seen.ticks


@pytest.fixture(scope="module")
def alone() -> list[list[str]]:
    return states(None, [2])


def test_states_are_the_same_however_the_agents_are_spread(alone: list[list[str]]) -> None:
    assert states(3, [2]) == alone
    assert {"to its own best", "to the neighbours' best"} <= set(alone[-1])


def test_states_of_an_arena_are_the_same_beside_others(alone: list[list[str]]) -> None:
    assert [tick[-10:] for tick in states(None, [5, 2])] == alone
