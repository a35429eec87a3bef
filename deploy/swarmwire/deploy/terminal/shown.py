"""How a run is shown while it goes on."""

from rich.console import Console

from swarmwire.comms.clock import WallClock
from swarmwire.comms.interfaces import Observer
from swarmwire.deploy.simulation import Simulation
from swarmwire.deploy.terminal.panel import Panel
from swarmwire.deploy.terminal.progress import ProgressLines


def progress(simulation: Simulation, console: Console) -> Observer:
    """A panel with keys in a terminal, else a line now and then."""
    metrics, clock = simulation.metrics, WallClock()
    if console.is_terminal and not console.is_dumb_terminal and not console.quiet:
        return Panel(simulation.ticks, metrics, simulation.controls, simulation.health, clock, console)
    return ProgressLines(simulation.ticks, metrics, clock, console)
