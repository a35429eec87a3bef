"""A world of a soak, its runners and observers, started from the command line."""

import re
import signal
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from itertools import accumulate, chain
from operator import attrgetter
from pathlib import Path
from typing import Any

import psutil

from swarmwire.comms.base.clock import WallClock, to_ns
from swarmwire.comms.base.errors import SwarmwireError
from swarmwire.deploy.live.remote_control import RemoteControl, controlling
from swarmwire.deploy.runs.live_address import Live, read_live
from tests.support.deploy.runs import WATCHER, processes_of
from tests.tools.soak.processes import PYTHON, SCENARIO, Agenda, Steps, Supervised

# A page keeps the newest 2 GB of what it shows; with less, which it has within minutes, its memory must stay as it is.
PAGE = """
from swarmwire.deploy.cli.program import program
from swarmwire.deploy.live.page import web_viewer

web_viewer.LIVE_BYTES = 20_000_000
program()
"""
AT_ONCE = 8  # runners that start at the same time
EACH_S = 0.05  # a moment


@dataclass(frozen=True)
class Kind:
    """A kind of run.

    Attributes:
        robots: of each runner, in order.
        options: of `swarmwire world`, or of `swarmwire run` if the run starts its runners.
        speed: requested after the start.
        late: runners, of the last, that do not come by themselves.
        untouched: runners, of the first, that are never disturbed.
    """

    name: str
    robots: tuple[int, ...]
    options: tuple[str, ...] = ()
    speed: float | None = None
    late: int = 0
    untouched: int = 0
    has_router: bool = False
    starts_runners: bool = False


class StartedRunner:
    """A runner that the run itself has started, and that nobody restarts."""

    frozen = False

    def __init__(self, process: psutil.Process) -> None:
        self.name, self._process = f"agent process {process.pid}", process

    def after(self, again_s: float) -> None:
        """Do nothing: it does not come back."""

    def send(self, number: signal.Signals) -> bool:
        """Send a signal, SIGTERM for SIGINT, which is for the host; False if no process runs."""
        try:
            self._process.send_signal(signal.SIGTERM if number == signal.SIGINT else number)
        except psutil.NoSuchProcess:
            return False
        return True


Target = Supervised | StartedRunner  # that troubles disturb


