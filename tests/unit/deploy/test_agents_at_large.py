"""Agents and observers in a run: what they may do to it, and agents that join, leave and are lost, in lockstep."""

import shutil

import pytest

from swarmwire.comms.base.errors import AgentFailed, BadInput
from swarmwire.comms.observe.interfaces import Observer
from swarmwire.deploy import Result, run
from swarmwire.deploy.runs import backends
from swarmwire.deploy.runs.config import Listening
from swarmwire.deploy.runs.simulation import Simulation
from tests.support.deploy.joiners import LOCALHOST, WANDERER, EncodedJoiners, Watcher, moves
from tests.support.deploy.runs import LOSSY
from tests.support.world.locksteps import EncodedBackend

AGENTS = """
import sys
import numpy as np
from swarmwire.agent import Message, Robots, Memory, VectorAgent, f8

class Hello(Message):
    pass

class Tale(Message):
    number: f8

class Writes(VectorAgent):
    needs = ("proximity",)
    def step(self, robots: Robots, memory: Memory) -> None:
        value = robots.proximity.value
        value *= 0.5

class Rewrites(VectorAgent):
    def step(self, robots: Robots, memory: Memory) -> None:
        robots.radio.received(Hello).received_at_ns[...] = 0
        robots.radio.send(Hello)

class Leaves(VectorAgent):
    def step(self, robots: Robots, memory: Memory) -> None:
        sys.exit(0)

class Shouts(VectorAgent):
    def step(self, robots: Robots, memory: Memory) -> None:
        robots.radio.send(Hello)

class Rambles(VectorAgent):
    def step(self, robots: Robots, memory: Memory) -> None:
        robots.radio.send(Tale, number=1.0)

class Nan(VectorAgent):
    def step(self, robots: Robots, memory: Memory) -> None:
        robots.drive(np.nan, np.inf)

class ToNobody(VectorAgent):
    def step(self, robots: Robots, memory: Memory) -> None:
        robots.radio.send(Hello, to=77)
"""


@pytest.fixture
def agent(tmp_path):
    (tmp_path / "at_large.py").write_text(AGENTS)
    changes = "robots.flock.params={}", "duration_s=0.5"
    return lambda name: [f"robots.flock.agent={tmp_path / 'at_large.py'}:{name}", *changes]


@pytest.fixture(params=[False, True], ids=["directly", "encoded"])
def _layout(request, monkeypatch):
    if request.param:
        monkeypatch.setattr(backends, "LocalBackend", EncodedBackend)


@pytest.mark.usefixtures("_layout")
@pytest.mark.parametrize(
    ("name", "why"), [("Writes", "read-only"), ("Rewrites", "read-only"), ("Leaves", "SystemExit")]
)
def test_agent_that_writes_to_its_readings_or_exits_has_failed(agent, name, why):
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


def test_observer_that_fails_is_left_out_and_counted(capfd):
    broken = Broken()
    result = run(LOSSY, overrides=["duration_s=0.5"], observers=[broken])
    assert broken.ticks == [0, 1, 2]
    assert (result.ticks, result.counts["observer_failed_Broken"]) == (5, 1)
    assert "the disk is full" in capfd.readouterr().err


def test_people_are_told_once_of_a_packet_that_is_too_large(agent, capfd):
    result = run(LOSSY, overrides=[*agent("Rambles"), "radio.max_payload_bytes=9"])
    assert result.radio.fates["too_large"] > 19
    (line,) = [line for line in capfd.readouterr().err.splitlines() if "too_large" in line]
    assert "10 bytes" in line
    assert "radio.max_payload_bytes" in line


def test_battery_that_ends_is_reported_with_robots_and_time(capfd):
    battery = "{ battery = { capacity_wh = 1.0, idle_w = 3600.0, start = 0.5 } }"  # half a second
    one = ["robots.flock.count=2", f"robots.flock.body_overrides.sensors={battery}"]
    result = run(LOSSY, overrides=["duration_s=1.0", *one])
    (line,) = [line for line in capfd.readouterr().err.splitlines() if "battery" in line]
    assert all(word in line for word in ("flock-0", "flock-1", "0.5 s"))
    assert [(event["do"], event["at_s"]) for event in result.summary()["events"]] == [("run_down", 0.5)]


@pytest.fixture
def played(monkeypatch, tmp_path):
    """A short run of wanderers as a script says, and what was told; without one, with all agents in one host."""
    agent = shutil.copy(WANDERER, tmp_path)
    backend: list[EncodedJoiners] = []

    def play(on_loss: str = "stop", script: dict[int, list[str]] | None = None) -> tuple[Result, Watcher, list[str]]:
        watcher = Watcher()
        overrides = [f"robots.flock.agent={agent}:Wanderer", "robots.flock.params={}", "duration_s=1.5"]
        with monkeypatch.context() as patched:
            if script is not None:

                def made(assignment):
                    backend.append(EncodedJoiners(assignment, on_loss, script))
                    return backend[-1]

                patched.setattr(backends, "LocalBackend", made)
            result = run(LOSSY, overrides=overrides, observers=[watcher])
        events = [change for joiners in backend for change in joiners.roster.events]
        return result, watcher, [f"{change.what} {change.runner} {change.tick}" for change in events]

    return play


