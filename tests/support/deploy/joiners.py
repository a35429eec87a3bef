"""Runners that tests start as processes of their own, at a world that listens."""

import shutil
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from swarmwire.deploy.listening import Listening
from swarmwire.deploy.result import Result
from swarmwire.deploy.running import finished
from swarmwire.deploy.simulation import Simulation
from swarmwire.world.crews.change import Change
from tests.integration.deploy.test_realtime import Watcher
from tests.support.deploy.commands import LOSSY, ROOT

HERE = ("tcp/127.0.0.1:0",)
WANDERER = ROOT / "tests/tools/soak/wanderer.py"  # a step that is lost or made twice shows in its run


class Joiners:
    """Told of runners that come and go; starts runners, and what the test wants to happen then."""

    def __init__(self, folder: Path) -> None:
        self.agent = Path(shutil.copy(WANDERER, folder))
        self.endpoint = ""
        self.before: tuple[str, ...] = ()  # of each command: what starts it
        self.processes: dict[str, subprocess.Popen[str]] = {}
        self.changes: list[Change] = []
        self.refusals: list[tuple[str, str]] = []
        self.first: list[tuple[str, ...]] = []  # who joins as soon as the world listens, one after the other
        self.on_change: Callable[[Change], object] = lambda _: None

    @property
    def overrides(self) -> list[str]:
        return [f"robots.flock.agent={self.agent}:Wanderer", "robots.flock.params={}", "run.runner_timeout_s=20"]

    def start(self, name: str, *arguments: str | Path) -> None:
        """A runner that joins."""
        command = [sys.executable, "-m", "swarmwire.agent.cli", "join", self.endpoint, "--name", name]
        command = [*self.before, *command, *map(str, arguments)]
        self.processes[name] = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)

    def send(self, name: str, number: signal.Signals) -> None:
        self.processes[name].send_signal(number)

    def said(self, name: str) -> tuple[int, str]:
        """The exit code of a runner that ends, and what it said."""
        process = self.processes.pop(name)
        _, errors = process.communicate(timeout=60.0)
        return process.returncode, errors

    def close(self) -> None:
        for process in self.processes.values():
            process.kill()
            process.communicate()

    def opened(self, endpoints: tuple[str, ...], run_id: str) -> None:
        self.endpoint = endpoints[0]
        self._next()

    def changed(self, change: Change, free: tuple[str, ...]) -> None:
        self.changes.append(change)
        self._next()
        self.on_change(change)

    def refused(self, runner: str, why: str) -> None:
        self.refusals.append((runner, why))

    def _next(self) -> None:
        if self.first:
            name, *arguments = self.first.pop(0)
            self.start(name, *arguments)

    @property
    def told(self) -> list[tuple[str, str]]:
        """What became of whom, in order."""
        return [(change.what, change.runner) for change in self.changes]

    def run(
        self, *overrides: str, watcher: Watcher | None = None, start_with: int | None = None, **more: Any
    ) -> Result:
        """A run that listens, to its end."""
        simulation = Simulation(
            LOSSY,
            overrides=[*self.overrides, *overrides],
            listening=Listening(HERE, start_with=start_with, told=self),
            **more,
        )
        if watcher is not None:
            simulation.watch(watcher)
        return finished(simulation)
