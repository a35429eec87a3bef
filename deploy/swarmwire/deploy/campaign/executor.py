"""Who works on the tasks of a campaign: the interface, and executors by name.

`--on local` is a pool of worker processes of this machine, `--on dask://HOST:PORT` a dask cluster. Others come by entry
points of the group `swarmwire.executors`: a name is what stands before `://` in `--on`, and leads to a function like
`open_executor` below.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, cast

from swarmwire.comms.config import did_you_mean
from swarmwire.comms.errors import BadInput
from swarmwire.comms.extras import CLUSTER
from swarmwire.comms.plugins import entry_points_of
from swarmwire.deploy.campaign.task import Task, TaskResult

GROUP = "swarmwire.executors"
LOCAL = "local"
DASK = "dask"


@dataclass(frozen=True)
class Finished:
    """A task that is over."""

    task: Task
    result: TaskResult | None  # None: the worker died, or its machine went away
    lost: str = ""  # how, in words: "the worker died, signal 9"


class Executor(Protocol):
    """Takes tasks, and yields each once, when it is over or lost; tries nothing twice by itself.

    Each task is done by `run_task.run_task(task, worker)`, in a process that may be ended at any time.
    """

    @property
    def slots(self) -> int:
        """How many tasks are worth having in hand at a time: no more are submitted before some are finished."""
        ...

    @property
    def records(self) -> bool:
        """Whether workers can write run folders at paths of this machine; else they get no `Task.record_to`."""
        ...

    def submit(self, task: Task) -> None:
        """Take a task; SwarmwireError if there is nobody any more to do it."""
        ...

    def finished(self, timeout_s: float) -> list[Finished]:
        """What is over since the last call; waits for the first, at most so long. SwarmwireError if none ever will."""
        ...

    def close(self) -> None:
        """End all workers that belong to this campaign at once, whatever they are at."""
        ...


OpenExecutor = Callable[[str, int | None, Path], Executor]
"""From what `--on` says, the number of workers (None: as many as make sense) and the path of the campaign's scenario
folder; BadInput names `--on`, `--workers`."""


def open_executor(on: str, workers: int | None, scenario: Path) -> Executor:
    """The executor that `on` names; BadInput for an unknown name, and whatever its own opening raises."""
    if workers is not None and workers < 1:
        raise BadInput("--workers", "", f"expected at least 1, got {workers}")
    name = on.partition("://")[0]
    if name == LOCAL:
        from swarmwire.deploy.campaign.local_executor import LocalExecutor

        return LocalExecutor(workers)
    if name == DASK:
        return _open_dask(on, workers, scenario)
    others = {point.name: point for point in entry_points_of(GROUP)}
    if name not in others:
        raise BadInput("--on", "", f"expected {did_you_mean([LOCAL, DASK, *others], name)}; got {on!r}")
    opener = cast("OpenExecutor", others[name].load())
    return opener(on, workers, scenario)


def _open_dask(on: str, workers: int | None, scenario: Path) -> Executor:
    CLUSTER.need("--on")
    from swarmwire.deploy.campaign.dask_executor import DaskExecutor

    return DaskExecutor(on, workers, scenario)
