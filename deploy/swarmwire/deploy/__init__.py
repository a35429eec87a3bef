"""Execution of scenarios, from Python and from the command line.

`run` a scenario, step a `Simulation`, `repeat` a run; `sweep` a campaign of many runs, and `resume` it; check the
results by `expect`.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from swarmwire.deploy.machine import keep_kernels

if TYPE_CHECKING:
    from swarmwire.deploy.campaigns.expecting import NotMet, expect
    from swarmwire.deploy.campaigns.repetition import Repetition, repeat
    from swarmwire.deploy.campaigns.sweep import Sweep, resume, sweep
    from swarmwire.deploy.runs.config import Listening, Recording, RunConfig
    from swarmwire.deploy.runs.gateways.gateways import Gateways
    from swarmwire.deploy.runs.record.provenance import RunFacts
    from swarmwire.deploy.runs.result import ArenaResult, Percentiles, RadioResult, Result, Statistics
    from swarmwire.deploy.runs.simulation import Simulation, run
    from swarmwire.metrics.records.campaign.expectations import Verdict
    from swarmwire.metrics.records.run_folder.reader import RunFolder

__all__ = [
    "ArenaResult",
    "Gateways",
    "Listening",
    "NotMet",
    "Percentiles",
    "RadioResult",
    "Recording",
    "Repetition",
    "Result",
    "RunConfig",
    "RunFacts",
    "RunFolder",
    "Simulation",
    "Statistics",
    "Sweep",
    "Verdict",
    "expect",
    "repeat",
    "resume",
    "run",
    "sweep",
]

_MODULES = {
    "Gateways": "swarmwire.deploy.runs.gateways.gateways",
    "Listening": "swarmwire.deploy.runs.config",
    "NotMet": "swarmwire.deploy.campaigns.expecting",
    "Recording": "swarmwire.deploy.runs.config",
    "Repetition": "swarmwire.deploy.campaigns.repetition",
    "RunConfig": "swarmwire.deploy.runs.config",
    "RunFacts": "swarmwire.deploy.runs.record.provenance",
    "RunFolder": "swarmwire.metrics.records.run_folder.reader",
    "Simulation": "swarmwire.deploy.runs.simulation",
    "Sweep": "swarmwire.deploy.campaigns.sweep",
    "Verdict": "swarmwire.metrics.records.campaign.expectations",
    "expect": "swarmwire.deploy.campaigns.expecting",
    "repeat": "swarmwire.deploy.campaigns.repetition",
    "resume": "swarmwire.deploy.campaigns.sweep",
    "run": "swarmwire.deploy.runs.simulation",
    "sweep": "swarmwire.deploy.campaigns.sweep",
}  # all other names are in the module of results

keep_kernels()


def __getattr__(name: str) -> Any:
    """Import a name on first use, so that `swarmwire --help` does not wait for compilers, physics and zenoh."""
    if name == "__version__":
        from importlib.metadata import version

        return version("swarmwire-deploy")
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_MODULES.get(name, "swarmwire.deploy.runs.result")), name)


def __dir__() -> list[str]:
    return __all__
