"""Parameters with a value per robot reach the right rows, whoever acts and whichever process plays them."""

from typing import Any, ClassVar

import numpy as np
import pytest

from swarmwire.agent import Agent, PerRobot, Robot, Robots, State, VectorAgent, per_robot
from swarmwire.agent.declared import BadParameter, checked, parameters_of
from swarmwire.agent.host import hosted
from swarmwire.agent.testing import Trial, assert_rows_independent
from swarmwire.comms.errors import BadInput
from swarmwire.comms.packets import Heard
from swarmwire.deploy import run
from tests.support.agent.hosts import group, senses

LANES = """
from swarmwire.agent import PerRobot, Robots, State, VectorAgent, per_robot

class Lanes(VectorAgent):
    lane: PerRobot[int]
    speed_mps: PerRobot[float] = per_robot(0.02)

    def step(self, robots: Robots, state: State) -> None:
        robots.drive(self.speed_mps, 0.5 * self.lane)
"""
SCENARIO = """
format = 1
name = "lanes"
duration_s = 1.0
arena = { size_m = [4.0, 4.0] }

[robots.first]
body = "epuck"
count = 2
agent = "lanes.py:Lanes"
params = { lane = 1 }

[robots.lanes]
body = "epuck"
count = 4
agent = "lanes.py:Lanes"
act_every_ticks = 2
params = { lane = [0, 1, 2, 3] }
"""


class Lanes(VectorAgent):
    needs: ClassVar[tuple[str, ...]] = ()
    lane: PerRobot[int]
    speed_mps: PerRobot[float] = per_robot(0.02)
    gain: float = 2.0

    def step(self, robots: Robots, state: State) -> None:
        assert (self.lane.dtype, self.speed_mps.dtype) == (np.int64, np.float64)
        robots.drive(self.speed_mps, self.gain * self.lane)


def turns(rows: list[int], acting: list[int], **params: Any) -> list[float]:
    host = hosted(group("", rows, params=params), Lanes)
    actions = host.act((0, 0, 10**8), senses(0, acting), Heard.none(("range_m", "bearing_rad")))
    assert len(actions.linear_mps) == len(acting)
    return actions.angular_radps.tolist()


def test_a_list_has_a_value_for_each_row_and_shows_those_of_the_robots_that_act():
    assert turns([2, 5, 9], [2, 5, 9], lane=[1, 2, 3]) == [2.0, 4.0, 6.0]
    assert turns([2, 5, 9], [9], lane=[1, 2, 3]) == [6.0]
    assert turns([2, 5, 9], [2, 9], lane=4) == [8.0, 8.0]


def test_rows_are_independent():
    lanes = {"lane": list(range(7)), "speed_mps": 0.1}
    assert_rows_independent(Lanes, Trial(robots=7, params=lanes))


@pytest.mark.parametrize(
    ("params", "text"),
    [
        ({}, "is missing"),
        ({"lane": [1, 2]}, "a whole number, or a list with one for each of the 3 robots, got a list of 2"),
        ({"lane": [1, 2, 0.5]}, "got 0.5"),
        ({"lane": "1"}, "got '1'"),
        ({"lane": 1, "gain": [1.0, 1.0, 1.0]}, "expected a number, got"),
    ],
)
def test_what_does_not_fit_is_refused(params, text):
    with pytest.raises(BadParameter, match=text):
        checked(Lanes, params, 3)


def test_only_a_vector_agent_has_them():
    class Lone(Agent):
        lane: PerRobot[int]

        def step(self, robot: Robot) -> None: ...

    with pytest.raises(TypeError, match="only a VectorAgent"):
        parameters_of(Lone)


@pytest.fixture
def scenario(tmp_path):
    (tmp_path / "lanes.py").write_text(LANES)
    (tmp_path / "lanes.toml").write_text(SCENARIO)
    return tmp_path / "lanes.toml"


class Commands:
    """Observer that keeps the last commands."""

    def begin(self, static): ...

    def see(self, truth):
        self.last = truth.command.copy()

    def end(self, last):
        return {}


def test_every_robot_gets_its_own_in_every_layout(scenario):
    seen, expected = Commands(), [0.5, 0.5, 0.0, 0.5, 1.0, 1.5] * 2
    local = run(scenario, seeds=[1, 2], observers=[seen])
    assert seen.last[:, 1] == pytest.approx(expected)
    for runners in (3, "per-robot"):
        other = run(scenario, seeds=[1, 2], runners=runners, observers=[seen])
        assert other.trajectory_sha256 == local.trajectory_sha256


def test_a_list_of_the_wrong_length_is_refused_at_the_door(scenario):
    with pytest.raises(BadInput, match=r"robots.lanes.params.lane: expected .* 4 robots, got a list of 3"):
        run(scenario, overrides=["robots.lanes.params.lane=[1, 2, 3]"])
