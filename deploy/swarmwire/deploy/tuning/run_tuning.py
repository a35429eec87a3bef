"""A tuning from its begin, or from where it was ended, to the check of what it found."""

from collections.abc import Mapping
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path

from swarmwire.comms.errors import BadInput, SwarmwireError
from swarmwire.deploy.campaign.campaign import SCENARIO_FOLDER
from swarmwire.deploy.campaign.executor import LOCAL, open_executor
from swarmwire.deploy.campaign.resumption import check_code, check_files
from swarmwire.deploy.campaign.storage import storing
from swarmwire.deploy.campaign.taken import taken
from swarmwire.deploy.campaign.watcher import Watcher
from swarmwire.deploy.interrupt import Interrupt
from swarmwire.deploy.tuning.best_scenario import best_of, write_best
from swarmwire.deploy.tuning.fresh_check import CheckRun, FreshCheck
from swarmwire.deploy.tuning.importance import importance_of
from swarmwire.deploy.tuning.plan import TuningPlan, check_trials
from swarmwire.deploy.tuning.study_file import StudyFile
from swarmwire.deploy.tuning.trial import Trial
from swarmwire.deploy.tuning.trials_run import TrialsRun, TrialsWatcher
from swarmwire.deploy.tuning.tuning import Tuning, read_tuning
from swarmwire.deploy.tuning.tuning_start import begin_tuning


class NothingFound(SwarmwireError):
    """Every trial failed."""


@dataclass(frozen=True)
class Onlookers:
    """Who looks on, and who may end it."""

    trials: TrialsWatcher
    check: Watcher  # of the two campaigns at the end
    interrupt: Interrupt


@dataclass(frozen=True)
class Tuned:
    """How far a tuning has come."""

    folder: Path
    tuning: Tuning
    trials: tuple[Trial, ...]  # that are over
    best: Trial | None
    importance: Mapping[str, float]  # by path; empty where nothing can be told
    check: FreshCheck | None  # None: interrupted before its end

    @property
    def is_over(self) -> bool:
        """Whether all was done."""
        return self.check is not None


def begin_tune(plan: TuningPlan, folder: Path, command: str, workers: int | None, onlookers: Onlookers) -> Tuned:
    """Make the folder of a tuning that was checked, and run it; `command` is kept with it."""
    tuning = begin_tuning(plan, folder, command)
    with taken(folder, "tuning"):
        return _work(folder, tuning, workers, onlookers)


def resume_tune(
    folder: Path, workers: int | None, onlookers: Onlookers, *, trials: int | None = None, anyway: bool = False
) -> Tuned:
    """Run what is missing of the tuning in this folder, to so many trials if that is said.

    Raises BadInput if the folder holds no tuning, has more trials, its scenario's files have changed, or, unless
    `anyway`, the code, versions or CPU have; StorageFailed when the disk is full; NothingFound when all trials failed.
    """
    tuning = read_tuning(folder)
    check_files(tuning, folder)
    if not anyway:
        check_code(tuning, folder)
    with taken(folder, "tuning"):
        if trials is not None and trials != tuning.trials:
            tuning = replace(tuning, trials=_more(trials, folder, tuning))
            with storing(folder, "tune"):
                tuning.write(folder)
        return _work(folder, tuning, workers, onlookers)


def _more(trials: int, folder: Path, tuning: Tuning) -> int:
    check_trials(trials)
    there = len(StudyFile(folder, tuning).frozen())
    if trials < there:
        raise BadInput("--trials", "", f"expected at least {there}, so many are there; got {trials}")
    return trials


def _work(folder: Path, tuning: Tuning, workers: int | None, onlookers: Onlookers) -> Tuned:
    study, interrupt = StudyFile(folder, tuning), onlookers.interrupt
    with closing(open_executor(LOCAL, workers, folder / SCENARIO_FOLDER)) as executor:
        run = TrialsRun(folder, tuning, study, executor, onlookers.trials, lambda: interrupt.asked)
        onlookers.trials.begin(tuning, study.over())
        try:
            with interrupt:
                over = run.run()
        finally:
            onlookers.trials.end()
        trials = tuple(study.over())
        best = best_of(trials, tuning.goal)
        if not over:
            return Tuned(folder, tuning, trials, best, {}, None)
        if best is None:
            raise NothingFound(f"{folder}: all {len(trials)} trials failed, such as trial 0: {trials[0].why}")
        best_file = write_best(folder, tuning, best)
        check = CheckRun(folder, tuning, executor, onlookers.check, interrupt).run(best, best_file)
    return Tuned(folder, tuning, trials, best, importance_of(study), check)
