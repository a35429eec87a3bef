"""A tuning from its beginning, or resumed, to the check of its best trial: parallel trials, each with all seeds."""

import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from io import BytesIO
from pathlib import Path
from typing import Protocol

from swarmwire.comms.base.atomic import folder_lock, write_bytes
from swarmwire.comms.base.errors import BadInput, SwarmwireError
from swarmwire.deploy.campaigns.columns import Row
from swarmwire.deploy.campaigns.schedule import LOCAL, Executor, batch_for, execute, open_executor, shares
from swarmwire.deploy.campaigns.spec import Plan
from swarmwire.deploy.campaigns.store import new_folder, storing
from swarmwire.deploy.campaigns.sweep import CampaignObserver, check_resumable, copied_overrides, provenance
from swarmwire.deploy.campaigns.tuning.best import CheckRun, FreshCheck, best_of, write_best
from swarmwire.deploy.campaigns.tuning.spec import (
    Goal,
    Search,
    Tuning,
    TuningPlan,
    check_trials,
    read_tuning,
    sample_of,
    scenario_file,
    write_tuning,
)
from swarmwire.deploy.campaigns.tuning.study import StudyFile, TrialResult, TuningTrial, importance_of, proposals
from swarmwire.deploy.campaigns.worker import Task, TaskResult
from swarmwire.deploy.runs.controls import Interrupt
from swarmwire.deploy.runs.record.folder import stamped_folder
from swarmwire.deploy.runs.record.provenance import Copies, copy_scenario
from swarmwire.metrics.records.campaign.campaign_json import FAILED, SCENARIO_FOLDER
from swarmwire.metrics.records.run_folder.writer import PARQUET

FILE = "trials.parquet"


def default_tuning_folder(scenario: str) -> Path:
    """tunings/<scenario>-<UTC>, as `stamped_folder` has it."""
    return stamped_folder(Path("tunings") / scenario)


def begin_tuning(plan: TuningPlan, folder: Path, command: str) -> Tuning:
    """Make the folder, put into it all that its runs are made from, and `tuning.json` last.

    BadInput unless the folder is new or empty, and can be made.
    """
    with new_folder(folder, "tuning") as scenario_folder:
        tuning = _tuning_of(plan, scenario_folder, command)
        write_tuning(tuning, folder)
    return tuning


def _tuning_of(plan: TuningPlan, scenario_folder: Path, command: str) -> Tuning:
    spec, copies = plan.spec, Copies(scenario_folder)
    searches = [_copied(search, ends, copies) for search, ends in zip(plan.searches, plan.ends, strict=True)]
    return Tuning(
        **provenance(
            plan.scenario,
            command,
            plan.code,
            copy_scenario(plan.scenario, (plan.scenario.seed,), scenario_folder, copies),
        ),
        overrides=spec.overrides,
        searches=tuple(searches),
        goal=plan.goal,
        robots=max(ends.robots for ends in plan.ends),
        seeds=spec.seeds,
        check_seeds=spec.check_seeds,
        trials=spec.trials,
        parallel_trials=spec.parallel_trials,
        sampler_seed=spec.sampler_seed,
    )


def _copied(search: Search, ends: Plan, copies: Copies) -> Search:
    """A search whose choices name copies of the files that they named."""
    if not search.choices:
        return search
    return replace(search, overrides=tuple(copied_overrides(ends, point, copies)[0] for point in ends.points))


def write_trials(folder: Path, tuning: Tuning, trials: Sequence[TuningTrial]) -> None:
    """Rewrite the table of finished trials: number, state, a column for each path, the result.

    StorageFailed if the disk refuses.
    """
    import polars as pl

    rows = [
        {
            "trial": trial.number,
            "state": trial.state,
            **{search.path: trial.parameters[search.path] for search in tuning.searches},
            "value": trial.result.value,
            **trial.result.attributes(),
            "error": trial.result.error or None,
        }
        for trial in trials
    ]
    kinds = {
        "trial": "whole",
        "state": "text",
        **{search.path: _type(search) for search in tuning.searches},
        **dict.fromkeys(("value", "statistic", "censored"), "number"),
        **dict.fromkeys(("undefined", "failed"), "whole"),
        "error": "text",
    }
    types = {"whole": pl.Int64(), "text": pl.String(), "number": pl.Float64()}
    file = BytesIO()  # in memory first: what a full disk then says is an OSError
    pl.DataFrame(rows, {name: types[kind] for name, kind in kinds.items()}).write_parquet(file, **PARQUET)
    with storing(folder, "tune"):
        write_bytes(folder / FILE, file.getvalue())


def _type(search: Search) -> str:
    if search.choices:
        return "text"
    return "whole" if search.whole else "number"


class TrialObserver(Protocol):
    """Sees the progress of trials, and shows it to people: nothing depends on it."""

    def begin(self, tuning: Tuning, trials: Sequence[TuningTrial]) -> None:
        """Work begins; these trials are over already."""
        ...

    def see(self, trial: TuningTrial) -> None:
        """A trial is over and kept."""
        ...

    def end(self) -> None:
        """Work is over, however it ended."""
        ...


