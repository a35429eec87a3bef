"""Machines of their own: network namespaces, and a world with certificates."""

import os
import queue
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Callable, Generator, Sequence
from contextlib import ExitStack, contextmanager
from itertools import count, pairwise
from pathlib import Path

import pytest
import zenoh

from swarmwire.agent import runner
from swarmwire.agent.runner_protocol import JoinOptions
from swarmwire.comms.base.clock import WallClock
from swarmwire.comms.observe.interfaces import Observer
from swarmwire.comms.observe.truth import Truth
from swarmwire.comms.wire.join import JoinRequest
from swarmwire.comms.wire.keys import Keys, ObserverKeys
from swarmwire.comms.wire.sessions import closed_after, open_runner
from swarmwire.deploy import Recording, Result, Simulation
from swarmwire.deploy.robots.certificates.folder import begin_authority, issue
from swarmwire.deploy.robots.certificates.member import access_in, network_in
from swarmwire.deploy.robots.certificates.register import certificate_request
from swarmwire.deploy.runs.config import JoinObserver, Listening
from swarmwire.deploy.runs.simulation import run_to_end
from tests.support.agent.processes import thread_server
from tests.support.deploy.runs import LOSSY

SHORT = ["duration_s=2"]
HONEST = ("r0", "r1")
AT_TICK = 3  # when it is disturbed
PURPOSES = {"world": "world", "r0": "runner", "r1": "runner", "mallory": "runner", "robot-1": "robot", "gone": "runner"}
_NUMBERS = count()
TIMEOUT_S = 60.0


def authority(folder: Path) -> Path:
    """A CA with a certificate for each name, good on this machine."""
    begin_authority(folder, WallClock())
    requests = [certificate_request(name, ("127.0.0.1",), purpose) for name, purpose in PURPOSES.items()]
    issue(folder, requests, 1, WallClock())
    return folder


class GuardedWorld(Observer, JoinObserver):
    """Told where the world listens, it brings the honest runners; an observer, it disturbs the run once.

    Attributes:
        endpoint, observed: where runners and observers call.
        keys, seen: the run's.
    """

    def __init__(self, certs: Path, disturb: Callable[["GuardedWorld"], object]) -> None:
        self._certs, self._disturb = certs, disturb
        with socket.create_server(("127.0.0.1", 0)) as free:
            self.observed = f"tls/127.0.0.1:{free.getsockname()[1]}"
        self._threads: list[threading.Thread] = []
        self._fault: BaseException | None = None

    def run(self, out: Path) -> Result:
        """The run, to its end; what went wrong while it was disturbed is raised here."""
        own = network_in(self._certs, "world"), access_in(self._certs)
        listening = Listening(("tls/127.0.0.1:0",), (self.observed,), *own, observer=self)
        record = Recording(tables=False, rrd=False)
        simulation = Simulation(LOSSY, overrides=SHORT, listening=listening, out=out, record=record)
        simulation.watch(self)
        try:
            result = run_to_end(simulation)
        finally:
            for thread in self._threads:
                thread.join(20.0)
        if self._fault is not None:
            raise self._fault
        return result

    @contextmanager
    def session_of(self, name: str, *, observing: bool = False) -> Generator[zenoh.Session]:
        """A session with that name's certificate, at the agents' endpoint or at the observers'."""
        at = self.observed if observing else self.endpoint
        with closed_after(open_runner(at, 10.0, network_in(self._certs, "", name))) as session:
            yield session

    def opened(self, endpoints: tuple[str, ...], run_id: str) -> None:
        self.endpoint, self.keys, self.seen = endpoints[0], Keys(run_id), ObserverKeys(run_id)
        for index, name in enumerate(HONEST):
            robots = tuple(f"flock-{i}" for i in range(10 * index, 10 * index + 10))
            self._threads.append(threading.Thread(target=self._play, args=(name, robots)))
            self._threads[-1].start()

    def see(self, truth: Truth) -> None:
        if truth.tick != AT_TICK - 1:
            return
        try:
            self._disturb(self)
        except BaseException as error:  # noqa: BLE001 - an observer that fails is left out, but this one is the test
            self._fault = error

    def _play(self, name: str, robots: tuple[str, ...]) -> None:
        options = JoinOptions(JoinRequest(names=robots))
        with self.session_of(name) as session:
            runner.run_in_session(
                session, self.keys, name, runner.Arrivals(), lambda: options, runner.ProcessPool(thread_server(), 1)
            )


