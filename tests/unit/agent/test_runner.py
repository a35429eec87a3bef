import argparse
import os
import signal
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple, cast

import msgpack
import pytest
import zenoh

from swarmwire.agent import fork_server, host_loop, isolation, join_command, runner
from swarmwire.agent.joining import JoinSettings
from swarmwire.agent.on_robot.settings import INTERRUPTED
from swarmwire.agent.runner import NEXT_FREE, Arrivals, ProcessPool, run_in_session
from swarmwire.agent.runner_protocol import Ended, RunnerProtocol
from swarmwire.comms.base.errors import RunnerLost
from swarmwire.comms.robot.packets import NO_TX_STATUSES
from swarmwire.comms.wire import frames
from swarmwire.comms.wire.keys import Keys
from swarmwire.comms.wire.tick_frames import encode_tick
from tests.support.agent.hosts import SILENCE, TIMES, assignment, group, readings, spec
from tests.support.agent.processes import thread_server
from tests.support.refusals import refused_input

KEYS = Keys("run1")
END = frames.encode("end", -1, {})
ASSIGNED = assignment(group(spec("Counter"), [0]))
REPLY = msgpack.packb({**ASSIGNED.as_mapping(), "v": frames.VERSION, "memory": None, **TIMES})


def tick(number: int) -> bytes:
    return encode_tick(number, {"flock": readings(number, [0])}, SILENCE, NO_TX_STATUSES)


class Payload(NamedTuple):
    data: bytes

    def to_bytes(self) -> bytes:
        return self.data

    def to_string(self) -> str:
        return self.data.decode()


class Sample(NamedTuple):
    payload: Payload
    kind: zenoh.SampleKind = zenoh.SampleKind.PUT


class Reply(NamedTuple):
    ok: Sample | None
    err: Sample | None = None


class FakeSession:
    """A session, its liveliness and its publisher in one; the world is a list of what it sends after each frame.

    The world's token appears with the `found`-th subscription to it.
    """

    def __init__(self, *then: bytes) -> None:
        self.found_at, self.declared, self.undeclared = 1, 0, 0
        self.put_to_world: list[frames.Frame] = []
        self.before_reply: tuple[bytes, ...] = ()
        self.on_put: Callable[[frames.Frame], object] = lambda _: None
        self.then = list(then)
        self._frame: Any = None

    def liveliness(self) -> "FakeSession":
        return self

    def declare_token(self, _key: str) -> None:
        """Nobody looks."""

    def declare_subscriber(self, key: str, callback: Any, *, history: bool = False) -> "FakeSession":
        if key == KEYS.world:
            assert history
            self.declared += 1
            if self.declared == self.found_at:
                callback(Sample(Payload(b"")))
        else:
            self._frame = callback
        return self

    def undeclare(self) -> None:
        self.undeclared += 1

    def get(self, key: str, *, payload: bytes, timeout: float) -> Sequence[Reply]:
        assert (key, bool(payload), timeout > 0.0) == (KEYS.join("r7"), True, True)
        for data in self.before_reply:
            self._frame(Sample(Payload(data)))
        return (Reply(Sample(Payload(REPLY))),)

    def declare_publisher(self, key: str, **_qos: Any) -> "FakeSession":
        assert key == KEYS.answer("r7")
        return self

    def put(self, data: bytes) -> None:
        self.put_to_world.append(frames.decode(data))
        self.on_put(self.put_to_world[-1])
        if self.then:
            self._frame(Sample(Payload(self.then.pop(0))))


def played(session: Any, arrivals: Arrivals | None = None, report: Callable[[str], None] = lambda _: None) -> Ended:
    server = thread_server()
    ended = run_in_session(
        session, KEYS, "r7", arrivals or Arrivals(), lambda: NEXT_FREE, ProcessPool(server, 1, report)
    )
    server.close()
    return ended


def kinds(session: FakeSession) -> list[tuple[str, int]]:
    return [(frame.kind, frame.tick) for frame in session.put_to_world]