@dataclass(frozen=True)
class TrialsRun:
    """With what trials are run."""

    folder: Path
    tuning: Tuning
    study: StudyFile
    executor: Executor
    watcher: TrialObserver
    stopped: Callable[[], bool]

    def run(self) -> bool:
        """Run all that are missing; False if stopped before the end."""
        tuning = self.tuning
        for first in range(0, tuning.trials, tuning.parallel_trials):
            under_way = self._group(first)
            over = not under_way or self._done(under_way)
            write_trials(self.folder, tuning, self.study.over())
            if not over:
                return False
        return True

    def _group(self, first: int) -> list[TuningTrial]:
        """The parallel trials from this number on that are not over; begins those that were never begun."""
        end, there = min(first + self.tuning.parallel_trials, self.tuning.trials), len(self.study.frozen())
        if there < end:
            proposed = proposals(self.tuning, self.study.frozen()[:first])
            for number in range(max(first, there), end):
                self.study.begin(proposed[number - first])
        return [trial for trial in self.study.trials()[first:end] if not trial.is_over]

    def _done(self, trials: Sequence[TuningTrial]) -> bool:
        """Run these; each is kept as soon as all its seeds have been run. False if stopped before the end."""
        found: dict[int, list[Row]] = {trial.number: [] for trial in trials}

        def keep(task: Task, result: TaskResult) -> None:
            rows = found[task.point]
            rows += result.rows
            if len(rows) == len(self.tuning.seeds):
                rows.sort(key=lambda row: row["run"])
                self.watcher.see(self.study.finish(task.point, trial_result(rows, self.tuning.goal)))

        return execute(self._tasks(trials), self.executor, keep, self.stopped)

    def _tasks(self, trials: Sequence[TuningTrial]) -> list[Task]:
        tuning = self.tuning
        size = batch_for(len(trials), len(tuning.seeds), tuning.robots, self.executor.slots)
        return [
            Task(
                scenario=str(scenario_file(self.folder)),
                overrides=tuning.overrides_of(trial.parameters),
                point=trial.number,
                runs=tuple(places),
                seeds=tuple(tuning.seeds[place] for place in places),
                series=False,
            )
            for trial in trials
            for places in shares(range(len(tuning.seeds)), size)
        ]


def trial_result(rows: Sequence[Row], goal: Goal) -> TrialResult:
    """What a trial came to, by the rows of all its seeds; where one failed, the trial did.

    Without that seed it would not be compared with others on the same seeds.
    """
    failed = [row for row in rows if row["ended"] == FAILED]
    if failed:
        return TrialResult(failed=len(failed), error=str(failed[0]["error"]))
    reached = goal.reached(sample_of(rows, goal.response))
    if math.isnan(reached.value):
        return TrialResult(undefined=reached.undefined, error=f"no run has a value of {goal.response.column}")
    statistic = None if math.isnan(reached.statistic) else reached.statistic
    return TrialResult(reached.value, statistic, reached.censored, reached.undefined)


class NothingFound(SwarmwireError):
    """Every trial failed."""


@dataclass(frozen=True)
class TuneObservers:
    """Who looks on, and the wish to stop."""

    trials: TrialObserver
    check: CampaignObserver  # of the two campaigns at the end
    interrupt: Interrupt


@dataclass(frozen=True)
class Tuned:
    """How far a tuning has come."""

    folder: Path
    tuning: Tuning
    trials: tuple[TuningTrial, ...]  # that are over
    best: TuningTrial | None
    importance: Mapping[str, float]  # by path; empty where it is unknown
    check: FreshCheck | None  # None: interrupted before its end

    @property
    def is_over(self) -> bool:
        """Whether all was done."""
        return self.check is not None


def begin_tune(plan: TuningPlan, folder: Path, command: str, workers: int | None, observers: TuneObservers) -> Tuned:
    """Make the folder of a tuning that was checked, and run it; `command` is kept with it."""
    tuning = begin_tuning(plan, folder, command)
    with folder_lock(folder, "tuning"):
        return _work(folder, tuning, workers, observers)


def resume_tune(
    folder: Path, workers: int | None, observers: TuneObservers, *, trials: int | None = None, force: bool = False
) -> Tuned:
    """Run what is missing of the tuning in this folder, up to `trials` if given.

    Raises BadInput if the folder holds no tuning, has more trials, its scenario's files have changed, or, unless
    `force`, the code, versions or CPU have; StorageFailed when the disk is full; NothingFound when all trials failed.
    """
    tuning = read_tuning(folder)
    check_resumable(tuning, folder, force=force)
    with folder_lock(folder, "tuning"):
        if trials is not None and trials != tuning.trials:
            tuning = replace(tuning, trials=_more(trials, folder, tuning))
            with storing(folder, "tune"):
                write_tuning(tuning, folder)
        return _work(folder, tuning, workers, observers)


def _more(trials: int, folder: Path, tuning: Tuning) -> int:
    check_trials(trials)
    there = len(StudyFile(folder, tuning).frozen())
    if trials < there:
        raise BadInput("--trials", "", f"expected at least {there}, so many are there; got {trials}")
    return trials


def _work(folder: Path, tuning: Tuning, workers: int | None, observers: TuneObservers) -> Tuned:
    study, interrupt = StudyFile(folder, tuning), observers.interrupt
    with closing(open_executor(LOCAL, workers, folder / SCENARIO_FOLDER)) as executor:
        run = TrialsRun(folder, tuning, study, executor, observers.trials, lambda: interrupt.requested)
        observers.trials.begin(tuning, study.over())
        try:
            with interrupt:
                over = run.run()
        finally:
            observers.trials.end()
        trials = tuple(study.over())
        best = best_of(trials, tuning.goal)
        if not over:
            return Tuned(folder, tuning, trials, best, {}, None)
        if best is None:
            raise NothingFound(f"{folder}: all {len(trials)} trials failed, such as trial 0: {trials[0].why}")
        best_file = write_best(folder, tuning, best)
        check = CheckRun(folder, tuning, executor, observers.check, interrupt).run(best, best_file)
    return Tuned(folder, tuning, trials, best, importance_of(study), check)
