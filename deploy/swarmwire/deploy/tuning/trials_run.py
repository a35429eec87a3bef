"""The trials of a tuning, run: a batch at a time, all seeds of each, on the workers that campaigns have."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from swarmwire.deploy.campaign.batches import batch_for, shares
from swarmwire.deploy.campaign.execution import execute
from swarmwire.deploy.campaign.executor import Executor
from swarmwire.deploy.campaign.task import Row, Task, TaskResult
from swarmwire.deploy.tuning.goal import Goal, sample_of
from swarmwire.deploy.tuning.proposals import proposals
from swarmwire.deploy.tuning.study_file import StudyFile
from swarmwire.deploy.tuning.trial import Trial, TrialResult
from swarmwire.deploy.tuning.trials_table import write_trials
from swarmwire.deploy.tuning.tuning import Tuning, scenario_file
from swarmwire.metrics.campaign.formats import FAILED


class TrialsWatcher(Protocol):
    """Is told of trials that are over; it is shown to people, so nothing depends on it."""

    def begin(self, tuning: Tuning, trials: Sequence[Trial]) -> None:
        """Work begins; these trials are over already."""
        ...

    def see(self, trial: Trial) -> None:
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
    watcher: TrialsWatcher
    stopped: Callable[[], bool]

    def run(self) -> bool:
        """Run all that are missing; False if stopped before the end."""
        tuning = self.tuning
        for first in range(0, tuning.trials, tuning.batch):
            under_way = self._batch(first)
            over = not under_way or self._done(under_way)
            write_trials(self.folder, tuning, self.study.over())
            if not over:
                return False
        return True

    def _batch(self, first: int) -> list[Trial]:
        """Trials of the batch that begins there which are not over, those of them that were never begun begun now."""
        end, there = min(first + self.tuning.batch, self.tuning.trials), len(self.study.frozen())
        if there < end:
            proposed = proposals(self.tuning, self.study.frozen()[:first])
            for number in range(max(first, there), end):
                self.study.begin(proposed[number - first])
        return [trial for trial in self.study.trials()[first:end] if not trial.is_over]

    def _done(self, trials: Sequence[Trial]) -> bool:
        """Run these; each is kept as soon as all its seeds have been run. False if stopped before the end."""
        found: dict[int, list[Row]] = {trial.number: [] for trial in trials}

        def keep(task: Task, result: TaskResult) -> None:
            rows = found[task.point]
            rows += result.rows
            if len(rows) == len(self.tuning.seeds):
                rows.sort(key=lambda row: row["run"])
                self.watcher.see(self.study.finish(task.point, trial_result(rows, self.tuning.goal)))

        return execute(self._tasks(trials), self.executor, keep, self.stopped)

    def _tasks(self, trials: Sequence[Trial]) -> list[Task]:
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
