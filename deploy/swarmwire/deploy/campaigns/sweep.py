"""Execution of a campaign, or of its missing runs: many seeds at each point of a design, with a table of all runs."""

from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Protocol, cast

from swarmwire.comms.base.atomic import folder_lock
from swarmwire.comms.base.errors import BadInput
from swarmwire.deploy.campaigns.design import GRID, vary_from
from swarmwire.deploy.campaigns.folder import check_resumable, copied_overrides, new_folder, provenance
from swarmwire.deploy.campaigns.local import usable_cores
from swarmwire.deploy.campaigns.schedule import LOCAL, Executor, OnResult, execute, open_executor, tasks_of
from swarmwire.deploy.campaigns.spec import MAX_LATE, CampaignPlan, SweepSpec, plan_of
from swarmwire.deploy.campaigns.store import CampaignWriter
from swarmwire.deploy.campaigns.worker import Task, TaskResult
from swarmwire.deploy.runs.config import SeedsOption, parse_factor, seed_list
from swarmwire.deploy.runs.controls import Interrupt
from swarmwire.deploy.runs.record.folder import short_name, stamped_folder
from swarmwire.deploy.runs.record.provenance import Copies
from swarmwire.metrics.records.campaign.campaign_json import (
    FAILED,
    SCENARIO_FOLDER,
    Campaign,
    Design,
    read_campaign,
    write_campaign,
)
from swarmwire.world.scenario.scenario import Scenario

CAMPAIGNS = "campaigns"  # default folder of campaigns
CORES_PER_RUN = 2  # in real time: one for the world, one for its programs
# Fields that must be equal in a plan and in the campaign that it resumes.
COMPARED_FIELDS = ("files", "overrides", "design", "seeds", "vary", "points", "realtime")


def campaign_of(plan: CampaignPlan, scenario_folder: Path, command: str) -> Campaign:
    """Return the campaign of a plan; copy its scenario and all its files into the empty `scenario_folder`."""
    spec, scenario = plan.spec, plan.scenario
    copies = Copies(scenario_folder)
    point_overrides = tuple(tuple(copied_overrides(plan, point, copies)) for point in plan.points)
    return Campaign(
        **provenance(scenario, spec.seeds, command, plan.code, copies),
        name=spec.name or scenario.name,
        design=cast("Design", spec.design),  # `points_of` has checked it
        seeds=spec.seeds,
        vary=plan.vary(),
        points=plan.points,
        overrides=spec.overrides,
        point_overrides=point_overrides,
        duration_s=scenario.duration_s,
        robots=plan.robots,
        responses=plan.responses,
        series=spec.series,
        record_seeds=spec.record_seeds,
        batch=spec.batch,
        realtime=parse_factor(spec.realtime),
        max_late=spec.max_late,
    )


def check_same(plan: CampaignPlan, campaign: Campaign, folder: Path) -> None:
    """Raise BadInput if a plan is for another campaign than that of the folder."""
    with TemporaryDirectory() as temporary:
        planned = campaign_of(plan, Path(temporary), "")
    for name in COMPARED_FIELDS:
        if _plain(planned, name) != _plain(campaign, name):
            change = "another scenario" if name == "files" else f"other {name}"
            expected = f"the campaign in the folder has {change}; use --resume alone to continue it"
            raise BadInput(f"--resume {folder}", name, expected)


def _plain(campaign: Campaign, name: str) -> Any:
    """Return a field with tuples as lists, as read from JSON."""
    value: Any = getattr(campaign, name)
    return list(cast("tuple[Any, ...]", value)) if isinstance(value, tuple) else value


class CampaignObserver(Protocol):
    """Shows the progress of a campaign to people; results do not depend on it."""

    def begin(self, campaign: Campaign, done: int, failed: int) -> None:
        """Show the start; `done` runs have rows already, of which `failed` failed."""
        ...

    def see(self, result: TaskResult) -> None:
        """Show a task that has ended and is written."""
        ...

    def end(self) -> None:
        """Show the end, also after an error."""
        ...


