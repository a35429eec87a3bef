"""The trials of a tuning: an Optuna study on disk, the proposals of parameters, and their importance.

The study is a journal, a line per event. A trial is written when it begins, with its parameters, and when it ends. A
trial that was running when the process was killed is still running in the journal; it is repeated under its number.

Proposals are a function of the earlier trials only: for each group of parallel trials a new sampler, with a separate
seed, reads a study in memory with the earlier trials in order. So proposals depend neither on the order in which trials
end, nor on interruptions, nor on the number of workers.
"""

import os
import warnings
from collections.abc import Generator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal, cast

import optuna
from optuna.distributions import (
    BaseDistribution,
    CategoricalDistribution,
    FloatDistribution,
    IntDistribution,
)
from optuna.importance import PedAnovaImportanceEvaluator, get_param_importances
from optuna.samplers import RandomSampler, TPESampler
from optuna.storages.journal import JournalFileBackend, JournalFileOpenLock, JournalStorage
from optuna.trial import FrozenTrial, TrialState, create_trial

from swarmwire.comms.base.atomic import refuse_link
from swarmwire.comms.base.draws import LOW32, derive_key
from swarmwire.deploy.campaigns.store import storing
from swarmwire.deploy.campaigns.tuning.spec import Goal, Parameter, Search, Tuning

State = Literal["running", "complete", "failed"]  # running: also if the tuning ended before the trial

WHEN = "in tick "  # start of the line after a traceback with the time in the run
FILE = "study.journal"
NAME = "swarmwire"
STATES: Mapping[TrialState, State] = {TrialState.COMPLETE: "complete", TrialState.FAIL: "failed"}
MIN_TRIALS = 10  # smallest number of complete trials for importances


@dataclass(frozen=True)
class TrialResult:
    """Result of a trial that has ended."""

    value: float | None = None  # value for Optuna; None: the trial failed
    statistic: float | None = None  # statistic of the goal; None for a quantile of times beyond the limit
    censored: float = 0.0  # share of the runs
    undefined: int = 0  # runs without a value
    failed: int = 0  # failed runs; the trial fails if there are any
    error: str = ""  # error of the first failed run, or the reason for a missing value

    def attributes(self) -> dict[str, Any]:
        """Return all fields except the value, by name."""
        return {name: field for name, field in asdict(self).items() if name != "value"}


@dataclass(frozen=True)
class TuningTrial:
    """A trial; its number is the same as Optuna's."""

    number: int
    parameters: Mapping[str, Parameter]  # path: number, or text of a choice
    state: State
    result: TrialResult

    @property
    def is_over(self) -> bool:
        """True if the trial has ended, with or without a failure."""
        return self.state != "running"

    @property
    def why(self) -> str:
        """The error in one line, without the traceback."""
        lines = self.result.error.strip().splitlines()
        if len(lines) > 1 and lines[-1].startswith(WHEN):
            return f"{lines[-2]}, {lines[-1]}"
        return lines[-1] if lines else ""


def space_of(searches: Sequence[Search]) -> Mapping[str, BaseDistribution]:
    """Return the distribution of each path."""
    return {search.path: _distribution(search) for search in searches}


def direction_of(goal: Goal) -> str:
    """Return Optuna's direction of a goal."""
    return "minimize" if goal.direction == "min" else "maximize"


def _distribution(search: Search) -> BaseDistribution:
    if search.choices:
        return CategoricalDistribution(search.names)
    if search.whole:
        return IntDistribution(int(search.low), int(search.high), log=search.log)
    return FloatDistribution(search.low, search.high, log=search.log)


@contextmanager
def quietly() -> Generator[None]:
    """Let Optuna log only warnings and errors within the block."""
    before = optuna.logging.get_verbosity()
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    try:
        yield
    finally:
        optuna.logging.set_verbosity(before)


