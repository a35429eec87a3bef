"""The tasks of a campaign, the interface of executors, executors by name, and the schedule.

`--executor local` is a pool of worker processes of this machine, `--executor dask://HOST:PORT` a dask cluster. Packages
add others as entry points of the group `swarmwire.executors`: the name is the part before `://`, the value a function
like `open_executor` below.
"""

from collections import deque
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, cast

from swarmwire.comms.base.config import did_you_mean
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.base.extras import CLUSTER
from swarmwire.comms.base.plugins import entry_points_of
from swarmwire.deploy.campaigns.store import CampaignWriter
from swarmwire.deploy.campaigns.worker import Task, TaskResult, lost_task
from swarmwire.metrics.records.campaign.campaign_json import Campaign

GROUP = "swarmwire.executors"
OPTION = "executor"
LOCAL = "local"
DASK = "dask"

MAX_BATCH = 250  # arenas in a world; with ten robots each, 125 arenas cost 10 % more per run, 50 arenas 50 % more
LONG_BATCH = 50  # smallest limit, for long runs: a killed campaign loses its unfinished tasks
BATCH_S = 30_000  # simulated time over all arenas of a batch, above which its limit is below MAX_BATCH
MAX_ROBOTS = 5_000  # robots in a world of several arenas; larger batches save no time and need much memory
MIN_ROUNDS = 2  # smallest number of tasks per worker, so that no worker idles for long at the end
POLL_S = 0.1  # longest time until a request to stop is seen
OnResult = Callable[[Task, TaskResult], None]


@dataclass(frozen=True)
class Finished:
    """A task that has ended."""

    task: Task
    result: TaskResult | None  # None: workers died of the task
    lost: str = ""  # the workers' end in words: "the worker died, signal 9"


class Executor(Protocol):
    """Executes tasks, and returns each once, when it has ended or is lost.

    Each task is executed by `worker.run_task(task, name)`, in a process that may be ended at any time. An executor
    retries the task of a worker that died, on another worker, before it returns the task as lost.
    """

    @property
    def slots(self) -> int:
        """Largest useful number of submitted tasks that have not ended."""
        ...

    @property
    def records(self) -> bool:
        """True if workers can write run folders at paths of this machine; else they get no `Task.record_to`."""
        ...

    def submit(self, task: Task) -> None:
        """Accept a task; SwarmwireError if no worker is available."""
        ...

    def finished(self, timeout_s: float) -> list[Finished]:
        """Return the tasks that have ended since the last call; wait for the first, at most `timeout_s`.

        SwarmwireError if no task can end any more.
        """
        ...

    def close(self) -> None:
        """End all work on this campaign at once."""
        ...


OpenExecutor = Callable[[str, int | None, Path], Executor]
"""Opens an executor by the text of `--executor`, the number of workers (None: chosen by the executor) and the path of
the campaign's scenario folder; BadInput names `--executor`, `--workers`."""


def open_executor(name: str, workers: int | None, scenario: Path) -> Executor:
    """Open the executor of this name; BadInput for an unknown name. Raises the errors of its `OpenExecutor`."""
    if workers is not None and workers < 1:
        raise BadInput("workers", "", f"expected at least 1, got {workers}")
    scheme = name.partition("://")[0]
    if scheme == LOCAL:
        from swarmwire.deploy.campaigns.local import LocalExecutor

        return LocalExecutor(workers)
    if scheme == DASK:
        CLUSTER.need(OPTION)
        from swarmwire.deploy.campaigns.dask import DaskExecutor

        return DaskExecutor(name, workers, scenario)
    others = {point.name: point for point in entry_points_of(GROUP)}
    if scheme not in others:
        raise BadInput(OPTION, "", f"expected {did_you_mean([LOCAL, DASK, *others], scheme)}; got {name!r}")
    return cast("OpenExecutor", others[scheme].load())(name, workers, scenario)


def tasks_of(
    campaign: Campaign, folder: CampaignWriter, done: Collection[int], batch: int | None, workers: int
) -> list[Task]:
    """Return a task for each batch of runs that are not `done`; each recorded run has a separate task.

    Tasks are in the order of points; in real time in that of seeds, so that a campaign that ends early has equally many
    runs of each point.
    """
    seeds, tasks = len(campaign.seeds), list[Task]()
    size = 1 if campaign.realtime else batch or campaign.batch or default_batch(campaign, workers)
    for point in range(len(campaign.points)):
        missing = [run for run in range(point * seeds, (point + 1) * seeds) if run not in done]
        recorded = [run for run in missing if campaign.seed_of(run) in campaign.record_seeds]
        batched = [run for run in missing if campaign.seed_of(run) not in campaign.record_seeds]
        tasks += [_task(campaign, folder, point, [run], recorded=True) for run in recorded]
        tasks += [_task(campaign, folder, point, runs, recorded=False) for runs in shares(batched, size)]
    return sorted(tasks, key=lambda task: task.runs[0] % seeds) if campaign.realtime else tasks


def default_batch(campaign: Campaign, workers: int) -> int:
    """Return the largest number of arenas in a world, without `--batch` and a limit of the campaign."""
    limit = max(LONG_BATCH, int(BATCH_S / campaign.duration_s))
    return batch_for(len(campaign.points), len(campaign.seeds), campaign.robots, workers, limit)


def batch_for(points: int, seeds: int, robots: int, workers: int, limit: int = LONG_BATCH) -> int:
    """Return the largest number of arenas in a world, at most `limit`; `robots` is the number per arena."""
    limit = max(1, min(MAX_BATCH, limit, MAX_ROBOTS // robots))
    batches = max(-(-seeds // limit), -(-MIN_ROUNDS * workers // points))  # batches per point
    return max(1, -(-seeds // batches))


def shares(runs: Sequence[int], size: int) -> Iterator[Sequence[int]]:
    """Yield shares of at most this size, whose sizes differ by one run at most."""
    count = -(-len(runs) // size)
    for share in range(count):
        yield runs[len(runs) * share // count : len(runs) * (share + 1) // count]


def _task(campaign: Campaign, folder: CampaignWriter, point: int, runs: Sequence[int], *, recorded: bool) -> Task:
    return Task(
        scenario=str(folder.scenario),
        overrides=campaign.point_overrides[point],
        point=point,
        runs=tuple(runs),
        seeds=tuple(campaign.seed_of(run) for run in runs),
        series=campaign.series,
        record_to=str(folder.run_folder(runs[0])) if recorded else None,
        realtime=campaign.realtime,
        max_late=campaign.max_late,
    )


def execute(
    tasks: Iterable[Task], executor: Executor, on_result: OnResult, stopped: Callable[[], bool] = lambda: False
) -> bool:
    """Execute all tasks and call `on_result` for each, in any order; return False if `stopped()` before the end.

    A task of which workers die is split in two until the run of which they die is alone: that run gets a failed row.
    Errors of `on_result` and of the executor are passed on. The executor stays open.
    """
    queue, submitted = deque(tasks), 0
    while queue or submitted:
        if stopped():
            return False
        while queue and submitted < executor.slots:
            executor.submit(queue.popleft())
            submitted += 1
        for ended in executor.finished(POLL_S):
            submitted -= 1
            if ended.result is not None:
                on_result(ended.task, ended.result)
            elif len(ended.task.runs) > 1:
                queue.extendleft(ended.task.split())
            else:
                on_result(ended.task, lost_task(ended.task, ended.lost))
    return True
