"""`swarmwire.agent.testing`, and agents that misuse the API."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from swarmwire.agent import Agent, Memory, Robot, Robots, VectorAgent
from swarmwire.agent.agent import AgentClass, load_agent
from swarmwire.agent.agent_group import agent_group
from swarmwire.agent.behaviours import Flocking
from swarmwire.agent.testing import Trial, assert_equivalent, assert_rows_independent
from swarmwire.comms.base.errors import AgentFailed
from swarmwire.comms.robot.packets import ReceivedPackets, SentPackets
from tests.support.agent.hosts import group, readings, received_from
from tests.support.agent.one_step import agent_doing, vector_agent_doing
from tests.support.agent.players import Ageing, Crowd, Means, Neighbour, Remembering, Reply, VectorCounter, Word

EXAMPLE = Path(__file__).parents[3] / "examples" / "flocking_agent.py"
TRIALS = [Trial(), Trial(robots=1), Trial(robots=40, ticks=8, seed=7, body="footbot")]
TIME = (3, 300_000_000, 100_000_000)
NOTHING: ReceivedPackets = received_from(SentPackets.none(), [])


@pytest.mark.parametrize("trial", TRIALS, ids=repr)
@pytest.mark.parametrize("kind", [Flocking, VectorCounter])
def test_honest_rows_are_independent(kind: type[VectorAgent], trial: Trial) -> None:
    assert_rows_independent(kind, trial)


@pytest.mark.parametrize("kind", [Means, Neighbour, Crowd, Remembering, Ageing, Reply])
def test_rows_that_depend_on_others_are_caught(kind: type[VectorAgent]) -> None:
    with pytest.raises(AssertionError, match=f"rows of {kind.__name__} are not independent in tick"):
        assert_rows_independent(kind)


@pytest.mark.parametrize("trial", [*TRIALS, Trial(params={"separation_m": 0.9, "alignment": 0.0})], ids=repr)
def test_example_is_the_same_rule_as_the_behaviour(trial: Trial) -> None:
    assert_equivalent(load_agent(f"{EXAMPLE}:MyFlocking"), Flocking, trial)


@pytest.mark.parametrize("name", ["cohesion", "alignment", "avoidance", "forward", "speed_mps", "turn_gain_per_s"])
def test_different_weight_is_caught(name: str) -> None:
    changed = type("Changed", (Flocking,), {name: getattr(Flocking, name) * (1.0 + 1e-12)})
    with pytest.raises(AssertionError, match="MyFlocking and Changed differ in tick"):
        assert_equivalent(load_agent(f"{EXAMPLE}:MyFlocking"), changed)


def test_different_packets_are_caught() -> None:
    class Silent(Flocking):
        def step(self, robots, memory) -> None:
            robots.radio.send = lambda *_, **__: None
            super().step(robots, memory)

    with pytest.raises(AssertionError, match=r"packet 1: to: all \(MyFlocking\), nothing \(Silent\)"):
        assert_equivalent(load_agent(f"{EXAMPLE}:MyFlocking"), Silent)


class Reports(VectorAgent):
    def step(self, robots, memory) -> None:
        robots.radio.send(Word, number=np.arange(robots.n, dtype=float))
        robots.drive(0.0, 0.0)
        robots.note("here")


class ReportsOther(Agent):
    number = 0.0

    def step(self, robot: Robot) -> None:
        robot.radio.send(Word(number=self.number))
        robot.drive(0.0, -self.number)
        robot.note("here" if self.number else "there")


def test_difference_names_tick_robots_and_their_actions() -> None:
    with pytest.raises(AssertionError) as caught:
        assert_equivalent(ReportsOther, Reports, Trial(robots=3, seed=2))
    assert str(caught.value).splitlines() == [
        "ReportsOther and Reports differ in tick 0, robot 0:",
        "  drive: angular_radps: -0.0 (ReportsOther), 0.0 (Reports)",
        "  note: 'there' (ReportsOther), 'here' (Reports)",
        "and so do robots 1, 2",
    ]


def test_difference_in_a_noted_number_names_both() -> None:
    notes = vector_agent_doing(lambda robots: robots.note(value=np.full(robots.n, 0.5)))
    other = agent_doing(lambda robot: robot.note(value=0.25))
    with pytest.raises(AssertionError, match=r"note: value: 0.25 \(Doing\), 0.5 \(Doing\)"):
        assert_equivalent(other, notes, Trial(robots=2))


def test_difference_in_a_message_names_its_field() -> None:
    different = type("Different", (ReportsOther,), {"number": 0.25})
    with pytest.raises(AssertionError, match=r"\n  packet 1: Word.number: 0.25 \(Different\), 0.0 \(Reports\)(\n|$)"):
        assert_equivalent(different, Reports, Trial(robots=1))


def failure(kind: AgentClass, steps: int = 1) -> str:
    agents = agent_group(group("", [0, 1, 2]), kind)
    for _ in range(steps - 1):
        agents.act(TIME, readings(3, [0, 1, 2]), NOTHING)
    with pytest.raises(AgentFailed) as caught:
        agents.act(TIME, readings(3, [0, 1, 2]), NOTHING)
    return str(caught.value)


def test_failure_has_its_tick_and_the_traceback_from_the_agents_code() -> None:
    class Bright(Agent):
        def step(self, robot: Robot) -> None:
            robot.led(2.0, 0.0, 0.0)

    lines = failure(Bright).splitlines()
    assert lines[:2] == ["the agent of flock-0 failed:", "Traceback (most recent call last):"]
    assert f'File "{__file__}"' in lines[2]
    assert lines[2].endswith("in step")
    assert lines[-1] == "in tick 3, at 0.3 s"


@pytest.mark.parametrize(
    ("deed", "message"),
    [
        (lambda robot: robot.radio.send("hello"), "expected a message or a dict, got 'hello'"),
        (lambda robot: robot.radio.send(Word), "expected a message or a dict, got <class"),
        (lambda robot: robot.radio.send(Word(number=1.0), to=1.5), "expected the index of a robot in the arena"),
        (lambda robot: robot.radio.send({"x": 1}, to=-2), "expected the index of a robot in the arena"),
        (lambda robot: robot.radio.received("Word"), "expected a class of messages, got 'Word'"),
        (lambda robot: robot.radio.received(Word(number=1.0)), "expected a class of messages, got Word(number=1.0)"),
        (lambda robot: robot.note(), "expected a state, a value, or both"),
        (lambda robot: robot.note(value=float("nan")), "note(value=…): expected finite numbers, got nan"),
        (lambda robot: robot.note(value="up"), "could not convert string to float: 'up'"),
        (lambda robot: setattr(robot, "linear_mps", 0.1), "no attribute 'linear_mps'"),
    ],
)
def test_misuse_of_a_robot_is_refused(deed: Callable[[Any], object], message: str) -> None:
    assert message in failure(agent_doing(deed))


@pytest.mark.parametrize(
    ("deed", "message"),
    [
        (lambda robots: robots.radio.send(Word(number=1.0)), "expected a class of messages, got Word(number=1.0)"),
        (lambda robots: robots.radio.send({"a": 1}), "expected a class of messages, got {'a': 1}"),
        (lambda robots: robots.radio.received(dict), "expected a class of messages, got <class 'dict'>"),
        (lambda robots: robots.drive(0.1, 0.0, rows=np.array([0, 1])), "mask, bool (3,), got int64 (2,)"),
        (lambda robots: robots.note("up", rows=np.array([0, 1])), "rows: expected a mask"),
        (lambda robots: robots.note(value=1.0, rows=np.array([0, 1])), "rows: expected a mask"),
        (lambda robots: robots.note(rows=np.ones(3, bool)), "expected a state, a value, or both"),
        (lambda robots: robots.note(value=np.zeros(2)), "expected one number or 3, got the shape (2,)"),
        (lambda robots: robots.note(value=np.array([0, np.inf, 0])), "expected finite numbers"),
        (lambda robots: robots.led(0.1, 0.0, 0.0, rows=np.ones(2, bool)), "rows: expected a mask"),
        (lambda robots: robots.radio.send(Word, np.array([1]), number=1.0), "rows: expected a mask"),
        (lambda robots: robots.radio.send(Word, number=np.zeros(7)), "one number or an array (3,)"),
        (lambda robots: robots.radio.send(Word, np.array([True, False, True]), number=np.zeros(2)), "got (2,)"),
        (lambda robots: robots.radio.received(Word).message.numbers, "no field 'numbers'; it has number"),
        (lambda robots: robots.radio.send(Word, number=1.0, to=-2), "expected the index of a robot in the arena"),
        (lambda robots: setattr(robots, "linear_mps", 0.1), "no attribute 'linear_mps'"),
    ],
)
def test_misuse_of_robots_is_refused(deed: Callable[[Any], object], message: str) -> None:
    assert message in failure(vector_agent_doing(deed))


@pytest.mark.parametrize("part", ["robot", "radio"])
def test_robot_of_an_earlier_step_is_refused(part: str) -> None:
    class Keeps(Agent):
        _previous: Any = None

        def step(self, robot: Robot) -> None:
            if self._previous is not None:
                self._previous.send(Word(number=1.0)) if part == "radio" else self._previous.drive(0.1, 0.0)
            self._previous = robot if part == "robot" else robot.radio

    assert "robot and radio are valid for one step" in failure(Keeps, steps=2)


def test_vector_agent_attributes_cannot_be_set() -> None:
    class Keeps(VectorAgent):
        def __init__(self) -> None:
            self.table = np.arange(3)

        def step(self, robots: Robots, memory: Memory) -> None:
            self.table = self.table + 1

    assert "Keeps.table: one instance serves many robots; memory goes into a Memory" in failure(Keeps)