class NoObserver:
    """Shows nothing."""

    def begin(self, campaign: Campaign, done: int, failed: int) -> None:
        """Do nothing."""

    def see(self, result: TaskResult) -> None:
        """Do nothing."""

    def end(self) -> None:
        """Do nothing."""


@dataclass(frozen=True)
class ExecutionOptions:
    """Options of the execution, on which a campaign's results do not depend."""

    executor: Executor | str = LOCAL  # a name, or an open executor, which stays open
    workers: int | None = None  # workers of an executor by name; None: one for each core
    batch: int | None = None  # arenas in a world; None: the campaign's
    observer: CampaignObserver = field(default_factory=NoObserver)
    interrupt: Interrupt = field(default_factory=Interrupt)


@dataclass(frozen=True)
class Sweep:
    """Progress of a campaign."""

    folder: Path
    runs: int  #: runs of the campaign
    done: int  #: runs that have a row
    failed: int  #: failed runs among them

    @property
    def is_over(self) -> bool:
        """True if no run is missing, so the table of all runs is written."""
        return self.done == self.runs


def sweep(
    scenario: Scenario | Path | str,
    *,
    seeds: SeedsOption,
    vary: Mapping[str, Any] | None = None,
    design: str = GRID,
    points: int | None = None,
    design_seed: int = 1,
    overrides: Sequence[str] = (),
    out: Path | str | None = None,
    name: str | None = None,
    batch: int | None = None,
    series: bool = True,
    record_seeds: SeedsOption = (),
    realtime: float | None = None,
    max_late: float = MAX_LATE,
    executor: str = LOCAL,
    workers: int | None = None,
    observer: CampaignObserver | None = None,
) -> Sweep:
    """Run a scenario at each point of a design with each seed, in worker processes, and write a table of all runs.

    `seeds` is a number (9: 1 to 9), a list, or a text as for `--seeds`. `vary` has, by path, a list of values, a table
    with from, to, count (and scale = "log"), or a text as for `--vary`. `design` is "grid", "list", or "random" or
    "latin", which draw `points` points from ranges without count. `out` is a new or empty folder, by default
    campaigns/<scenario>-<UTC>. At most `batch` arenas form a world. With `series` each tick's metrics are recorded,
    too; runs of `record_seeds` get run folders. Ctrl-C ends the campaign; `resume` continues it.

    With `realtime`, simulated seconds per second of wall time, agents and programs on network interfaces run by the
    clock: each run has a world of its own, and fails if a share above `max_late` of its frames or ticks was late.

    Raises BadInput for invalid arguments, before the first run, and StorageFailed if the disk is full. An exception of
    a run is in its row.
    """
    varied = tuple(vary_from(path, values, f"vary {path}") for path, values in (vary or {}).items())
    spec = SweepSpec(
        scenario=scenario,
        seeds=seed_list(seeds),
        varied=varied,
        design=design,
        points=points,
        design_seed=design_seed,
        overrides=tuple(overrides),
        name=name,
        batch=batch,
        series=series,
        record_seeds=seed_list(record_seeds, "record_seeds") if record_seeds else (),
        realtime=realtime,
        max_late=max_late,
    )
    plan = plan_of(spec)
    folder = Path(out) if out is not None else stamped_folder(Path(CAMPAIGNS, _stem(scenario)))
    options = ExecutionOptions(executor, workers, observer=observer or NoObserver())
    return begin_sweep(plan, folder, "swarmwire.deploy.sweep", options)


def resume(
    folder: Path | str,
    *,
    retry_failed: bool = False,
    force: bool = False,
    batch: int | None = None,
    executor: str = LOCAL,
    workers: int | None = None,
    observer: CampaignObserver | None = None,
) -> Sweep:
    """Run the missing runs of the campaign in this folder; with `retry_failed` also the failed runs.

    Raises BadInput if the folder has no campaign, its scenario's files have changed, or, unless `force`, the code,
    versions or CPU have; and the errors of `sweep`.
    """
    options = ExecutionOptions(executor, workers, batch, observer or NoObserver())
    return resume_sweep(Path(folder), options, retry_failed=retry_failed, force=force)


