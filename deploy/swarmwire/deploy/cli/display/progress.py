"""What a terminal shows until a run has ended: a panel or lines, runners that are missing, addresses of gateways."""

import math
from collections.abc import Callable
from types import TracebackType
from typing import Self

from rich.console import Console
from rich.markup import escape
from rich.status import Status

from swarmwire.comms.base.clock import Clock, WallClock, to_s
from swarmwire.comms.base.printable import printable
from swarmwire.comms.base.sentinels import NO_TICK
from swarmwire.comms.observe.interfaces import Observer
from swarmwire.comms.observe.truth import Static, Truth
from swarmwire.comms.wire.assignment import robots_text
from swarmwire.comms.wire.network import Network, is_local
from swarmwire.deploy.cli.display.figures import Figures
from swarmwire.deploy.cli.display.panel import Panel
from swarmwire.deploy.runs.config import JoinObserver
from swarmwire.deploy.runs.gateways.serving import ServedRobot
from swarmwire.deploy.runs.simulation import Simulation
from swarmwire.deploy.terminal.tables import aligned
from swarmwire.metrics.measures.measure import Metrics
from swarmwire.world.backends.runner_reports import RunnerEvent


def run_progress(simulation: Simulation, console: Console) -> Observer:
    """A panel with keys in a terminal, else a line now and then."""
    ticks, metrics, clock = simulation.plan.ticks, simulation.metrics, WallClock()
    if console.is_terminal and not console.is_dumb_terminal and not console.quiet:
        return Panel(
            ticks,
            metrics,
            simulation.controls,
            simulation.health,
            clock,
            console,
            simulation.compiled_ns,
        )
    return ProgressLines(ticks, metrics, clock, console, simulation.compiled_ns)


SHARE = 0.25  # a line each time that so much more is done


class ProgressLines(Observer):
    """Observer that prints a few lines: how far a run is, how fast, and how the swarm and its radio are doing."""

    def __init__(
        self, ticks: int, metrics: Metrics, clock: Clock, console: Console, compiled_ns: Callable[[], int]
    ) -> None:
        """Of a run of so many ticks; `metrics` must see each tick before, `compiled_ns` gives what compiling took."""
        self._figures = Figures(ticks, metrics, clock, compiled_ns)
        self._ticks, self._clock, self._console = ticks, clock, console
        self._next_share = SHARE

    def begin(self, static: Static) -> None:
        """Say what runs."""
        self._figures.begin(static)
        self._began_ns = self._clock.now_ns()
        size = f"{static.robots} robots" + (f" in each of {static.arenas} arenas" if static.arenas > 1 else "")
        self._print(f"{printable(static.name)}: {size}, {self._ticks} ticks at {static.rate_hz} Hz")

    def see(self, truth: Truth) -> None:
        """Say how it goes, four times in all."""
        figures = self._figures
        figures.see(truth)
        if figures.done >= self._next_share * self._ticks:
            self._next_share += SHARE
            wall_s = to_s(self._clock.now_ns() - self._began_ns) - figures.compiled_s
            speed = f"{figures.time_s / wall_s if wall_s > 0 else 0.0:.1f} x real time"
            levels = [(name, figures.level(name)) for name in figures.levels] + [("link PDR so far", figures.link_pdr)]
            known = "".join(f", {name} {value:.3g}" for name, value in levels if not math.isnan(value))
            self._print(
                f"tick {figures.done}/{self._ticks}, {figures.time_s:.1f} s simulated, {speed}{known}{figures.gone}"
            )

    def _print(self, text: str) -> None:
        self._console.print(text, markup=False, soft_wrap=True)


class JoinProgress(Observer, JoinObserver):
    """Receives runner events, and is an observer, since the waiting is over when a run begins.

    Who came or went and who was refused is said by the run itself; here it is what is still missing.
    """

    def __init__(self, robots: tuple[str, ...], start_with: int | None, network: Network, console: Console) -> None:
        self._robots, self._network, self._console = robots, network, console
        self._start_with = start_with
        self._endpoint = ""
        self._status: Status | None = None
        if console.is_terminal and not console.is_dumb_terminal and not console.quiet:
            self._status = console.status("")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._stop()

    def opened(self, endpoints: tuple[str, ...], run_id: str) -> None:
        """Say what to type elsewhere."""
        self._print(f"run {run_id} listens at {', '.join(endpoints)}; agents join it by")
        self._endpoint = endpoints[0]
        self._print(f"  {self._command(f' --robots {len(self._robots)}')}")
        if self._status is not None:
            self._status.start()
        self._tell(self._robots)

    def changed(self, change: RunnerEvent, free: tuple[str, ...]) -> None:
        """Say who is missing."""
        if change.tick == NO_TICK:
            self._tell(free)

    def waiting(self, free: tuple[str, ...]) -> None:
        """Print the command that brings agents for the robots without one."""
        self._print(f"  {self._command()}")

    def begin(self, static: Static) -> None:
        """The waiting is over."""
        self._stop()

    def _tell(self, free: tuple[str, ...]) -> None:
        played = len(self._robots) - len(free)
        text = f"{played} of {len(self._robots)} robots have agents"
        if self._start_with is not None:
            text += f", and the run begins with {self._start_with}"
        if free:
            text += f"; without: {robots_text(free)}"
        if self._status is not None:
            self._status.update(escape(text))
        else:
            self._print(text)

    def _command(self, options: str = "") -> str:
        """The command of a runner of all free robots, or with other options."""
        insecure = "" if is_local(self._endpoint) else " --insecure"
        return f"swarmwire join {self._endpoint}{options}" + (" --certs DIR" if self._network.proves else insecure)

    def _stop(self) -> None:
        if self._status is not None:
            self._status.stop()

    def _print(self, text: str) -> None:
        self._console.print(text, markup=False, soft_wrap=True)


class GatewayAddresses(Observer):
    """Observer that prints a line for each such robot, to be copied into a shell; nothing where there are none."""

    def __init__(self, simulation: Simulation, console: Console) -> None:
        self._simulation, self._console = simulation, console

    def begin(self, static: Static) -> None:
        """Print them."""
        served = self._simulation.served
        if served is None:
            return
        rows = [("robot", "gateway", "address", "driven by"), *(_row(robot) for robot in served.robots)]
        for line in aligned(rows):
            self._print(line)
        self._print(f"network of swarm {served.swarm!r}: {' '.join(served.endpoints)}")

    def _print(self, text: str) -> None:
        self._console.print(text, markup=False, soft_wrap=True)


def _row(robot: ServedRobot) -> tuple[str, str, str, str]:
    return robot.name, robot.kind, robot.address, robot.command or "(without a run folder no settings)"
