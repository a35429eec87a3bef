"""Joining a run by hand: what is asked for, what is refused on either side, and how the play ends."""

import hashlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zenoh

from swarmwire.agent import joining as joining_module
from swarmwire.agent.joining import JoinSettings, join
from swarmwire.agent.runner import Arrivals, ProcessPool
from swarmwire.comms.base.errors import BadInput, RunnerLost
from swarmwire.comms.robot.packets import NO_TX_STATUSES, ReceivedPackets
from swarmwire.comms.wire import frames
from swarmwire.comms.wire.join import JoinRequest
from swarmwire.comms.wire.keys import Keys
from swarmwire.comms.wire.network import Network
from swarmwire.comms.wire.sessions import closed_after, listens_at, open_world
from swarmwire.comms.wire.tick_frames import encode_tick
from tests.support.agent.hosts import MEASURES, readings, spec
from tests.support.agent.made_up_world import NOTHING, OFFER, OFFERED, REFUSED, MadeUpWorld, given, made_up_world
from tests.support.agent.processes import thread_server

END = frames.encode("end", -1, {})
SHORT_S = 0.3
SERVER = thread_server()


def ticks_of(*numbers: int) -> list[bytes]:
    return [
        encode_tick(tick, {"flock": readings(tick, [0, 1])}, ReceivedPackets.none(MEASURES), NO_TX_STATUSES)
        for tick in numbers
    ]


def played(world: MadeUpWorld, **keys: Any) -> tuple[str, str, list[str]]:
    """How a runner's play ended and why, and what people were told."""
    said: list[str] = []
    ended = join(JoinSettings(world.endpoint, name="r", **keys), Arrivals(), ProcessPool(SERVER, 1, said.append))
    return ended.outcome, ended.reason, said


def refusal(world: MadeUpWorld, **keys: Any) -> str:
    with pytest.raises(RunnerLost) as refused:
        played(world, **keys)
    return str(refused.value)


def test_a_runner_asks_is_given_robots_answers_every_tick_and_ends_with_the_run() -> None:
    with made_up_world() as world:
        world.to_send = [*ticks_of(0, 1), END]
        how, why, said = played(world, robots=2)
        assert (how, why) == ("over", "")
        assert said == ["r: joined run run1 with flock-0, flock-1"]
        assert [(frame.kind, frame.tick) for frame in world.answers] == [("ready", -1), ("actions", 0), ("actions", 1)]
        asked = JoinRequest.decode(world.asked[0])
        assert (asked.robots, asked.names, asked.agents) == (2, None, {"flock": OFFERED.agent_sha256})


def test_a_runner_that_is_removed_is_told_why() -> None:
    with made_up_world() as world:
        world.to_send = [frames.encode("end", -1, {}, {"why": "it was silent"})]
        assert played(world)[:2] == ("removed", "it was silent")


def test_an_agent_that_fails_is_told_to_the_world_before_the_runner_ends() -> None:
    session_info = OFFER.replace(b"players.py:Counter", b"players.py:Failing")
    robots = given().replace(b"players.py:Counter", b"players.py:Failing")
    with made_up_world(session_info, robots) as world:
        world.to_send = [*ticks_of(0, 1, 2, 3), END]
        played(world)
        (failed,) = (frame for frame in world.answers if frame.kind == "lost")
        assert "Traceback" in str(failed.values["traceback"])


def test_only_the_scenario_and_the_robots_that_were_named_are_asked_for(tmp_path: Path) -> None:
    scenario = tmp_path / "s.toml"
    scenario.write_text("name = 's'")
    with made_up_world() as world:
        world.to_send = [END]
        played(world, names=("flock-1",), scenario=scenario, agents=(f"flock={spec('Counter')}",))
        asked = JoinRequest.decode(world.asked[0])
        assert asked.names == ("flock-1",)
        assert asked.scenario_sha256 == hashlib.sha256(scenario.read_bytes()).hexdigest()


def test_an_agent_that_is_not_here_is_told_of_and_left_out() -> None:
    with made_up_world() as world:
        world.to_send = [END]
        said = played(world, agents=("nowhere.py:Mine",), names=("flock-0",))[2]
        assert said[0].startswith("no agent for flock: ")
        assert said[0].endswith("--agent names another")
        assert JoinRequest.decode(world.asked[0]).agents == {}


def test_no_agent_is_asked_after_for_robots_of_other_groups() -> None:
    with made_up_world() as world:
        world.to_send = [END]
        played(world, names=("wolf-0",))
        assert JoinRequest.decode(world.asked[0]).agents == {}


