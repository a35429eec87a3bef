"""Run a campaign, or what is missing of it: many seeds at each point of a design, kept as a table of all runs."""

from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

from swarmwire.deploy.campaign.design import GRID, vary_from
from swarmwire.deploy.campaign.schedule import LOCAL, Executor, Keep, execute, open_executor, tasks_of
from swarmwire.deploy.campaign.spec import Plan, SweepSpec, plan_of
from swarmwire.deploy.campaign.start import begin, check_resumable, check_same, default_folder
from swarmwire.deploy.campaign.store import CampaignFolder, locked
from swarmwire.deploy.campaign.worker import Task, TaskResult
from swarmwire.deploy.config import SeedsGiven, seed_list
from swarmwire.deploy.controls import Interrupt
from swarmwire.metrics.campaign.spec import FAILED, SCENARIO_FOLDER, Campaign, read_campaign
from swarmwire.world.scenario.scenario import Scenario


class Observer(Protocol):
    """Sees the progress of a campaign, and shows it to people: nothing depends on it."""

    def begin(self, campaign: Campaign, done: int, failed: int) -> None:
        """Work begins; so many runs have rows already, of which so many failed."""
        ...

    def see(self, result: TaskResult) -> None:
        """A task is done and kept."""
        ...

    def end(self) -> None:
        """Work is over, however it ended."""
        ...


class NoObserver:
    """Shows nothing."""

    def begin(self, campaign: Campaign, done: int, failed: int) -> None:
        """Nothing."""

    def see(self, result: TaskResult) -> None:
        """Nothing."""

    def end(self) -> None:
        """Nothing."""


@dataclass(frozen=True)
class ExecutionOptions:
    """With what a campaign is run, and who looks on; its results do not depend on it."""

    executor: Executor | str = LOCAL  # by name, or one that is open, and stays so
    workers: int | None = None  # of an executor by name; None: one for each core
    batch: int | None = None  # arenas in a world; None: as the campaign says
    observer: Observer = field(default_factory=NoObserver)
    interrupt: Interrupt = field(default_factory=Interrupt)


@dataclass(frozen=True)
class Sweep:
    """How far a campaign has come."""

    folder: Path
    runs: int  # of the whole campaign
    done: int  # runs that have a row
    failed: int  # of these

    @property
    def is_over(self) -> bool:
        """Whether no run is missing, so that the table of all runs is there."""
        return self.done == self.runs


def sweep(
    scenario: Scenario | Path | str,
    *,
    seeds: SeedsGiven,
    vary: Mapping[str, Any] | None = None,
    design: str = GRID,
    points: int | None = None,
    design_seed: int = 1,
    overrides: Sequence[str] = (),
    out: Path | str | None = None,
    name: str | None = None,
    batch: int | None = None,
    series: bool = True,
    record_seeds: SeedsGiven = (),
    executor: str = LOCAL,
    workers: int | None = None,
    observer: Observer | None = None,
) -> Sweep:
    """Run a scenario at each point of a design with each seed, in worker processes, and keep a table of all runs.

    `seeds` are how many (9: 1 to 9), a list, or a text as for `--seeds`. `vary` gives, by path, a list of values, a
    table with from, to, count (and scale = "log"), or a text as for `--vary`. `design` is "grid", "list", or "random"
    and "latin" with so many `points` from ranges without count. `out` is a new or empty folder,
    campaigns/<scenario>-<UTC> by default. At most `batch` arenas are one world. With `series` each tick's metrics
    are kept, too; runs of `record_seeds` get run folders. Ctrl-C ends it; `resume` continues it.

    Raises BadInput for anything wrong with these, before anything is run, and StorageFailed when the disk is full. What
    a run raises is in its row.
    """
    varied = tuple(vary_from(path, given, f"vary {path}") for path, given in (vary or {}).items())
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
        record_seeds=seed_list(record_seeds, "--record-seeds") if record_seeds else (),
    )
    plan = plan_of(spec)
    folder = Path(out) if out is not None else default_folder(_stem(scenario))
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
    observer: Observer | None = None,
) -> Sweep:
    """Run what is missing of the campaign in this folder; with `retry_failed` also the runs that failed.

    Raises BadInput if the folder holds no campaign, its scenario's files have changed, or, unless `force`, the code,
    versions or CPU have; and what `sweep` raises.
    """
    options = ExecutionOptions(executor, workers, batch, observer or NoObserver())
    return resume_sweep(Path(folder), options, retry_failed=retry_failed, force=force)


def begin_sweep(plan: Plan, path: Path, command: str, options: ExecutionOptions) -> Sweep:
    """Make the folder of a campaign that was checked, and run it; `command` is kept with it."""
    with _executor(options, path) as executor:
        folder = CampaignFolder(path, begin(plan, path, command))
        with locked(path, "campaign"):
            return _work(folder, {}, executor, options)


def resume_sweep(
    path: Path,
    options: ExecutionOptions,
    *,
    retry_failed: bool = False,
    force: bool = False,
    plan: Plan | None = None,
) -> Sweep:
    """As `resume`; a `plan` must be that of the folder's campaign."""
    campaign = read_campaign(path)
    if plan is not None:
        check_same(plan, campaign, path)
    check_resumable(campaign, path, force=force)
    folder = CampaignFolder(path, campaign)
    with _executor(options, path) as executor, locked(path, "campaign"):
        folder.clear()
        ended = {run: how for run, how in folder.ended().items() if not (retry_failed and how == FAILED)}
        return _work(folder, ended, executor, options)


@contextmanager
def _executor(options: ExecutionOptions, path: Path) -> Generator[Executor]:
    if not isinstance(options.executor, str):
        yield options.executor
        return
    with closing(open_executor(options.executor, options.workers, path / SCENARIO_FOLDER)) as executor:
        yield executor


def _work(folder: CampaignFolder, ended: dict[int, str], executor: Executor, options: ExecutionOptions) -> Sweep:
    """Do all runs but those that have `ended`, and how, already; then make the table of all runs."""
    campaign, interrupt = folder.campaign, options.interrupt
    slots = executor.slots  # as they are now: workers may come and go
    tasks = tasks_of(campaign, folder, ended, options.batch, slots)

    def keep(_: Task, result: TaskResult) -> None:
        folder.keep(result)
        ended.update({row["run"]: row["ended"] for row in result.rows})
        options.observer.see(result)

    options.observer.begin(campaign, len(ended), _failed(ended))
    try:
        with interrupt:
            if _done(tasks, executor, keep, lambda: interrupt.asked):
                folder.finish(max(1, slots))
    finally:
        options.observer.end()
    return Sweep(folder.path, campaign.runs, len(ended), _failed(ended))


def _done(tasks: Sequence[Task], executor: Executor, keep: Keep, stopped: Callable[[], bool]) -> bool:
    """As `execute`; runs with run folders by workers of this machine, at the end, where the executor's cannot."""
    here = [task for task in tasks if task.record_to is not None and not executor.records]
    if not execute([task for task in tasks if task.record_to is None or executor.records], executor, keep, stopped):
        return False
    if not here:
        return True
    with closing(open_executor(LOCAL, None, Path(here[0].scenario).parent)) as local:
        return execute(here, local, keep, stopped)


def _failed(ended: Mapping[int, str]) -> int:
    return sum(how == FAILED for how in ended.values())


def _stem(scenario: Scenario | Path | str) -> str:
    """What the default folder is named after."""
    return "campaign" if isinstance(scenario, Scenario) else Path(scenario).stem
