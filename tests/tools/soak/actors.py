"""Runners, router and observers of a schedule, which a thread starts and disturbs."""

import signal
import threading
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

import psutil

from swarmwire.comms.base.clock import WallClock
from swarmwire.comms.observe.interfaces import Observer
from swarmwire.deploy.runs.config import JoinObserver
from tests.support.deploy.runs import WATCHER, processes_of
from tests.tools.soak.invariants import Broken, Late
from tests.tools.soak.plan import Fault, Plan
from tests.tools.soak.processes import PYTHON, SCENARIO, Agenda, Steps, Supervised

EACH_S = 0.01
END_S = 120.0  # a runner that cannot reach its world any more gives up after 30 s; a machine may be busy
AGAIN_S = 0.3
ENDS = {0, 1, 130, -signal.SIGKILL, -signal.SIGINT}  # 1: it was told why; SIGINT: while Python was still starting


class Actors(threading.Thread, Observer, JoinObserver):
    """Runners, router and observers of a schedule, which follow the world as observers.

    Attributes:
        tick: of the world; -1 before the first.
    """

    def __init__(self, plan: Plan, folder: Path, env: Mapping[str, str]) -> None:
        """`folder` is for logs; its subfolder `run` is the run folder."""
        super().__init__(name="actors", daemon=True)
        self._plan, self._folder, self._clock, self._env = plan, folder, WallClock(), env
        self._agenda, self._due = Agenda(), list(plan.faults)
        self._world = self._front = ""  # endpoints of the world and for runners
        self._over = threading.Event()
        self.tick = -1
        self.fault: BaseException | None = None
        first = 0
        self.runners: dict[str, Supervised] = {}
        for at, count in enumerate(plan.robots):
            names = ",".join(f"swarm-{robot}" for robot in range(first, first + count))
            self.runners[f"r{at}"] = self._actor(f"r{at}", lambda at=at, names=names: self._join(f"r{at}", names))
            first += count
        self.router = self._actor("router", self._route) if plan.router else None
        self.observers = {
            f"observer{at}": self._actor(f"observer{at}", lambda: (PYTHON[0], "-c", WATCHER, str(folder / "run")))
            for at in range(plan.observers)
        }

    @property
    def all(self) -> list[Supervised]:
        """Every process."""
        return [*self.runners.values(), *self.observers.values(), *([self.router] if self.router else [])]

    def opened(self, endpoints: tuple[str, ...], run_id: str) -> None:
        """Note where the world listens."""
        self._world = endpoints[0]

    def begin(self, static: object) -> None:
        """Note the begin of the run."""
        self.tick = 0

    def see(self, truth) -> None:
        """Note the tick."""
        self.tick = truth.tick

    def run(self) -> None:
        """Tend the processes until `close`."""
        try:
            while not self._over.is_set():
                now_ns = self._clock.now_ns()
                self._tend(now_ns)
                while self._due and self.tick >= self._due[0].tick:
                    self._agenda.begin(self._steps(self._due.pop(0)), now_ns)
                self._agenda.step(now_ns)
                self._over.wait(EACH_S)
        except BaseException as fault:  # noqa: BLE001 - told by `close`
            self.fault = fault

    def close(self) -> None:
        """Thaw all and wait for their end; Broken if a process does not end, or ended with a bad code."""
        self._over.set()
        self.join()
        for process in self.all:
            process.stay_away()
            process.send(signal.SIGCONT)
        if self.router:
            self.router.send(signal.SIGINT)
        try:
            late = [process.name for process in self.all if not process.ended_within(END_S)]
            if late:
                raise Late(f"did not end within {END_S:g} s of the run: {', '.join(late)}")
        finally:
            for process in self.all:
                process.kill()
                process.end()
        self._check()

    def _check(self) -> None:
        if self.fault is not None:
            raise self.fault
        for process in self.all:
            process.tend(0)
            strange = set(process.codes) - ENDS
            if strange:
                raise Broken(f"{process.name} ended with {sorted(strange)}")
        for path in self._folder.glob("r*.log"):
            log_text = path.read_text(errors="replace")
            if "Traceback" in log_text and "KeyboardInterrupt" not in log_text:
                raise Broken(f"{path.name}: {log_text[log_text.index('Traceback') :][-600:]}")

    def _tend(self, now_ns: int) -> None:
        if not self._world:
            return
        if self.router:
            self.router.tend(now_ns)
            log_text = (self._folder / "router.log").read_text(errors="replace")
            if not self._front and "listens at " in log_text:
                self._front = log_text.partition("listens at ")[2].split(",")[0].split()[0]
            if "linked with " not in log_text:
                return
        else:
            self._front = self._world
        first = len(self.runners) - self._plan.late
        for at, runner in enumerate(self.runners.values()):
            if at < first or self.tick >= self._plan.ticks * (at + 1) // (2 * len(self.runners)):
                runner.tend(now_ns)
        if self.tick >= 0:
            for process in self.observers.values():
                process.tend(now_ns)

    def _steps(self, fault: Fault) -> Steps:
        process = {**self.runners, **self.observers, "router": self.router}[fault.target]
        if process is None:
            return
        match fault.kind:
            case "killed" | "leaves":
                process.after(fault.for_s)
                process.send(signal.SIGINT if fault.kind == "leaves" else signal.SIGKILL)
                if process.frozen:
                    process.send(signal.SIGCONT)
            case "slowed":
                for _ in range(8):
                    process.send(signal.SIGSTOP)
                    yield 0.1
                    process.send(signal.SIGCONT)
                    yield 0.05
            case _:
                process.send(signal.SIGSTOP)
                yield fault.for_s
                process.send(signal.SIGCONT)

    def _actor(self, name: str, command) -> Supervised:
        return Supervised(name, command, self._folder / f"{name}.log", self._env, AGAIN_S)

    def _join(self, name: str, names: str):
        return (*PYTHON, "swarmwire.agent.cli", "join", self._front, "--name", name, "--names", names, "--scenario",
                str(SCENARIO))  # fmt: skip

    def _route(self):
        return (*PYTHON, "swarmwire.deploy", "router", "--listen", self._front or "tcp/127.0.0.1:0", "--connect",
                self._world)  # fmt: skip


class Nursed(Actors):
    """Runners that the run started, and observers; dead runners are not restarted."""

    def _tend(self, now_ns: int) -> None:
        if self.tick >= 0:
            for process in self.observers.values():
                process.tend(now_ns)

    def _steps(self, fault: Fault) -> Steps:
        if fault.target in self.observers:
            yield from super()._steps(fault)
            return
        runners = self._own_runners()
        at = int(fault.target.removeprefix("r"))
        if at >= len(runners):
            return
        if fault.kind in ("killed", "leaves"):
            _send(runners[at], signal.SIGKILL if fault.kind == "killed" else signal.SIGTERM)
            return
        _send(runners[at], signal.SIGSTOP)
        yield fault.for_s
        _send(runners[at], signal.SIGCONT)

    def _own_runners(self) -> list[psutil.Process]:
        runners_: list[psutil.Process] = []
        for process in psutil.Process().children():
            with suppress(psutil.Error):  # an agent host whose runners are all dead has ended
                if "swarmwire.agent.agent_host" in process.cmdline():
                    runners_ += sorted(processes_of(psutil.Process()), key=lambda child: child.pid)
        return runners_


def _send(process: psutil.Process, number: signal.Signals) -> None:
    with suppress(psutil.NoSuchProcess):
        process.send_signal(number)
