"""The agent host, and a process for each robot."""

import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import psutil
import pytest

from swarmwire.comms.errors import BadInput
from swarmwire.comms.interfaces import Observer
from swarmwire.comms.wire import frames
from swarmwire.comms.wire.sessions import PRIVATE
from swarmwire.deploy import run
from tests.support.agent.hosts import spec
from tests.support.agent.made_up_world import MadeUpWorld, made_up_world
from tests.support.clocks import until

END = frames.encode("end", -1, {})
TIMEOUT_S = 60.0
TWO_AT_ONCE = """
import sys
from swarmwire.agent import agent_host
agent_host.AT_ONCE = 2
sys.exit(agent_host.main(sys.argv[1:]))
"""
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


class AgentHost:
    """An agent host with a pipe to its life line and one from its reports; `program` starts it."""

    def __init__(
        self, endpoint: str, *names: str, program: Sequence[str] = ("-m", "swarmwire.agent.agent_host")
    ) -> None:
        command = [sys.executable, *program, endpoint, "run1", spec("Counter"), *names]
        self.process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )

    def ended(self) -> tuple[int, str, str]:
        """Its exit code, what it reported, and what people were told."""
        assert self.process.stdout
        assert self.process.stderr
        code = self.process.wait(TIMEOUT_S)
        return code, self.process.stdout.read(), self.process.stderr.read()


@pytest.fixture
def started() -> Iterator[list[AgentHost]]:
    agent_hosts: list[AgentHost] = []
    yield agent_hosts
    for agent_host in agent_hosts:
        with agent_host.process as process:  # its pipes are closed with it
            process.kill()


def ready(world: MadeUpWorld, runners: int) -> None:
    until(lambda: len([frame for frame in world.answers if frame.kind == "ready"]) == runners)


def test_runners_that_play_to_the_end_are_not_reported(started: list[AgentHost]) -> None:
    with made_up_world() as world:
        world.to_send = [END, END]
        started.append(agent_host := AgentHost(world.endpoint, "r1", "r2"))
        assert agent_host.ended() == (0, "", "")


def test_only_some_ask_for_robots_at_a_time_and_the_others_follow_as_these_have_theirs(
    started: list[AgentHost],
) -> None:
    names = [f"r{i}" for i in range(5)]
    with made_up_world() as world:
        world.holds = True
        started.append(agent_host := AgentHost(world.endpoint, *names, program=("-c", TWO_AT_ONCE)))
        until(lambda: len(world.asked) == 2)
        assert len(psutil.Process(agent_host.process.pid).children()) == 2  # the others were not even forked
        world.go_on()
        ready(world, len(names))
        assert len(world.asked) == len(names)


def test_who_cannot_join_makes_room_for_the_next(started: list[AgentHost]) -> None:
    with made_up_world(join=None) as world:
        started.append(agent_host := AgentHost(world.endpoint, "r1", "r2", "r3", program=("-c", TWO_AT_ONCE)))
        assert sorted(agent_host.ended()[1].splitlines()) == ["r1 1", "r2 1", "r3 1"]


def test_runners_that_end_badly_are_reported_by_name(started: list[AgentHost]) -> None:
    with made_up_world(join=None) as world:
        started.append(agent_host := AgentHost(world.endpoint, "r1", "r2"))
        code, reported, told = agent_host.ended()
        assert (code, sorted(reported.splitlines())) == (0, ["r1 1", "r2 1"])
        assert "refused by the test" in told


def test_no_runner_outlives_the_world(started: list[AgentHost]) -> None:
    with made_up_world() as world:
        started.append(agent_host := AgentHost(world.endpoint, "r1", "r2"))
        ready(world, 2)
        runners = psutil.Process(agent_host.process.pid).children()
        assert len(runners) == 2
        assert agent_host.process.stdin
        agent_host.process.stdin.close()
        assert agent_host.ended()[0] == 0
        until(lambda: not any(runner.is_running() for runner in runners))


def test_the_socket_of_a_world_that_is_gone_is_taken_away(started: list[AgentHost], tmp_path: Path) -> None:
    folder = tmp_path / f"{PRIVATE}x"
    folder.mkdir()
    started.append(agent_host := AgentHost(f"unixsock-stream/{folder}/socket", "r1"))
    assert agent_host.process.stdin
    agent_host.process.stdin.close()
    assert agent_host.ended()[0] == 0
    assert not folder.exists()


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
