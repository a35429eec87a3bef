"""The checks for agents let honest ones pass and catch those that cheat."""

from pathlib import Path

import numpy as np
import pytest

from swarmwire.agent import Agent, Robot, VectorAgent
from swarmwire.agent.agent import load_agent
from swarmwire.agent.behaviours import Diffusion, Flocking, PsoSearch, PsoSearchPositioned
from swarmwire.agent.testing import Trial, assert_equivalent, assert_rows_independent
from swarmwire.comms.errors import AgentFailed
from tests.support.agent.players import (
    Ageing,
    Counter,
    Crowd,
    Means,
    Neighbour,
    Remembering,
    Reply,
    Steps,
    VectorCounter,
    Word,
)

EXAMPLE = Path(__file__).parents[3] / "examples" / "flocking_agent.py"
TRIALS = [Trial(), Trial(robots=1), Trial(robots=40, ticks=8, seed=7, body="footbot")]


@pytest.mark.parametrize("trial", TRIALS, ids=repr)
@pytest.mark.parametrize("kind", [Diffusion, Flocking, VectorCounter])
def test_honest_rows_are_independent(kind: type[VectorAgent], trial: Trial) -> None:
    assert_rows_independent(kind, trial)


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("kind", [PsoSearch, PsoSearchPositioned])
def test_particles_are_independent_but_for_what_they_hear(kind: type[VectorAgent], seed: int) -> None:
    often = {"update_every_ticks": 4, "tell_before_ticks": 1}
    assert_rows_independent(kind, Trial(ticks=20, seed=seed, body="epuck-gps", params=often))


@pytest.mark.parametrize("kind", [Means, Neighbour, Crowd, Remembering, Ageing, Reply])
def test_rows_that_peek_or_remember_on_their_own_are_caught(kind: type[VectorAgent]) -> None:
    with pytest.raises(AssertionError, match=f"rows of {kind.__name__} are not independent in tick"):
        assert_rows_independent(kind)


@pytest.mark.parametrize("trial", TRIALS, ids=repr)
def test_the_example_is_the_same_rule_as_the_behaviour(trial: Trial) -> None:
    assert_equivalent(load_agent(f"{EXAMPLE}:MyFlocking"), Flocking, trial)


def test_two_kinds_of_one_rule_with_memory_are_equivalent() -> None:
    assert_equivalent(Counter, VectorCounter)


@pytest.mark.parametrize("name", ["cohesion", "alignment", "avoidance", "forward", "speed_mps", "turn_gain_per_s"])
def test_a_weight_that_differs_is_caught(name: str) -> None:
    changed = type("Changed", (Flocking,), {name: getattr(Flocking, name) * (1.0 + 1e-12)})
    with pytest.raises(AssertionError, match="MyFlocking and Changed differ in tick"):
        assert_equivalent(load_agent(f"{EXAMPLE}:MyFlocking"), changed)


def test_packets_that_differ_are_caught() -> None:
    class Silent(Flocking):
        def step(self, robots, state) -> None:
            robots.radio.send = lambda *_, **__: None
            super().step(robots, state)

    with pytest.raises(AssertionError, match=r"packet 1: to: all \(MyFlocking\), nothing \(Silent\)"):
        assert_equivalent(load_agent(f"{EXAMPLE}:MyFlocking"), Silent)


def test_parameters_of_a_trial_reach_both_agents() -> None:
    params = {"separation_m": 0.9, "alignment": 0.0}
    assert_equivalent(load_agent(f"{EXAMPLE}:MyFlocking"), Flocking, Trial(params=params))


def test_an_agent_that_raises_is_named() -> None:
    class Raises(VectorAgent[Steps]):
        def step(self, robots, state) -> None:
            raise KeyError("nothing")

    with pytest.raises(AgentFailed, match="KeyError"):
        assert_rows_independent(Raises)


class Says(VectorAgent):
    def step(self, robots, state) -> None:
        robots.radio.send(Word, number=np.arange(robots.n, dtype=float))
        robots.drive(0.0, 0.0)
        robots.note("here")


class SaysOther(Agent):
    said = 0.0

    def step(self, robot: Robot) -> None:
        robot.radio.send(Word(number=self.said))
        robot.drive(0.0, -self.said)
        robot.note("here" if self.said else "there")


def test_a_difference_names_the_tick_the_robots_and_what_each_did() -> None:
    with pytest.raises(AssertionError) as caught:
        assert_equivalent(SaysOther, Says, Trial(robots=3, seed=2))
    assert str(caught.value).splitlines() == [
        "SaysOther and Says differ in tick 0, robot 0:",
        "  drive: angular_radps: -0.0 (SaysOther), 0.0 (Says)",
        "  note: 'there' (SaysOther), 'here' (Says)",
        "and so do robots 1, 2",
    ]


def test_a_difference_in_a_number_told_names_both() -> None:
    class Tells(VectorAgent):
        def step(self, robots, state) -> None:
            robots.note(value=np.full(robots.n, 0.5))

    class TellsOther(Agent):
        def step(self, robot: Robot) -> None:
            robot.note(value=0.25)

    with pytest.raises(AssertionError, match=r"note: value: 0.25 \(TellsOther\), 0.5 \(Tells\)"):
        assert_equivalent(TellsOther, Tells, Trial(robots=2))


def test_a_difference_in_a_message_names_its_field() -> None:
    different = type("Different", (SaysOther,), {"said": 0.25})
    with pytest.raises(AssertionError) as caught:
        assert_equivalent(different, Says, Trial(robots=1))
    assert "  packet 1: Word.number: 0.25 (Different), 0.0 (Says)" in str(caught.value).splitlines()
