"""Execution of a tuning, new or resumed, up to the check of its best trial: parallel trials, each with all seeds."""

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
from swarmwire.deploy.campaigns.folder import check_resumable, copied_overrides, new_folder, provenance
from swarmwire.deploy.campaigns.schedule import LOCAL, Executor, batch_for, execute, open_executor, shares
from swarmwire.deploy.campaigns.spec import CampaignPlan
from swarmwire.deploy.campaigns.store import storing
from swarmwire.deploy.campaigns.sweep import CampaignObserver
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
from swarmwire.deploy.runs.record.provenance import Copies
from swarmwire.metrics.records.campaign.campaign_json import FAILED, SCENARIO_FOLDER
from swarmwire.metrics.records.run_folder.writer import PARQUET

TUNINGS = "tunings"  # default folder of tunings
FILE = "trials.parquet"


def _tuning_of(plan: TuningPlan, scenario_folder: Path, command: str) -> Tuning:
    spec, copies = plan.spec, Copies(scenario_folder)
    searches = [_copied(search, ends, copies) for search, ends in zip(plan.searches, plan.ends, strict=True)]
    return Tuning(
        **provenance(plan.scenario, (plan.scenario.seed,), command, plan.code, copies),
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


def _copied(search: Search, ends: CampaignPlan, copies: Copies) -> Search:
    """Return a search whose choices name the copied files."""
    if not search.choices:
        return search
    return replace(search, overrides=tuple(copied_overrides(ends, point, copies)[0] for point in ends.points))


def write_trials(folder: Path, tuning: Tuning, trials: Sequence[TuningTrial]) -> None:
    """Rewrite the table of finished trials: number, state, a column for each path, the result.

    StorageFailed if it cannot be written.
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
        "trial": "integer",
        "state": "text",
        **{search.path: _type(search) for search in tuning.searches},
        **dict.fromkeys(("value", "statistic", "censored"), "number"),
        **dict.fromkeys(("undefined", "failed"), "integer"),
        "error": "text",
    }
    types = {"integer": pl.Int64(), "text": pl.String(), "number": pl.Float64()}
    file = BytesIO()  # a full disk then raises OSError
    pl.DataFrame(rows, {name: types[kind] for name, kind in kinds.items()}).write_parquet(file, **PARQUET)
    with storing(folder, "tune"):
        write_bytes(folder / FILE, file.getvalue())


def _type(search: Search) -> str:
    if search.choices:
        return "text"
    return "integer" if search.whole else "number"


class TrialObserver(Protocol):
    """Shows the progress of trials to people; results do not depend on it."""

    def begin(self, tuning: Tuning, trials: Sequence[TuningTrial]) -> None:
        """Show the start; `trials` have ended already."""
        ...

    def see(self, trial: TuningTrial) -> None:
        """Show a trial that has ended and is written."""
        ...

    def end(self) -> None:
        """Show the end, also after an error."""
        ...


@dataclass(frozen=True)
class TrialsRun:
    """Runs the missing trials of a tuning."""

    folder: Path
    tuning: Tuning
    study: StudyFile
    executor: Executor
    observer: TrialObserver
    stopped: Callable[[], bool]

    def run(self) -> bool:
        """Run all missing trials; return False if stopped before the end."""
        tuning = self.tuning
        for first in range(0, tuning.trials, tuning.parallel_trials):
            running = self._group(first)
            is_complete = not running or self._execute(running)
            write_trials(self.folder, tuning, self.study.over())
            if not is_complete:
                return False
        return True

    def _group(self, first: int) -> list[TuningTrial]:
        """Return the unfinished parallel trials from this number on; begin the new ones among them."""
        end, begun = min(first + self.tuning.parallel_trials, self.tuning.trials), len(self.study.frozen())
        if begun < end:
            proposed = proposals(self.tuning, self.study.frozen()[:first])
            for number in range(max(first, begun), end):
                self.study.begin(proposed[number - first])
        return [trial for trial in self.study.trials()[first:end] if not trial.is_over]

    def _execute(self, trials: Sequence[TuningTrial]) -> bool:
        """Run trials, and write each as soon as all its seeds have ended; return False if stopped before the end."""
        by_trial: dict[int, list[Row]] = {trial.number: [] for trial in trials}

        def on_result(task: Task, result: TaskResult) -> None:
            rows = by_trial[task.point]
            rows += result.rows
            if len(rows) == len(self.tuning.seeds):
                rows.sort(key=lambda row: row["run"])
                self.observer.see(self.study.finish(task.point, trial_result(rows, self.tuning.goal)))

        return execute(self._tasks(trials), self.executor, on_result, self.stopped)

    def _tasks(self, trials: Sequence[TuningTrial]) -> list[Task]:
        tuning = self.tuning
        size = batch_for(len(trials), len(tuning.seeds), tuning.robots, self.executor.slots)
        return [
            Task(
                scenario=str(scenario_file(self.folder)),
                overrides=tuning.overrides_of(trial.parameters),
                point=trial.number,
                runs=tuple(runs),
                seeds=tuple(tuning.seeds[run] for run in runs),
                series=False,
            )
            for trial in trials
            for runs in shares(range(len(tuning.seeds)), size)
        ]


def trial_result(rows: Sequence[Row], goal: Goal) -> TrialResult:
    """Return the result of a trial from the rows of all its seeds; a trial with a failed run fails.

    Without that seed the trial would not be comparable with others.
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
    """Observers of a tuning, and the request to stop."""

    trials: TrialObserver
    check: CampaignObserver  # observer of the two campaigns of the check
    interrupt: Interrupt


@dataclass(frozen=True)
class Tuned:
    """Progress of a tuning."""

    folder: Path
    tuning: Tuning
    trials: tuple[TuningTrial, ...]  # trials that have ended
    best: TuningTrial | None
    importance: Mapping[str, float]  # path: share; empty if unknown
    check: FreshCheck | None  # None: interrupted before its end

    @property
    def is_over(self) -> bool:
        """True if trials and check are complete."""
        return self.check is not None


def begin_tune(plan: TuningPlan, folder: Path, command: str, workers: int | None, observers: TuneObservers) -> Tuned:
    """Make the folder of a checked tuning, and run it; `command` is recorded in it."""
    with new_folder(folder, "tuning") as scenario_folder:
        tuning = _tuning_of(plan, scenario_folder, command)
        write_tuning(tuning, folder)  # last: the folder has all files of the scenario by then
    with folder_lock(folder, "tuning"):
        return _work(folder, tuning, workers, observers)


def resume_tune(
    folder: Path, workers: int | None, observers: TuneObservers, *, trials: int | None = None, force: bool = False
) -> Tuned:
    """Run the missing trials and check of the tuning in this folder; `trials` is a new number of trials.

    Raises BadInput if the folder has no tuning, or more trials, its scenario's files have changed, or, unless `force`,
    the code, versions or CPU have; StorageFailed if the disk is full; NothingFound if all trials failed.
    """
    tuning = read_tuning(folder)
    check_resumable(tuning, folder, force=force)
    with folder_lock(folder, "tuning"):
        if trials is not None and trials != tuning.trials:
            tuning = replace(tuning, trials=_checked_trials(trials, folder, tuning))
            with storing(folder, "tune"):
                write_tuning(tuning, folder)
        return _work(folder, tuning, workers, observers)


def _checked_trials(trials: int, folder: Path, tuning: Tuning) -> int:
    check_trials(trials)
    begun = len(StudyFile(folder, tuning).frozen())
    if trials < begun:
        raise BadInput("--trials", "", f"expected at least {begun}, the number of trials so far; got {trials}")
    return trials


def _work(folder: Path, tuning: Tuning, workers: int | None, observers: TuneObservers) -> Tuned:
    study, interrupt = StudyFile(folder, tuning), observers.interrupt
    with closing(open_executor(LOCAL, workers, folder / SCENARIO_FOLDER)) as executor:
        run = TrialsRun(folder, tuning, study, executor, observers.trials, lambda: interrupt.requested)
        observers.trials.begin(tuning, study.over())
        try:
            with interrupt:
                is_complete = run.run()
        finally:
            observers.trials.end()
        trials = tuple(study.over())
        best = best_of(trials, tuning.goal)
        if not is_complete:
            return Tuned(folder, tuning, trials, best, {}, None)
        if best is None:
            raise NothingFound(f"{folder}: all {len(trials)} trials failed, such as trial 0: {trials[0].why}")
        best_file = write_best(folder, tuning, best)
        check = CheckRun(folder, tuning, executor, observers.check, interrupt).run(best, best_file)
    return Tuned(folder, tuning, trials, best, importance_of(study), check)
