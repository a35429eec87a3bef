"""Progress of a run in a terminal: a panel or lines, missing runners, and addresses of gateways."""

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
from swarmwire.deploy.terminal.console import aligned
from swarmwire.metrics.measures.measure import Metrics
from swarmwire.world.backends.runner_reports import RunnerEvent


def run_progress(simulation: Simulation, console: Console) -> Observer:
    """Return a panel for a terminal, else an observer that prints a few lines."""
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


SHARE = 0.25  # progress between two lines


class ProgressLines(Observer):
    """Observer that prints a few lines on progress, speed, levels of metrics and link PDR."""

    def __init__(
        self, ticks: int, metrics: Metrics, clock: Clock, console: Console, compiled_ns: Callable[[], int]
    ) -> None:
        """Print lines of a run of `ticks`; `metrics` must see a tick first, `compiled_ns` is the compile time."""
        self._figures = Figures(ticks, metrics, clock, compiled_ns)
        self._ticks, self._clock, self._console = ticks, clock, console
        self._next_share = SHARE

    def begin(self, static: Static) -> None:
        """Print name, size and duration of the run."""
        self._figures.begin(static)
        self._began_ns = self._clock.now_ns()
        size = f"{static.robots} robots" + (f" in each of {static.arenas} arenas" if static.arenas > 1 else "")
        self._print(f"{printable(static.name)}: {size}, {self._ticks} ticks at {static.rate_hz} Hz")

    def see(self, truth: Truth) -> None:
        """Add a tick, and print a line after each quarter of the run."""
        figures = self._figures
        figures.see(truth)
        if figures.done >= self._next_share * self._ticks:
            self._next_share += SHARE
            wall_s = to_s(self._clock.now_ns() - self._began_ns) - figures.compiled_s
            speed = f"{figures.time_s / wall_s if wall_s > 0 else 0.0:.1f} x real time"
            levels = [(name, figures.level(name)) for name in figures.levels] + [("link PDR so far", figures.link_pdr)]
            text = "".join(f", {name} {value:.3g}" for name, value in levels if not math.isnan(value))
            self._print(
                f"tick {figures.done}/{self._ticks}, {figures.time_s:.1f} s simulated, {speed}{text}{figures.stopped}"
            )

    def _print(self, text: str) -> None:
        self._console.print(text, markup=False, soft_wrap=True)


class JoinProgress(Observer, JoinObserver):
    """Observer of runners that join, which prints the robots without an agent until the run begins.

    The run itself prints joins, losses and refusals.
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

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stop()

    def opened(self, endpoints: tuple[str, ...], run_id: str) -> None:
        """Print the command that joins."""
        self._print(f"run {run_id} listens at {', '.join(endpoints)}; agents join it by")
        self._endpoint = endpoints[0]
        self._print(f"  {self._command(f' --robots {len(self._robots)}')}")
        if self._status is not None:
            self._status.start()
        self._print_missing(self._robots)

    def changed(self, change: RunnerEvent, free: tuple[str, ...]) -> None:
        """Print the robots without an agent."""
        if change.tick == NO_TICK:
            self._print_missing(free)

    def waiting(self, free: tuple[str, ...]) -> None:
        """Print the command for robots without an agent."""
        self._print(f"  {self._command()}")

    def begin(self, static: Static) -> None:
        """End the wait."""
        self._stop()

    def _print_missing(self, free: tuple[str, ...]) -> None:
        with_agents = len(self._robots) - len(free)
        text = f"{with_agents} of {len(self._robots)} robots have agents"
        if self._start_with is not None:
            text += f", and the run begins with {self._start_with}"
        if free:
            text += f"; without: {robots_text(free)}"
        if self._status is not None:
            self._status.update(escape(text))
        else:
            self._print(text)

    def _command(self, options: str = "") -> str:
        """Return the command of a runner of all free robots, or with other options."""
        insecure = "" if is_local(self._endpoint) else " --insecure"
        return f"swarmwire join {self._endpoint}{options}" + (" --certs DIR" if self._network.proves else insecure)

    def _stop(self) -> None:
        if self._status is not None:
            self._status.stop()

    def _print(self, text: str) -> None:
        self._console.print(text, markup=False, soft_wrap=True)


class GatewayAddresses(Observer):
    """Observer that prints a command for each robot behind a gateway."""

    def __init__(self, simulation: Simulation, console: Console) -> None:
        self._simulation, self._console = simulation, console

    def begin(self, static: Static) -> None:
        """Print robots, addresses and commands; nothing without gateways."""
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
    return robot.name, robot.kind, robot.address or "elsewhere", robot.command or "(without a run folder no settings)"
