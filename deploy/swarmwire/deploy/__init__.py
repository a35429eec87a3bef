"""Where things run, from Python as from the command line.

`run` a scenario, step a `Simulation`, `repeat` a run; `sweep` a campaign of many runs, and `resume` it.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from swarmwire.deploy.kernel_cache import keep_kernels

if TYPE_CHECKING:
    from swarmwire.deploy.campaign.sweep import Sweep, resume, sweep
    from swarmwire.deploy.gateways.gateways import Gateways
    from swarmwire.deploy.listening import Listening
    from swarmwire.deploy.record.recording import Recording
    from swarmwire.deploy.repetition import Repetition, repeat
    from swarmwire.deploy.result import ArenaResult, Percentiles, RadioResult, Result, Statistics
    from swarmwire.deploy.running import run
    from swarmwire.deploy.simulation import Simulation
    from swarmwire.metrics.run_folder.reader import RunFolder

__all__ = [
    "ArenaResult",
    "Gateways",
    "Listening",
    "Percentiles",
    "RadioResult",
    "Recording",
    "Repetition",
    "Result",
    "RunFolder",
    "Simulation",
    "Statistics",
    "Sweep",
    "repeat",
    "resume",
    "run",
    "sweep",
]

_PLACES = {
    "Gateways": "swarmwire.deploy.gateways.gateways",
    "Listening": "swarmwire.deploy.listening",
    "Recording": "swarmwire.deploy.record.recording",
    "Repetition": "swarmwire.deploy.repetition",
    "RunFolder": "swarmwire.metrics.run_folder.reader",
    "Simulation": "swarmwire.deploy.simulation",
    "Sweep": "swarmwire.deploy.campaign.sweep",
    "repeat": "swarmwire.deploy.repetition",
    "resume": "swarmwire.deploy.campaign.sweep",
    "run": "swarmwire.deploy.running",
    "sweep": "swarmwire.deploy.campaign.sweep",
}  # all else is part of a result

keep_kernels()


def __getattr__(name: str) -> Any:
    """Imports on first use: `swarmwire --help` must not wait for compilers, physics and zenoh."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_PLACES.get(name, "swarmwire.deploy.result")), name)


def __dir__() -> list[str]:
    return __all__