class Site:
    """A world, its runners and observers.

    Attributes:
        kind: of run.
        folder: of the run.
        runners: agent hosts, in the order of their robots; none if the run starts them.
        router: between runners and world, if there is one.
        observers: observers, pages and browser tabs, by name; those whose name ends with "calm" are never touched.
    """

    def __init__(self, kind: Kind, folder: Path, env: Mapping[str, str]) -> None:
        """`folder` is for all that this world, its runners and observers write."""
        folder.mkdir(parents=True)
        self.kind, self.folder, self._at, self.env = kind, folder / "run", folder, env
        self.world = self._process("world", self._world_command)
        self.router = self._process("router", self._router_command, 0.3) if kind.has_router else None
        firsts = accumulate(kind.robots, initial=0)
        self.runners = [
            self._process(f"r{number}", partial(self._runner_command, f"r{number}", first, robots), 0.3)
            for number, (first, robots) in enumerate(zip(firsts, kind.robots, strict=False))
            if not kind.starts_runners
        ]
        for runner in self.runners[len(self.runners) - kind.late :]:
            runner.stay_away()
        self.observers: dict[str, Supervised] = {}
        self._started = 0
        self._addresses: dict[str, str] = {}

    @property
    def live(self) -> Live | None:
        """Address of the live run, or None before and after it."""
        return read_live(self.folder)

    @property
    def all(self) -> list[Supervised]:
        """Every process but the world."""
        return [*self.runners, *self.observers.values(), *([self.router] if self.router else [])]

    @property
    def disturbed(self) -> Sequence[Target]:
        """Runners that may be disturbed."""
        if not self.kind.starts_runners:
            return self.runners[self.kind.untouched :]
        try:
            world = psutil.Process(self.world.pid) if self.world.pid else None
            return [StartedRunner(process) for process in (processes_of(world) if world else [])]
        except psutil.NoSuchProcess:
            return []

    @property
    def exit_codes(self) -> Mapping[str, Mapping[str, int]]:
        """How often processes ended with each code, runners together; the world's are not among them."""
        codes = {"runners": [code for runner in self.runners for code in runner.codes]}
        codes |= {process.name: process.codes for process in self.all if process not in self.runners}
        return {name: {str(code): values.count(code) for code in sorted(set(values))} for name, values in codes.items()}

    def tend(self, now_ns: int) -> None:
        """Start due processes, and note those that ended; at first a few runners at a time, as they join."""
        self.world.tend(now_ns)
        if self.endpoint is not None:
            if self.router:
                self.router.tend(now_ns)
            if self._started < len(self.runners):
                joined = self.log_text("world").count(" joined with ")
                self._started = max(self._started, min(len(self.runners), joined + AT_ONCE))
            if self.router is None or "linked with " in self.log_text("router"):
                for runner in self.runners[: self._started]:
                    runner.tend(now_ns)
        if self.live is not None or (self.world.starts and self.world.pid is None):
            for process in self.observers.values():
                process.tend(now_ns)

    def observe(self, names: Sequence[str]) -> None:
        """Add observers, pages and tabs; a tab "tab-X" is of the page "page-X"."""
        for name in names:
            role = name.partition("-")[0]
            command = {"observer": self._observer, "page": self._page, "tab": self._tab}[role]
            self.observers[name] = self._process(name, partial(command, name), 1.0)

    def ask(self, request: Callable[[RemoteControl], Any]) -> Any:
        """The answer of the run; None before and after it, and while the world is frozen."""
        live = self.live
        if live is None or self.world.frozen:
            return None
        with controlling(live.endpoint, live.run) as run:
            return request(run)

    def has_all_robots(self) -> bool:
        """Return True if each robot has a runner."""
        with suppress(SwarmwireError):  # the run does not answer at this moment
            status = self.ask(lambda run: run.status())
            return status is not None and status["runners"]["robots_free"] == 0
        return False

    def close(self) -> None:
        """Kill all processes."""
        for process in (*self.all, self.world):
            process.send(signal.SIGCONT)
            process.kill()
            process.end()

    def agents_of(self, runner: Target) -> list[psutil.Process]:
        """The agent processes of a runner, in the order of their robots."""
        pid = runner.pid if isinstance(runner, Supervised) else None
        try:
            servers = psutil.Process(pid).children() if pid else []
            return sorted(chain.from_iterable(server.children() for server in servers), key=attrgetter("pid"))
        except psutil.NoSuchProcess:
            return []

    def log(self, name: str) -> Path:
        """Log file of a process."""
        return self._at / f"{name}.log"

    def log_text(self, name: str) -> str:
        """Output of a process so far."""
        path = self.log(name)
        return path.read_text(errors="replace") if path.exists() else ""

    @property
    def endpoint(self) -> str | None:
        """Endpoint of the world for runners, or None before the world has printed it."""
        return self._endpoint_of("world")

    def _endpoint_of(self, name: str) -> str | None:
        if name not in self._addresses and (match := re.search(r"listens at (\S+?)[;,\s]", self.log_text(name))):
            self._addresses[name] = match[1]
        return self._addresses.get(name)

    def _process(self, name: str, command: Callable[[], Sequence[str]], again_s: float | None = None) -> Supervised:
        return Supervised(name, command, self.log(name), self.env, again_s)

    def _world_command(self) -> Sequence[str]:
        command, own = ("run", ("--runners", str(len(self.kind.robots)))) if self.kind.starts_runners else (
            "world", ("--listen", "tcp/127.0.0.1:0"))  # fmt: skip
        return (*PYTHON, "swarmwire.deploy", command, str(SCENARIO), *own, "--out", str(self.folder), "--set",
                f"robots.swarm.count={sum(self.kind.robots)}", *self.kind.options)  # fmt: skip

    def _router_command(self) -> Sequence[str]:
        return (*PYTHON, "swarmwire.deploy", "router", "--listen", self._endpoint_of("router") or "tcp/127.0.0.1:0",
                "--connect", self.endpoint or "")  # fmt: skip

    def _runner_command(self, name: str, first: int, robots: int) -> Sequence[str]:
        names = ",".join(f"swarm-{robot}" for robot in range(first, first + robots))
        endpoint = self._endpoint_of("router" if self.router else "world") or ""
        return (*PYTHON, "swarmwire.agent.cli", "join", endpoint, "--name", name, "--names", names, "--scenario",
                str(SCENARIO))  # fmt: skip

    def _observer(self, _: str) -> Sequence[str]:
        return (PYTHON[0], "-c", WATCHER, str(self.folder))

    def _page(self, _: str) -> Sequence[str]:
        return (PYTHON[0], "-c", PAGE, "ui", str(self.folder))

    def _tab(self, name: str) -> Sequence[str]:
        return (*PYTHON, "tests.tools.soak.tab", str(self.log(name.replace("tab", "page"))))