class StudyFile:
    """The study of the tuning in a folder, created if it is missing; the caller must have locked the folder.

    StorageFailed if it cannot be written.

    Attributes:
        study: Optuna's study, for its analyses.
    """

    def __init__(self, folder: Path, tuning: Tuning) -> None:
        self._folder, path = folder, folder / FILE
        self._space = dict(space_of(tuning.searches))
        with storing(folder, "tune"), quietly():
            refuse_link(path)
            _truncate_last_line(path)
            self._storage = JournalStorage(JournalFileBackend(str(path), lock_obj=_NoLock(str(path))))
            self.study = optuna.create_study(
                storage=self._storage,
                study_name=NAME,
                direction=cast("Literal['minimize', 'maximize']", direction_of(tuning.goal)),
                sampler=RandomSampler(),  # never used: see proposals
                load_if_exists=True,
            )

    def frozen(self) -> list[FrozenTrial]:
        """Return all trials as Optuna's objects, by number."""
        return self.study.get_trials(deepcopy=False)

    def trials(self) -> list[TuningTrial]:
        """Return all trials, by number."""
        return [_trial(frozen) for frozen in self.frozen()]

    def over(self) -> list[TuningTrial]:
        """Return the trials that have ended, failed trials included."""
        return [trial for trial in self.trials() if trial.is_over]

    def begin(self, parameters: Mapping[str, Parameter]) -> None:
        """Write the start of the next trial."""
        frozen = create_trial(state=TrialState.RUNNING, params=dict(parameters), distributions=self._space)
        with storing(self._folder, "tune"):
            self.study.add_trial(frozen)

    def finish(self, number: int, result: TrialResult) -> TuningTrial:
        """Write the result of a running trial, and return it."""
        study = self._storage.get_study_id_from_name(NAME)
        trial = self._storage.get_trial_id_from_study_id_trial_number(study, number)
        with storing(self._folder, "tune"):
            for name, value in result.attributes().items():
                self._storage.set_trial_user_attr(trial, name, value)
            if result.value is None:
                self.study.tell(number, state=TrialState.FAIL)
            else:
                self.study.tell(number, result.value)
        return self.trials()[number]


class _NoLock(JournalFileOpenLock):
    """Replacement of a lock file, which a killed process would leave behind; the tuning's folder is locked already."""

    def acquire(self) -> bool:
        return True

    def release(self) -> None:
        return


def _truncate_last_line(path: Path) -> None:
    """Remove an incomplete last line, which a killed process or a full disk leaves, so that lines can be appended."""
    if path.exists():
        os.truncate(path, path.read_bytes().rfind(b"\n") + 1)


def _trial(frozen: FrozenTrial) -> TuningTrial:
    state = STATES.get(frozen.state, "running")
    result = TrialResult() if state == "running" else TrialResult(value=frozen.value, **frozen.user_attrs)
    return TuningTrial(frozen.number, cast("dict[str, Parameter]", frozen.params), state, result)


def proposals(tuning: Tuning, before: Sequence[FrozenTrial]) -> list[dict[str, Parameter]]:
    """Propose the parameters of the parallel trials that follow the trials `before`, all of which have ended."""
    with quietly():
        direction = cast("Literal['minimize', 'maximize']", direction_of(tuning.goal))
        study = optuna.create_study(direction=direction, sampler=_sampler(tuning, len(before)))
    study.add_trials(before)
    space = dict(space_of(tuning.searches))
    return [dict(study.ask(space).params) for _ in range(tuning.parallel_trials)]


def _sampler(tuning: Tuning, first: int) -> TPESampler:
    """Return the sampler of the group whose first trial has this number."""
    seed = derive_key("tuning", tuning.sampler_seed, first) & LOW32
    # The sampler assumes bad values for the running parallel trials, so that they are not close to each other.
    return TPESampler(seed=seed, constant_liar=True)


def importance_of(study: StudyFile) -> Mapping[str, float]:
    """Return the importance of each path, in falling order, with sum 1; empty for a single path, or if unknown.

    It compares a parameter's distribution in the best tenth of the trials with that in all trials.
    """
    complete = [trial for trial in study.frozen() if trial.state == TrialState.COMPLETE]
    if len(complete) < MIN_TRIALS or len(complete[0].params) < 2:
        return {}
    with warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)  # raised for too few, or equal, trials
        try:
            return get_param_importances(study.study, evaluator=PedAnovaImportanceEvaluator())
        except UserWarning:
            return {}
