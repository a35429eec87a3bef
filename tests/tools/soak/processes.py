"""Processes of a soak, which are restarted after their end, and steps that act on them."""

import heapq
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Generator, Mapping, Sequence
from itertools import count
from pathlib import Path

import psutil

from swarmwire.comms.base.clock import to_ns
from tests.support.deploy.runs import ROOT

SCENARIO = Path(__file__).parent / "soak.toml"
PYTHON = (sys.executable, "-m")
LET_GO_S = 10.0  # how long a process that is asked to end may take


class Supervised:
    """One process of a soak.

    Attributes:
        starts: how often it was started.
        codes: exit codes so far; negative: the signal that ended it.
    """

    def __init__(
        self,
        name: str,
        command: Callable[[], Sequence[str]],
        log: Path,
        env: Mapping[str, str],
        again_s: float | None = None,
    ) -> None:
        """`command` is called at each start; the process is restarted `again_s` after its end, if at all."""
        self.name, self.again_s, self.starts, self.codes = name, again_s, 0, list[int]()
        self._command, self._log, self._env = command, log, env
        self._process: subprocess.Popen[bytes] | None = None
        self._due_ns: int | None = 0
        self.frozen = False

    def tend(self, now_ns: int) -> None:
        """Note an end; start the process if it is due."""
        if self._process is not None and (code := self._process.poll()) is not None:
            self.codes.append(code)
            self._process, self.frozen = None, False
            if self._due_ns is None and self.again_s is not None:
                self._due_ns = now_ns + to_ns(self.again_s)
        if self._process is None and self._due_ns is not None and now_ns >= self._due_ns:
            self._due_ns = None
            with self._log.open("ab") as log:
                pipes = {"stdin": subprocess.DEVNULL, "stdout": log, "stderr": log}
                self._process = subprocess.Popen(self._command(), env=dict(self._env), **pipes)
            self.starts += 1

    def stay_away(self) -> None:
        """Restart it no more."""
        self.again_s, self._due_ns = None, None

    def come(self) -> None:
        """Start it, if it never ran."""
        if self.starts == 0:
            self._due_ns = 0

    def after(self, again_s: float) -> None:
        """Set the time from an end to the restart."""
        self.again_s = again_s

    @property
    def pid(self) -> int | None:
        """Process id, or None if none runs."""
        return None if self._process is None or self._process.poll() is not None else self._process.pid

    def send(self, number: signal.Signals) -> bool:
        """Send a signal; False if no process runs."""
        if self._process is None or self._process.poll() is not None:
            return False
        self._process.send_signal(number)
        if number in (signal.SIGSTOP, signal.SIGCONT):
            self.frozen = number == signal.SIGSTOP
        return True

    def ended_within(self, limit_s: float) -> bool:
        """Return True if it ends by itself within this time."""
        if self._process is None:
            return True
        try:
            self._process.wait(limit_s)
        except subprocess.TimeoutExpired:
            return False
        return True

    def end(self) -> int | None:
        """Wait for its end, or kill it; its exit code, None if it did not run."""
        if self._process is None:
            return None
        try:
            return self._process.wait(LET_GO_S)
        except subprocess.TimeoutExpired:
            self.kill()
            return self._process.wait(LET_GO_S)

    def kill(self) -> None:
        """Kill it and all its children."""
        if self._process is None or self._process.poll() is not None:
            return
        for process in (*family(self._process.pid), self._process):
            process.kill()


def family(pid: int) -> list[psutil.Process]:
    """All children of a process, recursively; none if it is gone."""
    try:
        return psutil.Process(pid).children(recursive=True)
    except psutil.NoSuchProcess:
        return []


def environment(temporary: Path) -> Mapping[str, str]:
    """The environment of all processes of a soak: temporary files go to a folder that shall be empty at its end."""
    runtime_folder = temporary / "own"
    runtime_folder.mkdir(parents=True, mode=0o700)
    folders = {"TMPDIR": str(temporary), "XDG_RUNTIME_DIR": str(runtime_folder), "PYTHONPATH": str(ROOT)}
    return {**os.environ, **folders, "OPENBLAS_NUM_THREADS": "1"}


Steps = Generator[float]


class Agenda:
    """Generators in progress, each resumed when it is due."""

    def __init__(self) -> None:
        self._due: list[tuple[int, int, Steps]] = []
        self._serial = count()

    @property
    def is_empty(self) -> bool:
        """True if no step is to come."""
        return not self._due

    def begin(self, steps: Steps, now_ns: int) -> None:
        """Run the first step now, the next ones when they are due."""
        wait_s = next(steps, None)
        if wait_s is not None:
            heapq.heappush(self._due, (now_ns + to_ns(wait_s), next(self._serial), steps))

    def step(self, now_ns: int) -> None:
        """Run all due steps."""
        while self._due and self._due[0][0] <= now_ns:
            self.begin(heapq.heappop(self._due)[2], now_ns)
