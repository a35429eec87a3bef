"""Where things run: `run` a scenario from Python, step a `Simulation`, or `repeat` a run; so does the command line."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from swarmwire.deploy.repetition import Repetition, repeat
    from swarmwire.deploy.result import ArenaResult, Percentiles, RadioResult, Result, Statistics
    from swarmwire.deploy.running import run
    from swarmwire.deploy.simulation import Simulation

__all__ = [
    "ArenaResult",
    "Percentiles",
    "RadioResult",
    "Repetition",
    "Result",
    "Simulation",
    "Statistics",
    "repeat",
    "run",
]

_PLACES = {
    "run": "running",
    "Simulation": "simulation",
    "repeat": "repetition",
    "Repetition": "repetition",
}  # all else is part of a result


def __getattr__(name: str) -> Any:
    """Imports on first use: `swarmwire --help` must not wait for compilers, physics and zenoh."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_PLACES.get(name, 'result')}"), name)


def __dir__() -> list[str]:
    return __all__
