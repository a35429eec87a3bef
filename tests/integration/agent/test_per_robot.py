"""Parameters with a value per robot reach the right rows, whichever process plays them."""

import pytest

from swarmwire.comms.errors import BadInput
from swarmwire.comms.interfaces import Observer
from swarmwire.deploy import run

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


@pytest.fixture
def scenario(tmp_path):
    (tmp_path / "lanes.py").write_text(LANES)
    (tmp_path / "lanes.toml").write_text(SCENARIO)
    return tmp_path / "lanes.toml"


class Commands(Observer):
    """Observer that keeps the last commands."""

    def see(self, truth):
        self.last = truth.command.copy()


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
