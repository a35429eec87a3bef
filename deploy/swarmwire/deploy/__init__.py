"""Where things run: `run` a scenario from Python, step a `Simulation`, or `repeat` a run; so does the command line."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from swarmwire.deploy.record.recording import Recording
    from swarmwire.deploy.repetition import Repetition, repeat
    from swarmwire.deploy.result import ArenaResult, Percentiles, RadioResult, Result, Statistics
    from swarmwire.deploy.running import run
    from swarmwire.deploy.simulation import Simulation
    from swarmwire.metrics.run_folder import RunFolder

__all__ = [
    "ArenaResult",
    "Percentiles",
    "RadioResult",
    "Recording",
    "Repetition",
    "Result",
    "RunFolder",
    "Simulation",
    "Statistics",
    "repeat",
    "run",
]

_PLACES = {
    "Recording": "swarmwire.deploy.record.recording",
    "Repetition": "swarmwire.deploy.repetition",
    "RunFolder": "swarmwire.metrics.run_folder",
    "Simulation": "swarmwire.deploy.simulation",
    "repeat": "swarmwire.deploy.repetition",
    "run": "swarmwire.deploy.running",
}  # all else is part of a result


def __getattr__(name: str) -> Any:
    """Imports on first use: `swarmwire --help` must not wait for compilers, physics and zenoh."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_PLACES.get(name, "swarmwire.deploy.result")), name)


def __dir__() -> list[str]:
    return __all__
