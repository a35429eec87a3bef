"""The tasks of a campaign, and who works on them: the interface of executors, executors by name, and the schedule.

`--executor local` is a pool of worker processes of this machine, `--executor dask://HOST:PORT` a dask cluster. Others
come by entry points of the group `swarmwire.executors`: the name is the part before `://`, and leads to a function like
`open_executor` below.
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

MAX_BATCH = 250  # arenas in a world: of ten robots each, 125 cost a tenth more per run, 50 half as much again
LONG_BATCH = 50  # of runs so long that a task, lost as a whole where a campaign is killed, would be much work
BATCH_S = 30_000  # simulated, over all arenas: beyond, a batch has fewer than MAX_BATCH, down to that of long runs
MAX_ROBOTS = 5_000  # in a world of several arenas: from there on batches gain nothing, and memory is dear
ROUNDS = 2  # tasks for each worker at least, so that none is idle for long at the end
POLL_S = 0.1  # at most, until a wish to stop is seen
Keep = Callable[[Task, TaskResult], None]


@dataclass(frozen=True)
class Finished:
    """A task that is over."""

    task: Task
    result: TaskResult | None  # None: workers died of it
    lost: str = ""  # how, in words: "the worker died, signal 9"


class Executor(Protocol):
    """Takes tasks, and yields each once, when it is over or lost.

    Each task is done by `worker.run_task(task, name)`, in a process that may be ended at any time. An executor tries
    the task of a worker that died again, on another worker, before it yields it as lost.
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
        """Take a task; SwarmwireError if no worker is left to do it."""
        ...

    def finished(self, timeout_s: float) -> list[Finished]:
        """Tasks that are over since the last call; waits for the first, at most so long.

        SwarmwireError if none ever will be.
        """
        ...

    def close(self) -> None:
        """End all work on this campaign at once."""
        ...


OpenExecutor = Callable[[str, int | None, Path], Executor]
"""From the text of `--executor`, the number of workers (None: as many as make sense) and the path of the campaign's
scenario folder; BadInput names `--executor`, `--workers`."""


def open_executor(name: str, workers: int | None, scenario: Path) -> Executor:
    """The executor of this name; BadInput for an unknown one, and what its own opening raises."""
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
    """A task for each batch of runs that are not `done`; those that are recorded in full are on their own."""
    seeds, tasks = len(campaign.seeds), list[Task]()
    size = batch or campaign.batch or default_batch(campaign, workers)
    for point in range(len(campaign.points)):
        missing = [run for run in range(point * seeds, (point + 1) * seeds) if run not in done]
        recorded = [run for run in missing if campaign.seed_of(run) in campaign.record_seeds]
        together = [run for run in missing if campaign.seed_of(run) not in campaign.record_seeds]
        tasks += [_task(campaign, folder, point, [run], recorded=True) for run in recorded]
        tasks += [_task(campaign, folder, point, runs, recorded=False) for runs in shares(together, size)]
    return tasks


def default_batch(campaign: Campaign, workers: int) -> int:
    """How many arenas a world has at most, unless `--batch` or the campaign says."""
    most = max(LONG_BATCH, int(BATCH_S / campaign.duration_s))
    return batch_for(len(campaign.points), len(campaign.seeds), campaign.robots, workers, most)


def batch_for(points: int, seeds: int, robots: int, workers: int, most: int = LONG_BATCH) -> int:
    """The same, of so many points with so many seeds each, at most so many robots in an arena, and `most` arenas."""
    most = max(1, min(MAX_BATCH, most, MAX_ROBOTS // robots))
    batches = max(-(-seeds // most), -(-ROUNDS * workers // points))  # of each point
    return max(1, -(-seeds // batches))


def shares(runs: Sequence[int], size: int) -> Iterator[Sequence[int]]:
    """Shares of at most this size, which differ by one run at most."""
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
    )


def execute(tasks: Iterable[Task], executor: Executor, keep: Keep, stopped: Callable[[], bool] = lambda: False) -> bool:
    """Have all tasks done, `keep` each as it is finished, in any order; False if `stopped()` before the end.

    A task of which workers die is split in two until the run of which they die is alone: that is a failed row. What
    `keep` and the executor raise is passed on. The executor is left open.
    """
    waiting, under_way = deque(tasks), 0
    while waiting or under_way:
        if stopped():
            return False
        while waiting and under_way < executor.slots:
            executor.submit(waiting.popleft())
            under_way += 1
        for done in executor.finished(POLL_S):
            under_way -= 1
            if done.result is not None:
                keep(done.task, done.result)
            elif len(done.task.runs) > 1:
                waiting.extendleft(done.task.split())
            else:
                keep(done.task, lost_task(done.task, done.lost))
    return True
