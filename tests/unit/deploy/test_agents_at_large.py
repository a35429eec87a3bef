"""What an agent or an observer may do to a run, and what not; agents' frames are encoded, or not."""

import pytest

from swarmwire.comms.errors import AgentFailed
from swarmwire.comms.interfaces import Observer
from swarmwire.deploy import backends, run
from tests.support.deploy.runs import LOSSY
from tests.support.world.locksteps import EncodedBackend

AGENTS = """
import sys
import numpy as np
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
        robots.radio.received(Hello).received_at_ns[...] = 0
        robots.radio.send(Hello)

class Leaves(VectorAgent):
    def step(self, robots: Robots, state: State) -> None:
        sys.exit(0)

class Shouts(VectorAgent):
    def step(self, robots: Robots, state: State) -> None:
        robots.radio.send(Hello)

class Rambles(VectorAgent):
    def step(self, robots: Robots, state: State) -> None:
        robots.radio.send(Tale, number=1.0)

class Nan(VectorAgent):
    def step(self, robots: Robots, state: State) -> None:
        robots.drive(np.nan, np.inf)

class ToNobody(VectorAgent):
    def step(self, robots: Robots, state: State) -> None:
        robots.radio.send(Hello, to=77)
"""


@pytest.fixture
def agent(tmp_path):
    (tmp_path / "at_large.py").write_text(AGENTS)
    return lambda name: [
        f"robots.flock.agent={tmp_path / 'at_large.py'}:{name}",
        "robots.flock.params={}",
        "duration_s=0.5",
    ]


@pytest.fixture(params=[False, True], ids=["directly", "encoded"])
def _layout(request, monkeypatch):
    if request.param:
        monkeypatch.setattr(backends, "LocalBackend", EncodedBackend)


@pytest.mark.usefixtures("_layout")
@pytest.mark.parametrize(
    ("name", "why"), [("Writes", "read-only"), ("Rewrites", "read-only"), ("Leaves", "SystemExit")]
)
def test_an_agent_that_writes_to_what_it_reads_or_exits_has_failed(agent, name, why):
    with pytest.raises(AgentFailed, match=why):
        run(LOSSY, overrides=agent(name))


@pytest.mark.usefixtures("_layout")
@pytest.mark.parametrize(("name", "count"), [("Nan", "nan_commands"), ("ToNobody", "packets_to_nobody")])
def test_commands_that_are_no_numbers_and_packets_to_nobody_are_counted(agent, name, count):
    assert run(LOSSY, overrides=agent(name)).counts[count] == 20 * 5


def test_packets_without_a_radio_are_counted(agent, tmp_path):
    mute = tmp_path / "mute.toml"
    mute.write_text(LOSSY.read_text().partition("[radio]")[0])
    result = run(mute, overrides=agent("Shouts"))
    assert result.counts["packets_without_radio"] == 20 * 5


class Broken(Observer):
    """An observer with a fault."""

    def begin(self, static):
        self.ticks = []

    def see(self, truth):
        self.ticks.append(truth.tick)
        if truth.tick == 2:
            raise OSError("the disk is full")


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
    assert "10 bytes" in told[0]
    assert "radio.max_payload_bytes" in told[0]
