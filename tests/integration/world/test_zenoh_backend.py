"""The backend of runners in a network."""

import itertools
import os
import queue
import socket
import subprocess
import sys
import tempfile
import threading
from collections.abc import Generator, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path

import psutil
import pytest

from swarmwire.agent import runner
from swarmwire.agent.local_backend import LocalBackend
from swarmwire.comms.base.clock import WallClock, to_ns
from swarmwire.comms.base.errors import AgentFailed, BadInput, Interrupted, RunnerLost
from swarmwire.comms.robot.packets import ReceivedPackets
from swarmwire.comms.robot.tick_io import Actions
from swarmwire.comms.wire import frames
from swarmwire.comms.wire.assignment import Assignment
from swarmwire.comms.wire.join import GroupInfo, JoinRequest, SessionInfo
from swarmwire.comms.wire.keys import Keys
from swarmwire.comms.wire.limits import JoinLimits
from swarmwire.comms.wire.sessions import closed_after, open_runner, unix_endpoint
from swarmwire.world.backends import zenoh_backend
from swarmwire.world.backends.join_policy import JoinPolicy
from swarmwire.world.backends.lockstep import Lockstep
from swarmwire.world.backends.registry import OnLoss
from swarmwire.world.backends.runner_reports import RunnerEvent, RunnerHealth
from swarmwire.world.backends.zenoh_backend import BackendHooks, LockstepBackend
from tests.support.agent.hosts import SILENCE, assignment, group, one_group, plain, received_from, spec
from tests.support.agent.processes import thread_server
from tests.support.clocks import TIMEOUT_S, until

RUN = "r1"
ROWS = [0, 1, 2, 3, 4]
OFFER = SessionInfo(RUN, "s", "", "1", 10, None, (GroupInfo("flock", "a:B", "f" * 64, 3, ()),))


@pytest.fixture
def endpoint() -> Iterator[str]:
    with tempfile.TemporaryDirectory(prefix="sw-", dir="/tmp") as directory:  # a socket's path must be short
        yield unix_endpoint(f"{directory}/world")


def parts(agent: str, *rows: list[int]) -> list[Assignment]:
    return [assignment(group(spec(agent), slot_rows)) for slot_rows in rows]


def backend_of(
    endpoint: str,
    slots: list[Assignment],
    on_loss: OnLoss = "stop",
    hooks: BackendHooks | None = None,
    clock: WallClock | None = None,
    timeout_s: float = TIMEOUT_S,
) -> LockstepBackend:
    lockstep = Lockstep(slots, on_loss)
    return LockstepBackend(
        endpoint, RUN, lockstep, timeout_s, clock or WallClock(), hooks or BackendHooks(), start_s=timeout_s
    )


@contextmanager
def opened(endpoint: str, slots: list[Assignment], timeout_s: float = TIMEOUT_S) -> Generator[LockstepBackend]:
    with closing(backend_of(endpoint, slots, timeout_s=timeout_s)) as backend:
        backend.open()
        yield backend


