"""Joining a run from the runner's side: requests, refusals and ends."""

import hashlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zenoh

from swarmwire.agent import joining as joining_module
from swarmwire.agent.joining import JoinSettings, join
from swarmwire.agent.runner import Arrivals, ProcessPool
from swarmwire.comms.base.errors import RunnerLost
from swarmwire.comms.robot.packets import NO_TX_STATUSES, ReceivedPackets
from swarmwire.comms.wire import frames
from swarmwire.comms.wire.join import JoinRequest
from swarmwire.comms.wire.keys import Keys
from swarmwire.comms.wire.network import Network
from swarmwire.comms.wire.sessions import closed_after, listens_at, open_world
from swarmwire.comms.wire.tick_frames import encode_tick
from tests.support.agent.hosts import MEASURES, readings, spec
from tests.support.agent.made_up_world import (
    NOTHING,
    OFFER,
    OFFERED,
    REFUSAL,
    MadeUpWorld,
    assignment_reply,
    made_up_world,
)
from tests.support.agent.processes import thread_server
from tests.support.refusals import refused_input

END = frames.encode("end", -1, {})
SHORT_S = 0.3
SERVER = thread_server()


def ticks_of(*numbers: int) -> list[bytes]:
    return [
        encode_tick(tick, {"flock": readings(tick, [0, 1])}, ReceivedPackets.none(MEASURES), NO_TX_STATUSES)
        for tick in numbers
    ]


def join_result(world: MadeUpWorld, **keys: Any) -> tuple[str, str, list[str]]:
    """Outcome and reason of a runner, and its reports."""
    reports: list[str] = []
    ended = join(JoinSettings(world.endpoint, name="r", **keys), Arrivals(), ProcessPool(SERVER, 1, reports.append))
    return ended.outcome, ended.reason, reports


def refusal(world: MadeUpWorld, **keys: Any) -> str:
    with pytest.raises(RunnerLost) as caught:
        join_result(world, **keys)
    return str(caught.value)


def test_runner_joins_answers_every_tick_and_ends_with_the_run() -> None:
    with made_up_world() as world:
        world.to_send = [*ticks_of(0, 1), END]
        how, why, reports = join_result(world, robots=2)
        assert (how, why) == ("over", "")
        assert reports == ["r: joined run run1 with flock-0, flock-1"]
        assert [(frame.kind, frame.tick) for frame in world.answers] == [("ready", -1), ("actions", 0), ("actions", 1)]
        request = JoinRequest.decode(world.join_requests[0])
        assert (request.robots, request.names, request.agents) == (2, None, {"flock": OFFERED.agent_sha256})


def test_removed_runner_gets_the_reason() -> None:
    with made_up_world() as world:
        world.to_send = [frames.encode("end", -1, {}, {"why": "it was silent"})]
        assert join_result(world)[:2] == ("removed", "it was silent")


def test_failed_agent_is_reported_before_the_runner_ends() -> None:
    session_info = OFFER.replace(b"players.py:Counter", b"players.py:Failing")
    robots = assignment_reply().replace(b"players.py:Counter", b"players.py:Failing")
    with made_up_world(session_info, robots) as world:
        world.to_send = [*ticks_of(0, 1, 2, 3), END]
        join_result(world)
        (failed,) = (frame for frame in world.answers if frame.kind == "lost")
        assert "Traceback" in str(failed.values["traceback"])


def test_join_request_has_the_named_robots_and_scenario(tmp_path: Path) -> None:
    scenario = tmp_path / "s.toml"
    scenario.write_text("name = 's'")
    with made_up_world() as world:
        world.to_send = [END]
        join_result(world, names=("flock-1",), scenario=scenario, agents=(f"flock={spec('Counter')}",))
        request = JoinRequest.decode(world.join_requests[0])
        assert request.names == ("flock-1",)
        assert request.scenario_sha256 == hashlib.sha256(scenario.read_bytes()).hexdigest()


def test_missing_agent_is_reported_and_left_out() -> None:
    with made_up_world() as world:
        world.to_send = [END]
        reports = join_result(world, agents=("nowhere.py:Mine",), names=("flock-0",))[2]
        assert reports[0].startswith("no agent for flock: ")
        assert JoinRequest.decode(world.join_requests[0]).agents == {}
        world.to_send = [END]
        join_result(world, names=("wolf-0",))  # of another group, whose agent it does not need
        assert JoinRequest.decode(world.join_requests[1]).agents == {}