class Course:
    """The course of time at some sites: processes are started again, and steps of troubles run when they are due.

    Attributes:
        agenda: steps to come.
    """

    def __init__(self, *sites: Site) -> None:
        self.sites, self.agenda, self._clock = sites, Agenda(), WallClock()

    @property
    def now_ns(self) -> int:
        """Wall time."""
        return self._clock.now_ns()

    def begin(self, steps: Steps) -> None:
        """Run the first step now, the next ones when they are due."""
        self.agenda.begin(steps, self.now_ns)

    def step(self) -> None:
        """Let a moment pass."""
        now_ns = self.now_ns
        for site in self.sites:
            site.tend(now_ns)
        self.agenda.step(now_ns)
        self._clock.sleep_until(now_ns + to_ns(EACH_S))

    def pass_time(self, for_s: float) -> None:
        """Let so much time pass."""
        end_ns = self.now_ns + to_ns(for_s)
        while self.now_ns < end_ns:
            self.step()

    def until(self, holds: Callable[[], object], event: str, limit_s: float = 120.0) -> None:
        """Let time pass until this holds; TimeoutError after the limit."""
        end_ns = self.now_ns + to_ns(limit_s)
        while not holds():
            if self.now_ns > end_ns:
                raise TimeoutError(f"waited {limit_s:g} s for {event}: {self.sites[0].log_text('world')[-600:]}")
            self.step()

    def recover(self) -> None:
        """Let all troubles end; whoever is away comes back."""
        self.until(lambda: self.agenda.is_empty, "troubles to be over")
        for site in self.sites:
            for process in (*site.all, site.world):
                process.come()
                process.send(signal.SIGCONT)
            if site.runners:
                self.until(site.has_all_robots, "all runners to be back")

    def end(self, number: signal.Signals | None = None) -> None:
        """End the runs by a signal to the world or, without one, by request; routers and pages end at SIGINT."""
        for site in self.sites:
            for process in (*site.all, site.world):
                process.stay_away()
            if number is None:
                site.ask(lambda run: run.stop())
            else:
                site.world.send(number)
        for site in self.sites:
            self.until(lambda site=site: site.world.pid is None, "the world to end")
            self.until(lambda site=site: all(runner.pid is None for runner in site.runners), "runners to end")
            for process in site.all:
                if process.name.startswith(("page", "router")):
                    process.send(signal.SIGINT)
            self.until(lambda site=site: all(process.pid is None for process in site.all), "observers to end")
        self.step()  # notes their exit codes