@contextmanager
def hosts(endpoint: str, names: list[str], agent: str = "Chatter") -> Generator[list["subprocess.Popen[bytes]"]]:
    """Agent hosts of one process each; all end with the context."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    with ExitStack() as ends:
        started: list[subprocess.Popen[bytes]] = []
        for name in names:
            command = [sys.executable, "-m", "swarmwire.agent.agent_host", endpoint, RUN, spec(agent), name, "1"]
            host = subprocess.Popen(command, stdin=subprocess.PIPE, start_new_session=True, env=environment)
            started.append(ends.enter_context(host))
            ends.callback(host.wait, 10.0)
            if host.stdin is not None:
                ends.callback(host.stdin.close)  # the life line, which ends the host and its process
        yield started


@contextmanager
def thread(endpoint: str, name: str) -> Generator["queue.SimpleQueue[BaseException | None]"]:
    """A runner in this process; its end is put into the queue."""
    ends: queue.SimpleQueue[BaseException | None] = queue.SimpleQueue()

    def play() -> None:
        try:
            runner.run(endpoint, RUN, name, runner.ProcessPool(thread_server(), 1))
        except BaseException as error:  # noqa: BLE001 - the test asks how it ended
            ends.put(error)
        else:
            ends.put(None)

    playing = threading.Thread(target=play)
    playing.start()
    try:
        yield ends
    finally:
        playing.join(20.0)
        assert not playing.is_alive()


def act(backend: LockstepBackend, tick: int, rows: list[int]) -> Actions:
    return backend.act(tick, one_group(tick, rows), SILENCE)


def three_ticks(backend: LockstepBackend, rows: list[int]) -> None:
    for tick in range(3):
        act(backend, tick, rows)


def on_receive(before: Actions | None) -> ReceivedPackets:
    return SILENCE if before is None else received_from(before.sent, ROWS)


@pytest.mark.parametrize("rows", [[ROWS], [[0, 2, 4], [1, 3]], [[row] for row in ROWS]], ids=["one", "two", "each"])
def test_runners_act_exactly_like_the_local_backend(endpoint: str, rows: list[list[int]]) -> None:
    local = LocalBackend(assignment(group(spec("Chatter"), ROWS)))
    local.start()
    before: Actions | None = None
    names = [f"r{i}" for i in range(len(rows))]
    with hosts(endpoint, names) as started:
        with opened(endpoint, parts("Chatter", *rows)) as backend:
            backend.start()
            for tick in range(6):
                acting = [row for row in ROWS if (row + tick) % 4]  # robots leave and return
                expected = local.act(tick, one_group(tick, acting), on_receive(before))
                got = backend.act(tick, one_group(tick, acting), on_receive(before))
                assert plain(got) == plain(expected)
                assert len(expected.sent) == 3 * len(acting)
                before = expected
            assert not backend.counts()
        assert [host.wait(10.0) for host in started] == [0] * len(rows)  # without a signal


def test_foreign_frames_are_counted_and_the_run_continues(endpoint: str) -> None:
    keys = Keys(RUN)
    with thread(endpoint, "r0"), opened(endpoint, parts("Counter", ROWS)) as backend:
        backend.start()
        with open_runner(endpoint) as foreign:
            for key in (keys.answer("r0"), keys.answer("stranger"), keys.alive("stranger")):
                foreign.put(key, b"\xc1 no frame")
            foreign.put(keys.answer("r0"), frames.encode("actions", 10**9, {}))
            foreign.put(keys.answer("r0"), frames.encode("ready", 0, {}))
            foreign.delete(keys.answer("r0"))
            queries = [
                foreign.get(key, payload=payload)
                for key, payload in (
                    (keys.join("x"), b"\xc1"),
                    (keys.any_join, JoinRequest().encode()),
                    (keys.join("x"), JoinRequest().encode()),
                )
            ]
            names = {"malformed_frames", "unknown_runner_frames", "wrong_tick_frames", "unexpected_kind_frames"}
            tick = 0
            while not names | {"bad_join", "refused_join"} <= set(backend.counts()) or backend.counts()["bad_join"] < 2:
                got = act(backend, tick, ROWS)
                tick += 1
                assert got.linear_mps.tolist() == [float(tick)] * len(ROWS)
            errors = [reply.err for replies in queries for reply in replies]
        texts = [error.payload.to_string() if error else "granted" for error in errors]
        assert [text.split()[0] for text in texts] == ["malformed:", "expected", "all"]
        got = act(backend, tick, ROWS)
        assert got.linear_mps.tolist() == [tick + 1.0] * len(ROWS)
        assert set(backend.counts()) == names | {"bad_join", "refused_join"}


def test_runner_that_vanishes_is_lost_with_its_robots(endpoint: str) -> None:
    slots = parts("Vanishing", [0, 3, 4], [1, 2])  # the compass of robots 0 and 4 is above 0 in tick 2
    with hosts(endpoint, ["a", "b"], "Vanishing"), opened(endpoint, slots) as backend:
        backend.start()
        with pytest.raises(RunnerLost) as caught:
            three_ticks(backend, ROWS)
        assert caught.value.robots == "flock-0, flock-3, flock-4"
        assert caught.value.runner in {"a", "b"}
        assert caught.value.reason == "its process ended with exit code 3"


def test_failing_agent_ends_the_run_with_its_traceback(endpoint: str) -> None:
    with hosts(endpoint, ["a", "b"], "Failing") as started:
        with opened(endpoint, parts("Failing", [0, 1], [2, 3])) as backend:
            backend.start()
            with pytest.raises(AgentFailed) as caught:
                three_ticks(backend, [0, 1, 2, 3])
        assert [host.wait(10.0) for host in started] == [0, 0]
    assert caught.value.robots == "flock-0"
    assert "NotDeclared" in caught.value.traceback
    assert "print(robot.proximity)" in caught.value.traceback


def test_agent_without_a_constructor_ends_the_run_at_its_start(endpoint: str) -> None:
    with thread(endpoint, "r0") as ends, opened(endpoint, parts("Unmade", [0, 1])) as backend:
        with pytest.raises(AgentFailed) as caught:
            backend.start()
        backend.close()
        assert ends.get(timeout=20.0) is None
    assert caught.value.robots == "flock-0, flock-1"
    assert "no memory left" in caught.value.traceback


def test_missing_agent_class_ends_the_run_with_the_reason(endpoint: str) -> None:
    fails = pytest.raises(AgentFailed, match="no such name: 'Nowhere'")
    with thread(endpoint, "r0"), opened(endpoint, parts("Nowhere", [0])) as backend, fails:
        backend.start()


def test_runner_beyond_the_robots_is_refused(endpoint: str) -> None:
    with thread(endpoint, "r0"), opened(endpoint, parts("Counter", ROWS)) as backend:
        backend.start()
        with thread(endpoint, "r1") as ends:
            tick = 0
            while "refused_join" not in backend.counts():
                act(backend, tick, ROWS)
                tick += 1
            end = ends.get(timeout=20.0)
        act(backend, tick, ROWS)
        backend.close()
    assert isinstance(end, RunnerLost)
    assert end.reason == "all robots are taken"


def test_runner_may_start_before_its_world(endpoint: str) -> None:
    for _ in range(8):  # a world that listens but cannot answer yet is rare
        with thread(endpoint, "r0") as ends:
            with opened(endpoint, parts("Counter", [0])) as backend:
                backend.start()
            assert ends.get(timeout=20.0) is None


def test_runner_without_a_world_is_lost_after_the_join_timeout(endpoint: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(runner, "JOIN_TIMEOUT_S", 0.1)
    with pytest.raises(RunnerLost, match="r0 got no robots: no connection to its world within 0.1 s"):
        runner.run(endpoint, RUN, "r0", runner.ProcessPool(thread_server()))


def test_join_is_answered_at_once_while_the_world_waits_for_others(
    endpoint: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(zenoh_backend, "POLL_S", TIMEOUT_S)  # longer than the test
    keys, slots = Keys(RUN), parts("Counter", *([row] for row in ROWS))
    with opened(endpoint, slots) as backend, ThreadPoolExecutor() as others, open_runner(endpoint) as asking:
        started = others.submit(backend.start)
        for row in ROWS:
            (reply,) = asking.get(keys.join(f"r{row}"), payload=JoinRequest().encode(), timeout=TIMEOUT_S)
            assert reply.ok is not None
            asking.put(keys.answer(f"r{row}"), frames.encode("ready", -1, {}))
        started.result(TIMEOUT_S)


def test_wait_for_runners_ends_at_the_timeout(endpoint: str) -> None:
    with opened(endpoint, parts("Counter", [0, 1]), timeout_s=0.05) as backend, pytest.raises(RunnerLost) as caught:
        backend.start()
    assert caught.value.robots == "flock-0, flock-1"
    assert caught.value.reason == "no answer for 0.05 s"


def test_wait_for_runners_ends_at_once_when_a_process_ended(endpoint: str) -> None:
    hooks = BackendHooks(lambda: "its process ended")
    with (
        closing(backend_of(endpoint, parts("Counter", [0]), hooks=hooks, timeout_s=600.0)) as backend,
        pytest.raises(RunnerLost, match="its process ended"),
    ):
        backend.start()


def test_socket_in_use_is_refused_and_its_run_continues(endpoint: str) -> None:
    with thread(endpoint, "r0"), opened(endpoint, parts("Counter", [0])) as backend:
        backend.start()
        second = LockstepBackend(endpoint, "other", Lockstep(parts("Counter", [0])), TIMEOUT_S, WallClock())
        with pytest.raises(BadInput, match="expected an endpoint that is free"):
            second.open()
        second.close()
        got = act(backend, 0, [0])
        assert got.linear_mps.tolist() == [1.0]


def test_socket_in_a_missing_directory_is_refused(endpoint: str) -> None:
    with pytest.raises(BadInput), opened(endpoint.replace("world", "nowhere/world"), parts("Counter", [0])):
        pass


def test_socket_of_a_dead_world_is_reused(endpoint: str) -> None:
    path = endpoint.split("/", 1)[1]
    with socket.socket(socket.AF_UNIX) as dead:
        dead.bind(path)
    assert Path(path).is_socket()
    with thread(endpoint, "r0"), opened(endpoint, parts("Counter", [0])) as backend:
        backend.start()
        assert act(backend, 0, [0]).linear_mps.tolist() == [1.0]


def test_backend_may_be_closed_twice_and_before_it_is_opened(endpoint: str) -> None:
    backend = backend_of(endpoint, parts("Counter", [0]))
    backend.close()
    backend.open()
    backend.close()
    backend.close()


def test_runners_leave_when_the_world_is_killed(endpoint: str) -> None:
    """A world in another process, killed by a signal."""
    program = f"""
