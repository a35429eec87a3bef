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
from swarmwire.comms.base.clock import WallClock, to_ns
from swarmwire.comms.base.errors import AgentFailed, BadInput, Interrupted, RunnerLost
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
from tests.support.agent.hosts import SILENCE, assignment, group, one_group, spec
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


@pytest.mark.parametrize(("agent", "reason"), [("Unmade", "no memory left"), ("Nowhere", "no such name: 'Nowhere'")])
def test_agent_that_cannot_be_made_ends_the_run_at_its_start(endpoint: str, agent: str, reason: str) -> None:
    with thread(endpoint, "r0") as ends, opened(endpoint, parts(agent, [0, 1])) as backend:
        with pytest.raises(AgentFailed, match=reason) as caught:
            backend.start()
        backend.close()
        assert ends.get(timeout=20.0) is None
    assert caught.value.robots == "flock-0, flock-1"


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


def process_of(host: "subprocess.Popen[bytes]") -> psutil.Process:
    """The agent process of a host: its fork server's child."""
    (server,) = psutil.Process(host.pid).children()
    return server.children()[0]


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


def test_wait_for_robots_without_a_runner_is_announced_once(endpoint: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(zenoh_backend, "ANNOUNCE_S", 0.0)
    with hosts(endpoint, ["a", "b"]) as started:
        announced: list[tuple[str, ...]] = []
        checks = itertools.count()
        hooks = BackendHooks(stopped=lambda: bool(announced) and next(checks) > 3, waiting=announced.append)
        with closing(backend_of(endpoint, parts("Counter", [0], [1]), "wait", hooks)) as backend:
            backend.start()
            process = process_of(started[0])
            process.kill()
            process.wait(20.0)
            with pytest.raises(Interrupted):
                act(backend, 0, [0, 1])
    assert announced in ([("flock-0",)], [("flock-1",)])


def test_wait_for_an_answer_is_announced_once_with_its_runner(endpoint: str, monkeypatch: pytest.MonkeyPatch) -> None:
    for threshold in ("ANNOUNCE_S", "SILENT_S"):
        monkeypatch.setattr(zenoh_backend, threshold, 0.0)
    with hosts(endpoint, ["a"]) as started:
        silent, waiting, checks = list[str](), list[tuple[str, ...]](), itertools.count()
        hooks = BackendHooks(
            stopped=lambda: bool(silent) and next(checks) > 3, waiting=waiting.append, silent=silent.append
        )
        with closing(backend_of(endpoint, parts("Counter", [0]), "stand", hooks)) as backend:
            backend.start()
            child = process_of(started[0])
            child.suspend()
            with pytest.raises(Interrupted):
                act(backend, 0, [0])
            child.resume()
    assert (silent, waiting) == (["a, which plays flock-0"], [])


def test_runner_that_is_not_ready_in_time_loses_its_robots(endpoint: str) -> None:
    changes: list[RunnerEvent] = []
    free: list[set[str]] = []
    endpoints: list[tuple[str, ...]] = []
    hooks = BackendHooks(
        changed=lambda change, names: (changes.append(change), free.append({*names})), opened=endpoints.append
    )
    policy = JoinPolicy(OFFER, True, limits=JoinLimits(join_s=0.2))
    lockstep = Lockstep(parts("Counter", [0, 1, 2]), "stand", policy)
    keys = Keys(RUN)
    with closing(LockstepBackend(endpoint, RUN, lockstep, 20.0, WallClock(), hooks)) as backend:
        backend.open()
        with closed_after(open_runner(endpoint)) as idler:
            session_info = idler.get(keys.session_info("idler"))
            joined = idler.get(keys.join("idler"), payload=JoinRequest(names=("flock-1",)).encode())
            until(lambda: (backend._handle_arrived(), changes)[1])
            (info,), (assigned,) = session_info, joined
    assert endpoints == [(endpoint,)]
    assert assigned.ok is not None
    assert info.ok is not None
    assert SessionInfo.decode(info.ok.payload.to_bytes()).groups[0].robots == 3
    reason = "its agents were not ready within 0.2 s"
    assert changes == [RunnerEvent("lost", "idler", ("flock-1",), -1, reason)]
    assert free == [{"flock-0", "flock-1", "flock-2"}]