@pytest.mark.parametrize(
    ("session_info", "robots", "expected"),
    [
        (None, assignment_reply(), REFUSAL),
        (b"\xc1", assignment_reply(), "another version of swarmwire"),
        (OFFER.replace(b"\xa1v", b"\xa1w"), assignment_reply(), "another version of swarmwire"),
        (NOTHING, assignment_reply(), "the world sent no session information: its access rules may exclude r"),
        (OFFER, None, REFUSAL),
        (OFFER, NOTHING, "the world did not answer to join"),
        (OFFER, b"\xc1", "the world's answer to join is malformed"),
        (OFFER, assignment_reply(groups=[{}]), "the world's answer to join is malformed"),
        (OFFER, assignment_reply(memory=b"\xc1"), "the world's answer to join is malformed"),
    ],
)
def test_refused_or_malformed_join_names_the_reason(
    session_info: bytes | None, robots: bytes | None, expected: str
) -> None:
    with made_up_world(session_info, robots) as world:
        assert expected in refusal(world)


def test_memory_of_another_agent_loses_the_process() -> None:
    arrays = {"memory/flock/rows": np.arange(2), "memory/flock/speed": np.zeros(2)}
    reply = assignment_reply(
        memory=frames.encode("memory", -1, arrays), memory_columns={"flock": {"speed": ["<f8", []]}}
    )
    with made_up_world(join=reply) as world:
        world.to_send = [*ticks_of(0), END]
        assert join_result(world)[0] == "over"
        lost = world.answers[-1]
        assert lost.kind == "lost"
        assert "memory/flock" in str(lost.values)


def test_agent_for_an_unknown_group_is_refused() -> None:
    with made_up_world() as world, refused_input(match="flock"):
        join_result(world, agents=("wolves=mine.py:Mine",))


def test_join_among_several_runs_needs_the_run(monkeypatch: pytest.MonkeyPatch) -> None:
    with made_up_world() as world:
        token = world._session.liveliness().declare_token(Keys("run2").world)
        with refused_input("--run", match="run1, run2"):
            join_result(world)
        world.to_send = [END]
        assert join_result(world, run="run1")[0] == "over"
        token.undeclare()


def test_join_without_a_run_or_a_world_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(joining_module, "POLL_S", SHORT_S)
    with closed_after(open_world("tcp/127.0.0.1:0", 10.0)) as session:
        endpoint = listens_at(session)[0]
        with pytest.raises(RunnerLost, match="there is no run at"):
            join(JoinSettings(endpoint, name="r"), Arrivals(), ProcessPool(SERVER))
    with pytest.raises(RunnerLost, match=f"no world answers at {endpoint}") as lost:
        join(JoinSettings(endpoint, name="r", connect_s=SHORT_S), Arrivals(), ProcessPool(SERVER))
    assert isinstance(lost.value.__cause__, zenoh.ZError)


@pytest.mark.parametrize(
    ("keys", "option"),
    [
        ({"robots": 1, "names": ("a",)}, "--robots and --names"),
        ({"robots": 0}, "--robots"),
        ({"name": "a/b"}, "--name"),
        ({"scenario": Path("nowhere.toml")}, "nowhere.toml"),
        ({"endpoint": "tcp/192.0.2.1:1"}, "ENDPOINT"),
    ],
)
def test_impossible_join_settings_are_refused_before_a_connection(keys: dict[str, Any], option: str) -> None:
    with refused_input(match=option):
        join(JoinSettings(**{"endpoint": "tcp/127.0.0.1:1", **keys}), Arrivals(), ProcessPool(SERVER))


def test_number_of_processes_below_1_is_refused() -> None:
    with refused_input("--processes"):
        join(JoinSettings("tcp/127.0.0.1:1"), Arrivals(), ProcessPool(SERVER, 0))


def test_runner_name_is_that_of_the_certificate_or_made_up() -> None:
    certified = Network(ca=Path("ca.pem"), certificate=Path("lab/alice.pem"), key=Path("lab/alice.key"))
    assert JoinSettings("tcp/127.0.0.1:1", network=certified).runner == "alice"
    made_up = {JoinSettings("tcp/127.0.0.1:1").runner for _ in range(2)}
    assert len(made_up) == 2
