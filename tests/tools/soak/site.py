"""A world of a soak, its runners and observers, started from the command line."""

import re
import signal
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import psutil

from swarmwire.deploy.runs.live_address import Live, read_live
from tests.support.deploy.runs import WATCHER
from tests.tools.soak.processes import PYTHON, SCENARIO, Supervised, family

AT_ONCE = 8  # runners that start at the same time


@dataclass(frozen=True)
class Kind:
    """A kind of run."""

    name: str
    robots: int
    robots_each: int  # agent processes of a runner
    options: tuple[str, ...]  # options of `swarmwire world`
    speed: float | None = None  # requested after the start


class Site:
    """A world, its runners and observers.

    Attributes:
        kind: of run.
        folder: of the run.
        runners: agent hosts, in the order of their robots; the first are never touched.
        observers: observers, pages and browser tabs, by name; those whose name ends with "calm" are never touched.
    """

    def __init__(self, kind: Kind, folder: Path, env: Mapping[str, str]) -> None:
        """`folder` is for all that this world, its runners and observers write."""
        folder.mkdir(parents=True)
        self.kind, self.folder, self._at, self.env = kind, folder / "run", folder, env
        self.world = Supervised("world", self._world_command, folder / "world.log", env)
        self.runners = [
            Supervised(f"r{number}", partial(self._runner_command, number), folder / "runners.log", env)
            for number in range(kind.robots // kind.robots_each)
        ]
        self.observers: dict[str, Supervised] = {}
        self._started = 0
        self._endpoint: str | None = None

    @property
    def log_text(self) -> str:
        """Output of the world so far."""
        path = self._at / "world.log"
        return path.read_text(errors="replace") if path.exists() else ""

    @property
    def live(self) -> Live | None:
        """Address of the live run, or None before and after it."""
        return read_live(self.folder)

    @property
    def all(self) -> list[Supervised]:
        """Every process but the world."""
        return [*self.runners, *self.observers.values()]

    def tend(self, now_ns: int) -> None:
        """Start due processes; at first a few runners at a time, as they join."""
        if self.endpoint is None:
            return
        if self._started < len(self.runners):
            joined = self.log_text.count(" joined with ")
            self._started = max(self._started, min(len(self.runners), joined + AT_ONCE))
        for runner in self.runners[: self._started]:
            runner.tend(now_ns)
        if self.live is not None:
            for process in self.observers.values():
                process.tend(now_ns)

    def observe(self, names: Sequence[str]) -> None:
        """Add observers, pages and tabs; a tab "tab-X" is of the page "page-X"."""
        for name in names:
            role = name.partition("-")[0]
            command = {"observer": self._observer, "page": self._page, "tab": self._tab}[role]
            self.observers[name] = Supervised(name, partial(command, name), self.log(name), self.env, 1.0)

    def close(self) -> None:
        """Kill all processes."""
        for process in (*self.all, self.world):
            process.send(signal.SIGCONT)
            process.kill()
            process.end()

    def agents_of(self, runner: Supervised) -> list[psutil.Process]:
        """The agent processes of a runner, in the order of their robots."""
        try:
            servers = psutil.Process(runner.pid).children() if runner.pid else []
            return sorted(
                (process for server in servers for process in server.children()), key=lambda process: process.pid
            )
        except psutil.NoSuchProcess:
            return []

    def viewers_of(self, name: str) -> list[int]:
        """Processes that a page has started: the viewer."""
        pid = self.observers[name].pid
        return [process.pid for process in family(pid)] if pid else []

    def log(self, name: str) -> Path:
        """Log file of a process."""
        return self._at / f"{name}.log"

    @property
    def endpoint(self) -> str | None:
        """Endpoint for runners, or None before the world has printed it."""
        if self._endpoint is None and (match := re.search(r"listens at (\S+?)[;,]", self.log_text)):
            self._endpoint = match[1]
        return self._endpoint

    def _world_command(self) -> Sequence[str]:
        return (*PYTHON, "swarmwire.deploy", "world", str(SCENARIO), "--listen", "tcp/127.0.0.1:0", "--out",
                str(self.folder), "--set", f"robots.swarm.count={self.kind.robots}", *self.kind.options)  # fmt: skip

    def _runner_command(self, number: int) -> Sequence[str]:
        first = number * self.kind.robots_each
        names = ",".join(f"swarm-{robot}" for robot in range(first, first + self.kind.robots_each))
        return (*PYTHON, "swarmwire.agent.cli", "join", self.endpoint or "", "--name", f"r{number}", "--names",
                names, "--scenario", str(SCENARIO))  # fmt: skip

    def _observer(self, _: str) -> Sequence[str]:
        return (PYTHON[0], "-c", WATCHER, str(self.folder))

    def _page(self, _: str) -> Sequence[str]:
        return (*PYTHON, "swarmwire.deploy", "ui", str(self.folder))

    def _tab(self, name: str) -> Sequence[str]:
        return (*PYTHON, "tests.tools.soak.tab", str(self.log(name.replace("tab", "page"))))