@pytest.mark.parametrize(
    ("session_info", "robots", "expected"),
    [
        (None, given(), REFUSED),
        (b"\xc1", given(), "another version of swarmwire"),
        (OFFER.replace(b"\xa1v", b"\xa1w"), given(), "another version of swarmwire"),
        (NOTHING, given(), "the world sent no session information: its access rules may exclude r"),
        (OFFER, None, REFUSED),
        (OFFER, NOTHING, "the world did not answer to join"),
        (OFFER, b"\xc1", "the world's answer to join is malformed"),
        (OFFER, given(groups=[{}]), "the world's answer to join is malformed"),
        (OFFER, given(memory=b"\xc1"), "the world's answer to join is malformed"),
    ],
)
def test_who_is_not_let_in_is_told_why(session_info: bytes | None, robots: bytes | None, expected: str) -> None:
    with made_up_world(session_info, robots) as world:
        assert expected in refusal(world)


def test_memory_of_other_agents_than_the_worlds_loses_the_process_with_the_cause() -> None:
    arrays = {"memory/flock/rows": np.arange(2), "memory/flock/speed": np.zeros(2)}
    reply = given(memory=frames.encode("memory", -1, arrays), memory_columns={"flock": {"speed": ["<f8", []]}})
    with made_up_world(join=reply) as world:
        world.to_send = [*ticks_of(0), END]
        assert played(world)[0] == "over"
        lost = world.answers[-1]
        assert lost.kind == "lost"
        assert "memory/flock" in str(lost.values)


def test_a_group_that_the_run_does_not_have_has_no_agent() -> None:
    with made_up_world() as world, pytest.raises(BadInput, match="expected a group of the run: flock"):
        played(world, agents=("wolves=mine.py:Mine",))


def test_of_several_runs_one_must_be_named(monkeypatch: pytest.MonkeyPatch) -> None:
    with made_up_world() as world:
        token = world._session.liveliness().declare_token(Keys("run2").world)
        with pytest.raises(BadInput, match=r"--run: expected one of the runs at tcp/127.0.0.1:\d+: run1, run2"):
            played(world)
        world.to_send = [END]
        assert played(world, run="run1")[0] == "over"
        token.undeclare()


def test_where_no_run_is_or_nobody_answers_it_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(joining_module, "POLL_S", SHORT_S)
    with closed_after(open_world("tcp/127.0.0.1:0", 10.0)) as session:
        endpoint = listens_at(session)[0]
        with pytest.raises(RunnerLost, match="there is no run at"):
            join(JoinSettings(endpoint, name="r"), Arrivals(), ProcessPool(SERVER))
    with pytest.raises(RunnerLost, match=f"no world answers at {endpoint}") as lost:
        join(JoinSettings(endpoint, name="r", connect_s=SHORT_S), Arrivals(), ProcessPool(SERVER))
    assert isinstance(lost.value.__cause__, zenoh.ZError)


@pytest.mark.parametrize(
    ("keys", "expected"),
    [
        ({"robots": 1, "names": ("a",)}, "expected only one of --robots and --names"),
        ({"robots": 0}, "expected at least 1, got 0"),
        ({"name": "a/b"}, "--name"),
        ({"scenario": Path("nowhere.toml")}, "expected a file"),
        ({"endpoint": "tcp/192.0.2.1:1"}, "ENDPOINT"),
    ],
)
def test_what_cannot_be_asked_for_is_refused_before_anybody_is_called(keys: dict[str, Any], expected: str) -> None:
    with pytest.raises(BadInput, match=expected):
        join(JoinSettings(**{"endpoint": "tcp/127.0.0.1:1", **keys}), Arrivals(), ProcessPool(SERVER))


@pytest.mark.parametrize("processes", [0, -1])
def test_a_number_of_processes_is_at_least_1(processes: int) -> None:
    with pytest.raises(BadInput, match=f"--processes: expected at least 1, got {processes}"):
        join(JoinSettings("tcp/127.0.0.1:1"), Arrivals(), ProcessPool(SERVER, processes))


def test_a_runner_has_the_name_of_its_certificate_or_one_of_its_own() -> None:
    certified = Network(ca=Path("ca.pem"), certificate=Path("lab/alice.pem"), key=Path("lab/alice.key"))
    assert JoinSettings("tcp/127.0.0.1:1", network=certified).runner == "alice"
    made_up = {JoinSettings("tcp/127.0.0.1:1").runner for _ in range(2)}
    assert len(made_up) == 2
