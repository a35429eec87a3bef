"""What a user gets wrong is refused where it is done: the traceback begins in the agent, and says what was expected."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from swarmwire.agent import Agent, Robot, Robots, State, VectorAgent
from swarmwire.agent.agent import AgentClass
from swarmwire.agent.host import agent_group
from swarmwire.comms.errors import AgentFailed
from swarmwire.comms.packets import ReceivedPackets, SentPackets
from tests.support.agent.hosts import group, readings, received_from
from tests.support.agent.players import Word

TIME = (3, 300_000_000, 100_000_000)
NOTHING: ReceivedPackets = received_from(SentPackets.none(), [])


def failure(kind: AgentClass, steps: int = 1) -> str:
    host = agent_group(group("", [0, 1, 2]), kind)
    for _ in range(steps - 1):
        host.act(TIME, readings(3, [0, 1, 2]), NOTHING)
    with pytest.raises(AgentFailed) as caught:
        host.act(TIME, readings(3, [0, 1, 2]), NOTHING)
    return str(caught.value)


def of_one(deed: Callable[[Any], object]) -> AgentClass:
    class Mine(Agent):
        def step(self, robot: Robot) -> None:
            deed(robot)

    return Mine


def of_many(deed: Callable[[Any], object]) -> AgentClass:
    class Mine(VectorAgent):
        def step(self, robots: Robots, state: State) -> None:
            deed(robots)

    return Mine


def test_a_failure_is_told_from_the_agents_first_line_on_and_when_it_was() -> None:
    lines = failure(of_one(lambda robot: robot.led(2.0, 0.0, 0.0))).splitlines()
    assert lines[:2] == ["the agent of flock-0 failed:", "Traceback (most recent call last):"]
    assert f'File "{__file__}"' in lines[2]
    assert lines[2].endswith("in step")
    assert lines[-1] == "in tick 3, at 0.3 s"


@pytest.mark.parametrize(
    ("deed", "told"),
    [
        (lambda robot: robot.radio.send("hello"), "expected a message or a dict, got 'hello'"),
        (lambda robot: robot.radio.send(Word), "expected a message or a dict, got <class"),
        (lambda robot: robot.radio.send(Word(number=1.0), to=1.5), "expected the index of a robot in the arena"),
        (lambda robot: robot.radio.received("Word"), "expected a class of messages, got 'Word'"),
        (lambda robot: robot.radio.received(Word(number=1.0)), "expected a class of messages, got Word(number=1.0)"),
        (lambda robot: robot.note(), "expected a state, a value, or both"),
        (lambda robot: robot.note(value=float("nan")), "note(value=…): expected finite numbers, got nan"),
        (lambda robot: robot.note(value="up"), "could not convert string to float: 'up'"),
        (lambda robot: setattr(robot, "linear_mps", 0.1), "no attribute 'linear_mps'"),
    ],
)
def test_misuse_of_a_robot_is_refused(deed: Callable[[Any], object], told: str) -> None:
    assert told in failure(of_one(deed))


@pytest.mark.parametrize(
    ("deed", "told"),
    [
        (lambda robots: robots.radio.send(Word(number=1.0)), "expected a class of messages, got Word(number=1.0)"),
        (lambda robots: robots.radio.send({"a": 1}), "expected a class of messages, got {'a': 1}"),
        (lambda robots: robots.radio.received(dict), "expected a class of messages, got <class 'dict'>"),
        (
            lambda robots: robots.drive(0.1, 0.0, rows=np.array([0, 1])),
            "rows: expected a mask, bool (3,), got int64 (2,)",
        ),
        (lambda robots: robots.note("up", rows=np.array([0, 1])), "rows: expected a mask"),
        (lambda robots: robots.note(value=1.0, rows=np.array([0, 1])), "rows: expected a mask"),
        (lambda robots: robots.note(rows=np.ones(3, bool)), "expected a state, a value, or both"),
        (lambda robots: robots.note(value=np.zeros(2)), "expected one number or 3, got the shape (2,)"),
        (lambda robots: robots.note(value=np.array([0, np.inf, 0])), "expected finite numbers"),
        (lambda robots: robots.led(0.1, 0.0, 0.0, rows=np.ones(2, bool)), "rows: expected a mask"),
        (lambda robots: robots.radio.send(Word, np.array([1]), number=1.0), "rows: expected a mask"),
        (
            lambda robots: robots.radio.send(Word, number=np.zeros(7)),
            "Word.number: expected one number or an array (3,)",
        ),
        (
            lambda robots: robots.radio.send(Word, np.array([True, False, True]), number=np.zeros(2)),
            "expected one number or an array (3,), also with rows=, got (2,)",
        ),
        (
            lambda robots: robots.radio.received(Word).message.numbers,
            "the message has no field 'numbers'; it has number",
        ),
        (lambda robots: robots.radio.send(Word, number=1.0, to=-2), "expected the index of a robot in the arena"),
        (lambda robots: setattr(robots, "linear_mps", 0.1), "no attribute 'linear_mps'"),
    ],
)
def test_misuse_of_robots_is_refused(deed: Callable[[Any], object], told: str) -> None:
    assert told in failure(of_many(deed))


@pytest.mark.parametrize("part", ["robot", "radio"])
def test_a_robot_that_was_kept_from_an_earlier_step_is_refused(part: str) -> None:
    class Keeps(Agent):
        _kept: Any = None

        def step(self, robot: Robot) -> None:
            if self._kept is not None:
                self._kept.send(Word(number=1.0)) if part == "radio" else self._kept.drive(0.1, 0.0)
            self._kept = robot if part == "robot" else robot.radio

    assert "robot and radio hold for one step" in failure(Keeps, steps=2)


def test_a_vector_agent_keeps_nothing_on_itself() -> None:
    class Keeps(VectorAgent):
        def __init__(self) -> None:
            self.table = np.arange(3)

        def step(self, robots: Robots, state: State) -> None:
            self.table = self.table + 1

    assert "Keeps.table: one instance serves many robots; memory goes into a State" in failure(Keeps)
