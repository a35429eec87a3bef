"""Runners that come and go as a test says: processes at a world that listens, or protocol code in this process."""

import shutil
import signal
import subprocess
import sys
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from swarmwire.agent.agent import load_agent
from swarmwire.agent.agent_group import layout_of
from swarmwire.comms.observe.interfaces import Observer
from swarmwire.comms.observe.truth import Truth
from swarmwire.comms.robot.packets import NO_TX_STATUSES, ReceivedPackets, TxStatuses
from swarmwire.comms.robot.tick_io import Actions, Readings
from swarmwire.comms.wire import frames
from swarmwire.comms.wire.assignment import Assignment
from swarmwire.comms.wire.join import JoinRequest
from swarmwire.deploy.runs.backends import REPLACEABLE
from swarmwire.deploy.runs.config import JoinObserver, Listening
from swarmwire.deploy.runs.result import Result
from swarmwire.deploy.runs.simulation import Simulation, run_to_end
from swarmwire.world.backends.join_policy import JoinPolicy
from swarmwire.world.backends.lockstep import Lockstep
from swarmwire.world.backends.registry import OnLoss
from swarmwire.world.backends.runner_reports import RunnerEvent
from tests.support.agent.runners import EncodedRunner
from tests.support.deploy.runs import LOSSY, ROOT

LOCALHOST = ("tcp/127.0.0.1:0",)
WANDERER = ROOT / "tests/tools/soak/wanderer.py"  # a step that is lost or made twice shows in its run


def interrupt() -> None:
    """Ctrl-C in this process."""
    signal.raise_signal(signal.SIGINT)


def moving(truth: Truth) -> list[int]:
    """Robots that are told to move."""
    return [row for row, command in enumerate(truth.command) if command.any()]


class Watcher(Observer):
    """An observer that goes from one act to the next as soon as what it waits for is true."""

    def __init__(self, *steps: tuple[Callable[[Truth], bool], Callable[[], object]]) -> None:
        self.steps = list(steps)
        self.truths: list[Truth] = []

    def see(self, truth: Truth) -> None:
        self.truths.append(truth)
        if self.steps and self.steps[0][0](truth):
            self.steps.pop(0)[1]()


class Joiners(JoinObserver):
    """Told of runners that come and go; starts runners, and what the test wants to happen then."""

    def __init__(self, folder: Path) -> None:
        self.agent = Path(shutil.copy(WANDERER, folder))
        self.endpoint = ""
        self.before: Sequence[str] = ()  # of each command: what starts it
        self.processes: dict[str, subprocess.Popen[str]] = {}  # by the label under which it was started
        self.changes: list[RunnerEvent] = []
        self.refusals: list[tuple[str, str]] = []
        self.first: list[tuple[str | Path, ...]] = []  # who joins as soon as the world listens, one after the other
        self.on_change: Callable[[RunnerEvent], object] = lambda _: None

    @property
    def overrides(self) -> list[str]:
        return [f"robots.flock.agent={self.agent}:Wanderer", "robots.flock.params={}", "run.runner_timeout_s=20"]

    def start(self, name: str, *arguments: str | Path, label: str = "") -> None:
        """A runner that joins."""
        command = [sys.executable, "-m", "swarmwire.agent.cli", "join", self.endpoint, "--name", name]
        command = [*self.before, *command, *map(str, arguments)]
        self.processes[label or name] = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)

    def send(self, name: str, number: signal.Signals) -> None:
        self.processes[name].send_signal(number)

    def outcome(self, name: str) -> tuple[int, str]:
        """The exit code of a runner that ends, and what it printed."""
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

    def changed(self, change: RunnerEvent, free: tuple[str, ...]) -> None:
        self.changes.append(change)
        self._next()
        self.on_change(change)

    def refused(self, runner: str, reason: str) -> None:
        self.refusals.append((runner, reason))

    def _next(self) -> None:
        if self.first:
            name, *arguments = self.first.pop(0)
            self.start(str(name), *arguments)

    @property
    def events(self) -> list[tuple[str, str]]:
        """What became of whom, in order."""
        return [(change.what, change.runner) for change in self.changes]

    def tick_of(self, event: str) -> int | None:
        """The tick in which this was told; None: not yet."""
        return next((change.tick for change in self.changes if f"{change.what} {change.runner}" == event), None)

    def run(
        self, *overrides: str, watcher: Watcher | None = None, start_with: int | None = None, **more: Any
    ) -> Result:
        """A run that listens, to its end."""
        listening = Listening(LOCALHOST, start_with=start_with, observer=self)
        simulation = Simulation(LOSSY, overrides=[*self.overrides, *overrides], listening=listening, **more)
        if watcher is not None:
            simulation.watch(watcher)
        return run_to_end(simulation)


class EncodedJoiners:
    """A AgentBackend of runners in this process that come and go as a script says; every frame is encoded and decoded.

    The script says what happens in a tick, which is open then; in tick -1, before the first: "join NAME" with a number
    of robots or their names, "leave NAME", "lose NAME", and "mute NAME": it answers no more, from this tick on.
    """

    def __init__(self, assignment: Assignment, on_loss: OnLoss, script: Mapping[int, Sequence[str]]) -> None:
        memory = {group.name: layout_of(load_agent(group.agent)) for group in assignment.groups}
        terms = JoinPolicy(open=True, start_with=0, memory=memory if on_loss in REPLACEABLE else None)
        self.roster = Lockstep([assignment], on_loss, terms)
        self._script = script
        self._runners: dict[str, EncodedRunner] = {}

    def start(self) -> None:
        for line in self._script[-1]:
            self._do(*line.split())

    def act(
        self, tick: int, readings: Readings, received: ReceivedPackets, tx_status: TxStatuses = NO_TX_STATUSES
    ) -> Actions:
        lines = [line.split() for line in self._script.get(tick, ())]
        for _, name in (line for line in lines if line[0] == "mute"):
            del self._runners[name]
        self._deliver(self.roster.open_tick(tick, readings, received, tx_status))
        for line in lines:
            self._do(*line)
        assert not self.roster.waiting, self.roster.missing
        return self.roster.pop_actions()

    def _do(self, action: str, name: str, robots: str = "") -> None:
        if action == "join":
            fields = {"robots": int(robots)} if robots.isdigit() else {"names": tuple(robots.split(","))}
            request = JoinRequest(**(fields if robots else {}))
            runner = self._runners[name] = EncodedRunner(partial(self.roster.join, name), request)
            self._deliver(self.roster.answer(name, runner.ready))
        elif action == "leave":
            self.roster.answer(name, frames.encode("leave", -1, {}))
            del self._runners[name]
        elif action == "lose":
            self.roster.lose(name, "its link is gone")
            self._runners.pop(name, None)

    def _deliver(self, out: Sequence[tuple[str, bytes]]) -> None:
        for name, data in out:
            if name in self._runners:
                self._deliver(self.roster.answer(name, self._runners[name].answer(data)))

    def counts(self) -> dict[str, int]:
        return self.roster.counts()

    def close(self) -> None:
        self._runners.clear()


def moves(truths: Sequence[Truth]) -> dict[int, list[int]]:
    """From which tick on which robots were told to move."""
    rows = defaultdict[int, list[int]](list)
    last: list[int] | None = None
    for truth in truths:
        if (now := moving(truth)) != last:
            rows[truth.tick] = last = now
    return dict(rows)
