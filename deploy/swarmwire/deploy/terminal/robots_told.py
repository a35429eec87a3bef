"""Robots that answer as real ones, told before the first tick: where they answer, and what drives them."""

from shlex import quote

from rich.console import Console

from swarmwire.comms.interfaces import Observer
from swarmwire.comms.truth import Static
from swarmwire.deploy.gateways.serving import ServedRobot
from swarmwire.deploy.simulation import Simulation
from swarmwire.deploy.terminal.rows import aligned


class RobotsTold(Observer):
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
    command = (
        f"swarmwire-agent run --config {quote(str(robot.file))}" if robot.file else "(without a run folder no settings)"
    )
    return robot.name, robot.kind, robot.address, command