from swarmwire.comms.base.clock import WallClock, to_ns
from swarmwire.world.backends.lockstep import Lockstep
from swarmwire.world.backends.zenoh_backend import LockstepBackend
from tests.integration.world.test_zenoh_backend import RUN, parts

backend = LockstepBackend({endpoint!r}, RUN, Lockstep(parts("Counter", [0])), 60.0, WallClock())
backend.start()
print("started", flush=True)
input()
"""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    with subprocess.Popen(
        [sys.executable, "-c", program], stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=environment
    ) as world:
        try:
            with thread(endpoint, "r0") as ends:
                assert world.stdout is not None
                assert world.stdout.readline() == b"started\n"
                world.kill()
                assert ends.get(timeout=20.0) is None
        finally:
            world.kill()


def process_of(host: "subprocess.Popen[bytes]") -> psutil.Process:
    """The agent process of a host: its fork server's child."""
    (server,) = psutil.Process(host.pid).children()
    return server.children()[0]


def kill_one(host: "subprocess.Popen[bytes]") -> None:
    process = process_of(host)
    process.kill()
    process.wait(20.0)


def test_successor_of_a_lost_runner_has_fresh_agents(endpoint: str) -> None:
    with ExitStack() as later, hosts(endpoint, ["a", "b"]) as started:
        hooks = BackendHooks(lost=lambda _: (later.enter_context(thread(endpoint, "c")), None)[1])
        backend = backend_of(endpoint, parts("Counter", [0, 1], [2]), "wait", hooks)
        later.callback(backend.close)
        backend.start()
        for tick in range(2):
            act(backend, tick, [0, 1, 2])
        kill_one(started[0])
        got = act(backend, 2, [0, 1, 2])
        steps = dict(zip(got.rows.tolist(), got.linear_mps.tolist(), strict=True))
        assert steps in ({0: 1.0, 1: 1.0, 2: 3.0}, {0: 3.0, 1: 3.0, 2: 1.0})
        assert backend.counts() == {"runners_lost": 1, "runners_joined_late": 1}
        backend.close()


