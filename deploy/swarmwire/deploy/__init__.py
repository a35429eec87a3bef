"""Where things run: `run` a scenario from Python, or step a `Simulation`; the command line does the same."""

from swarmwire.deploy.result import ArenaResult, Percentiles, RadioResult, Result, Statistics
from swarmwire.deploy.run import run
from swarmwire.deploy.simulation import Simulation

__all__ = ["ArenaResult", "Percentiles", "RadioResult", "Result", "Simulation", "Statistics", "run"]