def begin_sweep(plan: CampaignPlan, path: Path, command: str, options: ExecutionOptions) -> Sweep:
    """Make the folder of a checked campaign, and run it; `command` is recorded in it."""
    with _executor(options, path, parse_factor(plan.spec.realtime)) as executor:
        with new_folder(path, "campaign") as scenario_folder:
            campaign = campaign_of(plan, scenario_folder, command)
            write_campaign(campaign, path)  # last: the folder has all files of the scenario by then
        with folder_lock(path, "campaign"):
            return _work(CampaignWriter(path, campaign), {}, executor, options)


def resume_sweep(
    path: Path,
    options: ExecutionOptions,
    *,
    retry_failed: bool = False,
    force: bool = False,
    plan: CampaignPlan | None = None,
) -> Sweep:
    """Implement `resume`; a `plan` must be that of the folder's campaign."""
    campaign = read_campaign(path)
    if plan is not None:
        check_same(plan, campaign, path)
    check_resumable(campaign, path, force=force)
    folder = CampaignWriter(path, campaign)
    with _executor(options, path, campaign.realtime) as executor, folder_lock(path, "campaign"):
        folder.clear()
        ended = {run: how for run, how in folder.ended().items() if not (retry_failed and how == FAILED)}
        return _work(folder, ended, executor, options)


@contextmanager
def _executor(options: ExecutionOptions, path: Path, realtime: float | None) -> Generator[Executor]:
    if not isinstance(options.executor, str):
        yield options.executor
        return
    workers = options.workers
    if realtime:
        if options.executor != LOCAL:
            expected = f"expected {LOCAL} in real time: other workers' machines may be busy, or without rights"
            raise BadInput("executor", "", f"{expected}; got {options.executor!r}")
        workers = workers or max(1, usable_cores() // CORES_PER_RUN)
    with closing(open_executor(options.executor, workers, path / SCENARIO_FOLDER)) as executor:
        yield executor


def _work(folder: CampaignWriter, ended: dict[int, str], executor: Executor, options: ExecutionOptions) -> Sweep:
    """Execute all runs that are not in `ended` (run: its end); then write the table of all runs."""
    campaign, interrupt = folder.campaign, options.interrupt
    slots = executor.slots  # read once, since workers may come and go
    tasks = tasks_of(campaign, folder, ended, options.batch, slots)

    def on_result(_: Task, result: TaskResult) -> None:
        folder.write(result)
        ended.update({row["run"]: row["ended"] for row in result.rows})
        options.observer.see(result)

    options.observer.begin(campaign, len(ended), _failed(ended))
    try:
        with interrupt:
            if _execute(tasks, executor, on_result, lambda: interrupt.requested):
                folder.finish(max(1, slots))
    finally:
        options.observer.end()
    return Sweep(folder.path, campaign.runs, len(ended), _failed(ended))


def _execute(tasks: Sequence[Task], executor: Executor, on_result: OnResult, stopped: Callable[[], bool]) -> bool:
    """Call `execute`; workers of this machine execute recorded runs at the end if the executor cannot record them."""
    local_tasks = [task for task in tasks if task.record_to is not None and not executor.records]
    other_tasks = [task for task in tasks if task.record_to is None or executor.records]
    if not execute(other_tasks, executor, on_result, stopped):
        return False
    if not local_tasks:
        return True
    with closing(open_executor(LOCAL, None, Path(local_tasks[0].scenario).parent)) as local:
        return execute(local_tasks, local, on_result, stopped)


def _failed(ended: Mapping[int, str]) -> int:
    return sum(how == FAILED for how in ended.values())


def _stem(scenario: Scenario | Path | str) -> str:
    """Return the first part of the default folder's name."""
    return "campaign" if isinstance(scenario, Scenario) else short_name(Path(scenario))