def test_wait_for_robots_without_a_runner_is_announced_once(endpoint: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(zenoh_backend, "ANNOUNCE_S", 0.0)
    with hosts(endpoint, ["a", "b"]) as started:
        announced: list[tuple[str, ...]] = []
        checks = itertools.count()
        hooks = BackendHooks(stopped=lambda: bool(announced) and next(checks) > 3, waiting=announced.append)
        with closing(backend_of(endpoint, parts("Counter", [0], [1]), "wait", hooks)) as backend:
            backend.start()
            kill_one(started[0])
            with pytest.raises(Interrupted):
                act(backend, 0, [0, 1])
    assert announced in ([("flock-0",)], [("flock-1",)])


class LeapingClock(WallClock):
    """The wall clock, which a test may set forward."""

    def __init__(self) -> None:
        self.ahead_ns = 0

    def now_ns(self) -> int:
        return super().now_ns() + self.ahead_ns


def test_pause_beyond_the_timeout_loses_no_runner(endpoint: str) -> None:
    clock = LeapingClock()
    with thread(endpoint, "r0") as ends:
        with closing(backend_of(endpoint, parts("Counter", ROWS), clock=clock)) as backend:
            backend.start()
            for tick in range(3):
                actions = act(backend, tick, ROWS)
                assert actions.linear_mps.tolist() == [tick + 1.0] * len(ROWS)
                clock.ahead_ns += to_ns(10 * TIMEOUT_S)
            assert not backend.counts()
            assert backend.health() == RunnerHealth(ready=1, lost=0)
        assert ends.get(timeout=20.0) is None


def test_freeze_of_the_world_does_not_count_for_the_timeout(endpoint: str) -> None:
    """A runner is slow while the world is frozen beyond its timeout; then both continue."""
    clock, waits = LeapingClock(), list[RunnerHealth]()
    with hosts(endpoint, ["a"]) as started:

        def frozen() -> bool:
            if backend.health().ready and not waits:
                waits.append(backend.health())
                clock.ahead_ns += to_ns(10 * TIMEOUT_S)
                child.resume()
            return False

        hooks = BackendHooks(stopped=frozen)
        with closing(backend_of(endpoint, parts("Counter", [0]), hooks=hooks, clock=clock)) as backend:
            backend.start()
            child = process_of(started[0])
            waits.clear()
            child.suspend()
            actions = act(backend, 0, [0])
            assert actions.linear_mps.tolist() == [1.0]
            assert waits[0].waits_s > 0
            assert waits[0].waits_for == "a, which plays flock-0"
            assert backend.health() == RunnerHealth(ready=1, lost=0)
            backend.close()


class Events:
    """Events and endpoints that a backend reported."""

    def __init__(self) -> None:
        self.changes: list[RunnerEvent] = []
        self.free: list[tuple[str, ...]] = []
        self.endpoints: tuple[str, ...] = ()

    def changed(self, change: RunnerEvent, free: tuple[str, ...]) -> None:
        self.changes.append(change)
        self.free.append(free)

    def opened(self, endpoints: tuple[str, ...]) -> None:
        self.endpoints = endpoints


def backend_at(endpoint: str, events: Events, limits: JoinLimits) -> LockstepBackend:
    slots = [assignment(group(spec("Counter"), [0, 1, 2]))]
    hooks = BackendHooks(changed=events.changed, opened=events.opened)
    return LockstepBackend(
        endpoint, RUN, Lockstep(slots, "stand", JoinPolicy(OFFER, True, limits=limits)), 20.0, WallClock(), hooks
    )


def test_runner_that_is_not_ready_in_time_loses_its_robots(endpoint: str) -> None:
    events, keys = Events(), Keys(RUN)
    with closing(backend_at(endpoint, events, JoinLimits(join_s=0.2))) as backend:
        backend.open()
        assert events.endpoints == (endpoint,)
        with closed_after(open_runner(endpoint)) as idler:
            queries = [
                idler.get(keys.session_info("idler")),
                idler.get(keys.join("idler"), payload=JoinRequest(names=("flock-1",)).encode()),
            ]
            until(lambda: (backend._handle_arrived(), events.changes)[1])
            replies = [next(iter(replies)) for replies in queries]
    assert all(reply.ok is not None for reply in replies)
    session_info = SessionInfo.decode(replies[0].ok.payload.to_bytes()) if replies[0].ok else None
    assert session_info is not None
    assert session_info.groups[0].robots == 3
    reason = "its agents were not ready within 0.2 s"
    assert events.changes == [RunnerEvent("lost", "idler", ("flock-1",), -1, reason)]
    assert [sorted(free) for free in events.free] == [["flock-0", "flock-1", "flock-2"]]