def test_runner_answers_each_tick_until_the_run_ends() -> None:
    session = FakeSession(tick(0), tick(1), END)
    session.before_reply = (tick(5), END)  # for a lost runner of the same name
    assert played(session) == Ended("over")
    assert kinds(session) == [("ready", -1), ("actions", 0), ("actions", 1)]
    assert session.put_to_world[1].values["dropped"] == 2


def test_runner_that_leaves_waits_for_the_confirmation() -> None:
    session, arrivals = FakeSession(tick(0)), Arrivals()
    session.on_put = lambda frame: arrivals.leave() if frame.kind == "actions" else None
    session.then.extend((tick(1), END))  # the tick is under way, and no longer answered
    assert played(session, arrivals) == Ended("left")
    assert kinds(session) == [("ready", -1), ("actions", 0), ("leave", -1)]


def test_runner_leaves_at_once_if_requested_while_joining(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(host_loop, "FAREWELL_TIMEOUT_S", 0.01)  # and nobody confirms
    session, arrivals = FakeSession(), Arrivals()
    played(session, arrivals, lambda _: arrivals.leave())
    assert kinds(session) == [("leave", -1)]


def test_runner_leave_before_its_world_is_found_interrupts() -> None:
    session, arrivals = FakeSession(), Arrivals()
    arrivals.leave()
    with pytest.raises(KeyboardInterrupt):
        played(session, arrivals)
    assert session.put_to_world == []


@pytest.mark.parametrize(("found_at", "declared", "undeclared"), [(1, 1, 0), (3, 3, 2), (9, 4, 4)])
def test_runner_without_a_report_of_its_world_queries_again(
    found_at: int, declared: int, undeclared: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(runner, "JOIN_TIMEOUT_S", 0.04)
    monkeypatch.setattr(runner, "POLL_S", 0.01)
    session = FakeSession(END)
    session.found_at = found_at
    if found_at > 4:
        with pytest.raises(RunnerLost, match="there is no run run1, or it does not let r7 in"):
            played(session)
    else:
        assert played(session) == Ended("over")
    assert (session.declared, session.undeclared) == (declared, undeclared)


@pytest.mark.parametrize(
    ("arguments", "option"),
    [
        *(("tls/10.0.0.5:7447", "ENDPOINT"), ("tcp/10.0.0.5:7447", "ENDPOINT")),
        *((f"tls/10.0.0.5:7447 {files}", "--ca") for files in ("--key r.key", "--ca a --certificate b --key c")),
    ],
)
def test_runner_without_its_certificates_is_refused_before_connecting(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], arguments: str, option: str
) -> None:
    monkeypatch.chdir(tmp_path)
    parser = argparse.ArgumentParser()
    join_command.add_join(parser)
    with refused_input(match=f"^{option}: "):
        join_command.join_parsed(parser.parse_args(arguments.split()))
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize("interrupt", [signal.SIG_IGN, signal.default_int_handler], ids=["in background", "in front"])
def test_signal_leaves_the_run_and_its_handler_is_restored(monkeypatch, capsys, interrupt: Any) -> None:
    def killed(_settings: JoinSettings, arrivals: Arrivals, *_: Any) -> Ended:
        os.kill(os.getpid(), signal.SIGTERM)
        protocol = RunnerProtocol()
        arrivals.pass_on(protocol, timeout_s=10.0)
        return cast("Ended", protocol.next_event())

    monkeypatch.setattr("swarmwire.agent.joining.join", killed)
    monkeypatch.setattr(fork_server, "ForkServer", lambda _: thread_server())
    monkeypatch.setattr(isolation, "keep_from_others", lambda: None)
    before, ended_by = signal.signal(signal.SIGINT, interrupt), signal.getsignal(signal.SIGTERM)
    try:
        assert join_command.join_and_report(JoinSettings("tcp/127.0.0.1:1")) == INTERRUPTED
        assert signal.getsignal(signal.SIGINT) is interrupt
        assert signal.getsignal(signal.SIGTERM) is ended_by
    finally:
        signal.signal(signal.SIGINT, before)
    assert "left the run" in capsys.readouterr().err
