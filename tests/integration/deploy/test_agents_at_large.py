"""What an agent may do to a run, and what not: the same in the world's process and in a runner."""

import pytest

from swarmwire.comms.errors import AgentFailed
from swarmwire.deploy import run
from tests.support.deploy.commands import LOSSY

AGENTS = """
import sys
from swarmwire.agent import Message, Robots, State, VectorAgent, f8

class Hello(Message):
    pass

class Tale(Message):
    number: f8

class Writes(VectorAgent):
    needs = ("proximity",)
    def step(self, robots: Robots, state: State) -> None:
        value = robots.proximity.value
        value *= 0.5

class Rewrites(VectorAgent):
    def step(self, robots: Robots, state: State) -> None:
        robots.radio.heard(Hello).heard_at_ns[...] = 0
        robots.radio.send(Hello)

class Leaves(VectorAgent):
    def step(self, robots: Robots, state: State) -> None:
        sys.exit(0)

class Prints(VectorAgent):
    def step(self, robots: Robots, state: State) -> None:
        print("hello from an agent", flush=True)

class Shouts(VectorAgent):
    def step(self, robots: Robots, state: State) -> None:
        robots.radio.send(Hello)

class Rambles(VectorAgent):
    def step(self, robots: Robots, state: State) -> None:
        robots.radio.send(Tale, number=1.0)
"""


@pytest.fixture
def agent(tmp_path):
    (tmp_path / "at_large.py").write_text(AGENTS)
    return lambda name: [
        f"robots.flock.agent={tmp_path / 'at_large.py'}:{name}",
        "robots.flock.params={}",
        "duration_s=0.5",
    ]


@pytest.mark.parametrize("runners", [None, 1])
@pytest.mark.parametrize("name", ["Writes", "Rewrites"])
def test_what_a_robot_reads_cannot_be_written_to(agent, name, runners):
    with pytest.raises(AgentFailed, match="read-only"):
        run(LOSSY, overrides=agent(name), runners=runners)


@pytest.mark.parametrize("runners", [None, 1])
def test_an_agent_that_exits_has_failed(agent, runners):
    with pytest.raises(AgentFailed, match="SystemExit"):
        run(LOSSY, overrides=agent("Leaves"), runners=runners)


@pytest.mark.parametrize("runners", [None, 2])
def test_an_agent_may_print(agent, runners, capfd):
    assert run(LOSSY, overrides=agent("Prints"), runners=runners).ticks == 5
    captured = capfd.readouterr()
    assert "hello from an agent" in captured.out + captured.err


def test_packets_without_a_radio_are_counted(agent, tmp_path):
    mute = tmp_path / "mute.toml"
    mute.write_text(LOSSY.read_text().partition("[radio]")[0])
    result = run(mute, overrides=agent("Shouts"))
    assert result.counts["packets_without_radio"] == 20 * 5


class Broken:
    """An observer with a fault."""

    def begin(self, static):
        self.ticks = []

    def see(self, truth):
        self.ticks.append(truth.tick)
        if truth.tick == 2:
            raise OSError("the disk is full")

    def end(self, last):
        return {}


def test_an_observer_that_fails_is_left_out_and_counted(capfd):
    broken = Broken()
    result = run(LOSSY, overrides=["duration_s=0.5"], observers=[broken])
    assert broken.ticks == [0, 1, 2]
    assert (result.ticks, result.counts["observer_failed_Broken"]) == (5, 1)
    assert "the disk is full" in capfd.readouterr().err


def test_people_are_told_once_of_a_packet_that_is_too_large(agent, capfd):
    result = run(LOSSY, overrides=[*agent("Rambles"), "radio.max_payload_bytes=9"])
    assert result.radio is not None
    assert result.radio.fates["too_large"] > 19
    told = [line for line in capfd.readouterr().err.splitlines() if "too_large" in line]
    assert len(told) == 1
    assert "sent 10 bytes, more than radio.max_payload_bytes" in told[0]
