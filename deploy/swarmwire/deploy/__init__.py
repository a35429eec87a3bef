"""Where things run: `run` a scenario from Python; the command line does the same."""

from swarmwire.deploy.result import ArenaResult, Percentiles, RadioResult, Result, Statistics
from swarmwire.deploy.run import run

__all__ = ["ArenaResult", "Percentiles", "RadioResult", "Result", "Statistics", "run"]