class Machine:
    """One of them: programs that are started in it see its addresses alone."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.addresses = list[str]()
        self.devices = list[str]()  # of its links, with these addresses

    def command(self, *words: object) -> list[str]:
        """What to start instead of these words, for them to run on this machine."""
        return ["ip", "netns", "exec", self.name, *map(str, words)]

    def link(self, state: str) -> None:
        """Take its first link "down", or "up" again: nothing of the other end is told."""
        subprocess.run(["ip", "-n", self.name, "link", "set", self.devices[0], state], check=True)


@contextmanager
def machines(several: int) -> Generator[list[Machine]]:
    """So many machines in a line, gone afterwards; the test is skipped where that is not permitted.

    The link between machine i and i + 1 has the addresses 10.77.i.1 and 10.77.i.2, and none passes anything on.
    """
    prefix = f"sw{os.getpid() % 100_000}-{next(_NUMBERS)}-"
    made = [Machine(f"{prefix}{i}") for i in range(several)]
    with ExitStack() as stack:
        for machine in made:
            _permitted("ip", "netns", "add", machine.name)
            stack.callback(_ip, "netns", "del", machine.name)
            _permitted("ip", "-n", machine.name, "link", "set", "lo", "up")
        for i, (left, right) in enumerate(pairwise(made)):
            one, other = f"v{prefix[2:]}{i}a"[-15:], f"v{prefix[2:]}{i}b"[-15:]
            peer = "type", "veth", "peer", "name", other, "netns", right.name
            _permitted("ip", "link", "add", one, "netns", left.name, *peer)
            for index, (machine, device) in enumerate([(left, one), (right, other)], 1):
                machine.addresses.append(f"10.77.{i}.{index}")
                machine.devices.append(device)
                _permitted("ip", "-n", machine.name, "address", "add", f"{machine.addresses[-1]}/24", "dev", device)
                _permitted("ip", "-n", machine.name, "link", "set", device, "up")
        yield made


def _ip(*words: str) -> None:
    subprocess.run(["ip", *words], capture_output=True, check=False)


def _permitted(*command: str) -> None:
    """Run it; the test is skipped if it cannot be run here."""
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    except FileNotFoundError as error:
        pytest.skip(f"network namespaces: {error}")
    if done.returncode:
        pytest.skip(f"network namespaces: {' '.join(command[:4])}: {done.stderr.strip()}")


class Started:
    """A command that runs; what it prints, on either stream, is read while it does."""

    def __init__(self, command: Sequence[str], cwd: Path | None = None) -> None:
        environment = {**os.environ, "PYTHONUNBUFFERED": "1", "COLUMNS": "200"}
        pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "text": True}
        self.process: subprocess.Popen[str] = subprocess.Popen(command, cwd=cwd, env=environment, **pipes)
        self.lines: list[str] = []
        self._arrived: queue.SimpleQueue[str | None] = queue.SimpleQueue()
        self._reading = threading.Thread(target=self._read, daemon=True)
        self._reading.start()

    def _read(self) -> None:
        for line in self.process.stdout:
            self._arrived.put(line.rstrip("\n"))
        self._arrived.put(None)

    @classmethod
    @contextmanager
    def running(cls, command: Sequence[str], cwd: Path | None = None) -> Generator["Started"]:
        """The command; killed with the context if it still runs."""
        started = cls(command, cwd)
        try:
            yield started
        finally:
            started.process.kill()
            started.process.wait()
            started.process.stdout.close()

    def next_line(self, *texts: str) -> str:
        """The next line that holds all these texts, waited for."""
        while (line := self._next()) is not None:
            if all(text in line for text in texts):
                return line
        raise AssertionError(f"it ended without {texts}: {self.lines}")

    def ended(self) -> int:
        """Its exit code, waited for."""
        while self._next() is not None:
            continue
        return self.process.wait(TIMEOUT_S)

    def _next(self) -> str | None:
        """The next line; None if there will be no more."""
        try:
            line = self._arrived.get(timeout=TIMEOUT_S)
        except queue.Empty:
            raise AssertionError(f"nothing more came for {TIMEOUT_S:g} s: {self.lines}") from None
        if line is not None:
            self.lines.append(line)
        return line

    def stop(self) -> int:
        """Its exit code after Ctrl-C."""
        self.process.send_signal(signal.SIGINT)
        return self.ended()


@contextmanager
def on(machine: Machine | None, *words: object, cwd: Path | None = None) -> Generator[Started]:
    """`swarmwire` with these words on a machine, or on this one; killed with the context if it still runs."""
    command = [sys.executable, "-m", "swarmwire.deploy", *map(str, words)]
    with Started.running(machine.command(*command) if machine else command, cwd) as started:
        yield started
