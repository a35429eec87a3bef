"""The processes of a schedule beside the world's, kept by a thread: started when they may, faulted when it is time."""

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
    """Runners, router and observers of a schedule. They are told of the world as its onlookers are.

    Attributes:
        tick: that the world is at; -1: before the first.
    """

    def __init__(self, plan: Plan, folder: Path, env: Mapping[str, str]) -> None:
        """`folder` is for what they say; the run's is `run` in it."""
        super().__init__(name="actors", daemon=True)
        self._plan, self._folder, self._clock, self._env = plan, folder, WallClock(), env
        self._agenda, self._due = Agenda(), list(plan.faults)
        self._world = self._front = ""  # where the world listens, and where runners call
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
        """The world listens."""
        self._world = endpoints[0]

    def begin(self, static: object) -> None:
        """The run is about to begin."""
        self.tick = 0

    def see(self, truth) -> None:
        """A tick is over."""
        self.tick = truth.tick

    def run(self) -> None:
        """Keep them until `close`."""
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
        """The run is over: all thaw and end by themselves; Broken if one does not, or ended as it never should."""
        self._over.set()
        self.join()
        for one in self.all:
            one.stay_away()
            one.send(signal.SIGCONT)
        if self.router:
            self.router.send(signal.SIGINT)
        try:
            late = [one.name for one in self.all if not one.ended_within(END_S)]
            if late:
                raise Late(f"did not end within {END_S:g} s of the run: {', '.join(late)}")
        finally:
            for one in self.all:
                one.kill()
                one.end()
        self._check()

    def _check(self) -> None:
        if self.fault is not None:
            raise self.fault
        for one in self.all:
            one.tend(0)
            strange = set(one.codes) - ENDS
            if strange:
                raise Broken(f"{one.name} ended with {sorted(strange)}")
        for path in self._folder.glob("r*.log"):
            said = path.read_text(errors="replace")
            if "Traceback" in said and "KeyboardInterrupt" not in said:
                raise Broken(f"{path.name}: {said[said.index('Traceback') :][-600:]}")

    def _tend(self, now_ns: int) -> None:
        if not self._world:
            return
        if self.router:
            self.router.tend(now_ns)
            said = (self._folder / "router.log").read_text(errors="replace")
            if not self._front and "listens at " in said:
                self._front = said.partition("listens at ")[2].split(",")[0].split()[0]
            if "linked with " not in said:
                return
        else:
            self._front = self._world
        first = len(self.runners) - self._plan.late
        for at, runner in enumerate(self.runners.values()):
            if at < first or self.tick >= self._plan.ticks * (at + 1) // (2 * len(self.runners)):
                runner.tend(now_ns)
        if self.tick >= 0:
            for one in self.observers.values():
                one.tend(now_ns)

    def _steps(self, fault: Fault) -> Steps:
        one = {**self.runners, **self.observers, "router": self.router}[fault.who]
        if one is None:
            return
        match fault.what:
            case "killed" | "leaves":
                one.after(fault.for_s)
                one.send(signal.SIGINT if fault.what == "leaves" else signal.SIGKILL)
                if one.frozen:
                    one.send(signal.SIGCONT)
            case "slowed":
                for _ in range(8):
                    one.send(signal.SIGSTOP)
                    yield 0.1
                    one.send(signal.SIGCONT)
                    yield 0.05
            case _:
                one.send(signal.SIGSTOP)
                yield fault.for_s
                one.send(signal.SIGCONT)

    def _actor(self, name: str, command) -> Supervised:
        return Supervised(name, command, self._folder / f"{name}.log", self._env, AGAIN_S)

    def _join(self, name: str, names: str):
        return (*PYTHON, "swarmwire.agent.cli", "join", self._front, "--name", name, "--names", names, "--scenario",
                str(SCENARIO))  # fmt: skip

    def _route(self):
        return (*PYTHON, "swarmwire.deploy", "router", "--listen", self._front or "tcp/127.0.0.1:0", "--connect",
                self._world)  # fmt: skip


class Nursed(Actors):
    """Runners that are the run's own, and observers. Who is dead stays so: nobody starts another."""

    def _tend(self, now_ns: int) -> None:
        if self.tick >= 0:
            for one in self.observers.values():
                one.tend(now_ns)

    def _steps(self, fault: Fault) -> Steps:
        if fault.who in self.observers:
            yield from super()._steps(fault)
            return
        own = self._own()
        at = int(fault.who.removeprefix("r"))
        if at >= len(own):
            return
        if fault.what in ("killed", "leaves"):
            _send(own[at], signal.SIGKILL if fault.what == "killed" else signal.SIGTERM)
            return
        _send(own[at], signal.SIGSTOP)
        yield fault.for_s
        _send(own[at], signal.SIGCONT)

    def _own(self) -> list[psutil.Process]:
        found: list[psutil.Process] = []
        for one in psutil.Process().children():
            with suppress(psutil.Error):  # an agent host whose runners are all dead has ended
                if "swarmwire.agent.agent_host" in one.cmdline():
                    found += sorted(processes_of(psutil.Process()), key=lambda child: child.pid)
        return found


def _send(process: psutil.Process, number: signal.Signals) -> None:
    with suppress(psutil.NoSuchProcess):
        process.send_signal(number)
