"""Run a campaign, or what is missing of it: many seeds at each point of a design, kept as a table of all runs."""

from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Protocol, cast

from swarmwire.comms.base.atomic import folder_lock
from swarmwire.comms.base.clock import WallClock
from swarmwire.comms.base.errors import BadInput
from swarmwire.deploy.campaigns.design import GRID, Point, vary_from
from swarmwire.deploy.campaigns.schedule import LOCAL, Executor, Keep, execute, open_executor, tasks_of
from swarmwire.deploy.campaigns.spec import Plan, SweepSpec, overrides_of, plan_of
from swarmwire.deploy.campaigns.store import CampaignWriter, new_folder
from swarmwire.deploy.campaigns.worker import Task, TaskResult
from swarmwire.deploy.runs.config import SeedsOption, seed_list
from swarmwire.deploy.runs.controls import Interrupt
from swarmwire.deploy.runs.record.folder import stamped_folder
from swarmwire.deploy.runs.record.provenance import (
    Copies,
    changed_files,
    changes_since,
    copied_mapping,
    copy_scenario,
    cpu,
    module_digests,
    versions,
)
from swarmwire.metrics.records.campaign.campaign_json import (
    FAILED,
    SCENARIO_FOLDER,
    Campaign,
    Design,
    Provenance,
    read_campaign,
    write_campaign,
)
from swarmwire.metrics.records.run_folder.layout import CopiedFile
from swarmwire.world.scenario.scenario import Scenario

SAME = ("files", "overrides", "design", "seeds", "vary", "points")  # of a plan and of the campaign that it resumes


def default_folder(scenario: str) -> Path:
    """campaigns/<scenario>-<UTC>, as `stamped_folder` has it."""
    return stamped_folder(Path("campaigns") / scenario)


def begin(plan: Plan, folder: Path, command: str) -> Campaign:
    """Make the folder, put into it all that its runs are made from, and `campaign.json` last.

    BadInput unless the folder is new or empty, and can be made.
    """
    with new_folder(folder, "campaign") as scenario_folder:
        campaign = campaign_of(plan, scenario_folder, command)
        write_campaign(campaign, folder)
    return campaign


def campaign_of(plan: Plan, scenario_folder: Path, command: str) -> Campaign:
    """The campaign of a plan, with its scenario and all its files copied into this folder, which is empty."""
    spec, scenario = plan.spec, plan.scenario
    copies = Copies(scenario_folder)
    point_overrides = tuple(tuple(copied_overrides(plan, point, copies)) for point in plan.points)
    return Campaign(
        **provenance(scenario, command, plan.code, copy_scenario(scenario, spec.seeds, scenario_folder, copies)),
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
    )


def provenance(
    scenario: Scenario, command: str, code: tuple[str, ...], files: tuple[CopiedFile, ...]
) -> dict[str, Any]:
    """The fields of `Provenance`, as they are now; `code` are the specs of users' classes."""
    return {
        "scenario": scenario.name,
        "command": command,
        "began_utc": WallClock().utc_stamp(),
        "versions": versions(),
        "cpu": cpu(),
        "modules": module_digests(code),
        "files": files,
    }


def copied_overrides(plan: Plan, point: Point, copies: Copies) -> list[str]:
    """The values of a point for the copied scenario: a file that one names is named, and copied, as there."""
    if not any(isinstance(value, str | list) for value in point.values()):
        return overrides_of(point)
    copied = copied_mapping(plan.at(point), copies)
    return overrides_of({path: _value_at(copied, path) for path in point})


def _value_at(mapping: Mapping[str, Any], path: str) -> Any:
    at: Any = mapping
    for key in path.split("."):
        at = cast("list[Any]", at)[int(key)] if isinstance(at, list) else at[key]
    return at


def check_resumable(begun: Provenance, folder: Path, *, force: bool) -> None:
    """BadInput if the scenario's files, or, unless `force`, code, versions or CPU are not as at the beginning."""
    changed = changed_files(begun.files, folder / SCENARIO_FOLDER)
    if changed:
        raise BadInput(f"--resume {folder}", "", f"{SCENARIO_FOLDER}/{changed[0]}")
    changed = [] if force else code_changes(begun)
    if changed:
        more = f" (and {len(changed) - 1} more)" if len(changed) > 1 else ""
        expected = f"{changed[0]}{more}: runs would not be comparable; --force resumes all the same"
        raise BadInput(f"--resume {folder}", "", expected)


def code_changes(begun: Provenance) -> list[str]:
    """Code, versions and CPU that are not as at the beginning, a line each."""
    return changes_since(begun.modules, begun.versions, begun.cpu, [f"{module}:" for module in begun.modules])


def check_same(plan: Plan, campaign: Campaign, folder: Path) -> None:
    """BadInput if a plan is for another campaign than that of the folder."""
    with TemporaryDirectory() as aside:
        planned = campaign_of(plan, Path(aside), "")
    for name in SAME:
        if _plain(planned, name) != _plain(campaign, name):
            what = "another scenario" if name == "files" else f"other {name}"
            expected = f"the campaign in the folder has {what}; use --resume alone to continue it"
            raise BadInput(f"--resume {folder}", name, expected)


def _plain(campaign: Campaign, name: str) -> Any:
    """A field as JSON would keep it: lists and tuples are the same."""
    found: Any = getattr(campaign, name)
    return list(cast("tuple[Any, ...]", found)) if isinstance(found, tuple) else found


class CampaignObserver(Protocol):
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
    observer: CampaignObserver = field(default_factory=NoObserver)
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
    executor: str = LOCAL,
    workers: int | None = None,
    observer: CampaignObserver | None = None,
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
        record_seeds=seed_list(record_seeds, "record_seeds") if record_seeds else (),
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
    observer: CampaignObserver | None = None,
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
        folder = CampaignWriter(path, begin(plan, path, command))
        with folder_lock(path, "campaign"):
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
    folder = CampaignWriter(path, campaign)
    with _executor(options, path) as executor, folder_lock(path, "campaign"):
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


def _work(folder: CampaignWriter, ended: dict[int, str], executor: Executor, options: ExecutionOptions) -> Sweep:
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
            if _done(tasks, executor, keep, lambda: interrupt.requested):
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