ALL = list(range(20))
BOTH = ["join a 8", "join b 12"]
SAME = {
    "they take all": ({-1: ["join a flock-3,flock-17", "join b 6", "join c"]}, "joined a -1, joined b -1, joined c -1"),
    "lost after it answered, and back": ({-1: BOTH, 7: ["lose a", "join a"]}, "lost a 7, returned a 7"),
    "lost before it answered, and back": ({-1: BOTH, 7: ["mute a", "lose a", "join a"]}, "lost a 7, returned a 7"),
    "lost, and others come": (
        {-1: BOTH, 7: ["mute b", "lose b", "join c flock-9", "join d"]},
        "lost b 7, joined c 7, joined d 7",
    ),
    "left, and another comes": ({-1: BOTH, 7: ["leave b", "join c"]}, "left b 7, joined c 7"),
    "lost twice": (
        {-1: BOTH, 3: ["lose a", "join a"], 9: ["lose a", "join a"]},
        "returned a 3, lost a 9, returned a 9",
    ),
}


@pytest.mark.parametrize(("script", "last_changes"), SAME.values(), ids=SAME)
def test_run_that_waits_for_its_runners_is_the_same_bit_for_bit(played, script, last_changes):
    """Agents' memory comes back with their robots."""
    result, _, changes = played("wait", script)
    assert ", ".join(changes).endswith(last_changes)
    assert result.trajectory_sha256 == played()[0].trajectory_sha256
    assert not any(name.endswith("_frames") for name in result.counts)


LATE = {-1: ["join a 5"], 4: ["join b 4"], 9: ["leave b"]}
LOST = {-1: ["join a 5", "join b"], 6: ["mute a", "lose a"], 11: ["join a"]}
WITHOUT = {
    "a late joiner, which leaves": (
        LATE,
        {"stand": {0: ALL[:5], 5: ALL[:9], 9: ALL[:5]}, "coast": {0: ALL[:5], 5: ALL[:9]}},
        {"runners_joined_late": 1, "runners_left": 1},
    ),
    "one that is lost, and back": (
        LOST,
        {"stand": {0: ALL, 6: ALL[5:], 12: ALL}, "coast": {0: ALL}},
        {"runners_lost": 1, "runners_returned": 1},
    ),
    "nobody": ({-1: []}, {"stand": {0: []}, "coast": {0: []}}, {}),
}


@pytest.mark.parametrize("on_loss", ["stand", "coast"])
@pytest.mark.parametrize(("script", "expected", "counts"), WITHOUT.values(), ids=WITHOUT)
def test_robots_without_an_agent_stand_or_coast_as_the_run_goes_on(played, on_loss, script, expected, counts):
    result, watcher, _ = played(on_loss, script)
    assert result.ticks == 15
    assert moves(watcher.truths) == expected[on_loss]
    runner_counts = {name: count for name, count in result.counts.items() if name.startswith("runners_")}
    assert runner_counts == counts
    assert ("packets_without_agent" in result.counts) == bool(counts)


def test_robots_that_coast_do_what_they_did_last_to_the_last_digit(played):
    _, watcher, _ = played("coast", LOST)
    commands = [truth.command[:5].tolist() for truth in watcher.truths]
    assert all(command == commands[5] for command in commands[5:12])
    assert len({str(command) for command in commands[:6] + commands[12:]}) == 9


def test_robots_of_a_runner_that_is_dead_stand_to_the_end(played):
    result, watcher, _ = played("dead", {-1: BOTH, 6: ["lose a"]})
    assert moves(watcher.truths) == {0: ALL, 6: ALL[8:]}
    assert result.counts["runners_lost"] == 1


def test_runner_that_leaves_a_run_set_to_stop_ends_it(played):
    result, *_ = played("stop", {-1: BOTH, 6: ["leave a"]})
    assert (result.ended, result.ticks) == ("left", 6)


@pytest.mark.parametrize(
    ("listening", "overrides", "key"),
    [
        (Listening(("tcp/0.0.0.0:0",)), [], "endpoints"),
        (Listening(("nonsense",)), [], "endpoints"),
        (Listening(LOCALHOST, observed=("tcp/10.0.0.5:1",)), [], "observed"),
        (Listening(LOCALHOST, observed=LOCALHOST), [], "observed"),
        (Listening(LOCALHOST, start_with=21), [], "start_with"),
        (Listening(LOCALHOST, start_with=5), [], "run.on_runner_loss"),
        (Listening(LOCALHOST, start_with=5), ["run.on_runner_loss=wait"], "run.on_runner_loss"),
    ],
)
def test_listening_that_cannot_be_is_refused(listening, overrides, key):
    with pytest.raises(BadInput) as refused:
        Simulation(LOSSY, overrides=overrides, listening=listening)
    assert key in (refused.value.where, refused.value.key)
