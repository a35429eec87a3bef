"""The trials of a tuning: a study of Optuna's on disk, the parameters to try next, and how much each mattered.

The study is a journal, a line for each thing that happens. A trial is written when it begins, with its parameters, and
when it is over. One that was under way when the process was killed is there as running; it is run again under its
number.

Proposals are a function of the trials before and of nothing else: the sampler begins each group of parallel trials
afresh, with a seed of its own, in a study in memory that holds the trials before in their order. So the order in which
trials end does not matter, nor how often the tuning was resumed, nor the number of workers.
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

State = Literal["running", "complete", "failed"]  # running: under way, or it was when the tuning was ended

WHEN = "in tick "  # so begins the line below a traceback that says when in the run it was
FILE = "study.journal"
NAME = "swarmwire"
STATES: Mapping[TrialState, State] = {TrialState.COMPLETE: "complete", TrialState.FAIL: "failed"}
MIN_TRIALS = 10  # complete ones: fewer do not suffice


@dataclass(frozen=True)
class TrialResult:
    """What a trial that is over came to."""

    value: float | None = None  # that Optuna was given; None: it failed
    statistic: float | None = None  # of the goal; None of a quantile of times beyond the limit
    censored: float = 0.0  # share of the runs
    undefined: int = 0  # runs with nothing to measure
    failed: int = 0  # runs that failed: then the trial did
    error: str = ""  # of the first of these, or why there is no value

    def attributes(self) -> dict[str, Any]:
        """All but the value, by name."""
        return {name: of for name, of in asdict(self).items() if name != "value"}


@dataclass(frozen=True)
class TuningTrial:
    """A trial; its number is the same as Optuna's."""

    number: int
    parameters: Mapping[str, Parameter]  # by path; of choices the text
    state: State
    result: TrialResult

    @property
    def is_over(self) -> bool:
        """Whether it ended, well or not."""
        return self.state != "running"

    @property
    def why(self) -> str:
        """Its error in a line: what was raised, without where."""
        lines = self.result.error.strip().splitlines()
        if len(lines) > 1 and lines[-1].startswith(WHEN):
            return f"{lines[-2]}, {lines[-1]}"
        return lines[-1] if lines else ""


def space_of(searches: Sequence[Search]) -> Mapping[str, BaseDistribution]:
    """The distribution of each path."""
    return {search.path: _distribution(search) for search in searches}


def direction_of(goal: Goal) -> str:
    """Which way the value is to go."""
    return "minimize" if goal.direction == "min" else "maximize"


def _distribution(search: Search) -> BaseDistribution:
    if search.choices:
        return CategoricalDistribution(search.names)
    if search.whole:
        return IntDistribution(int(search.low), int(search.high), log=search.log)
    return FloatDistribution(search.low, search.high, log=search.log)


@contextmanager
def quietly() -> Generator[None]:
    """While the block lasts, Optuna logs warnings and errors alone."""
    before = optuna.logging.get_verbosity()
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    try:
        yield
    finally:
        optuna.logging.set_verbosity(before)


class StudyFile:
    """The study of the tuning in a folder, made if need be; the folder must be taken.

    StorageFailed if the disk refuses.

    Attributes:
        study: as Optuna sees it, for its analyses of a study.
    """

    def __init__(self, folder: Path, tuning: Tuning) -> None:
        self._folder, path = folder, folder / FILE
        self._space = dict(space_of(tuning.searches))
        with storing(folder, "tune"), quietly():
            refuse_link(path)
            _drop_half_a_line(path)
            self._storage = JournalStorage(JournalFileBackend(str(path), lock_obj=_FolderIsTaken(str(path))))
            self.study = optuna.create_study(
                storage=self._storage,
                study_name=NAME,
                direction=cast("Literal['minimize', 'maximize']", direction_of(tuning.goal)),
                sampler=RandomSampler(),  # never used: see proposals
                load_if_exists=True,
            )

    def frozen(self) -> list[FrozenTrial]:
        """All trials as Optuna has them, by number."""
        return self.study.get_trials(deepcopy=False)

    def trials(self) -> list[TuningTrial]:
        """All trials, by number."""
        return [_trial(of) for of in self.frozen()]

    def over(self) -> list[TuningTrial]:
        """Those that ended, well or not."""
        return [trial for trial in self.trials() if trial.is_over]

    def begin(self, parameters: Mapping[str, Parameter]) -> None:
        """Write that the next trial begins."""
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


class _FolderIsTaken(JournalFileOpenLock):
    """No lock file, which a killed process would leave behind: the tuning's folder is one process's alone."""

    def acquire(self) -> bool:
        return True

    def release(self) -> None:
        return


def _drop_half_a_line(path: Path) -> None:
    """Cut off what a killed process or a full disk left of the last line: nothing could be written behind it."""
    if not path.exists():
        return
    whole = path.read_bytes().rfind(b"\n") + 1
    os.truncate(path, whole)


def _trial(frozen: FrozenTrial) -> TuningTrial:
    state = STATES.get(frozen.state, "running")
    result = TrialResult() if state == "running" else TrialResult(value=frozen.value, **frozen.user_attrs)
    return TuningTrial(frozen.number, cast("dict[str, Parameter]", frozen.params), state, result)


def proposals(tuning: Tuning, before: Sequence[FrozenTrial]) -> list[dict[str, Parameter]]:
    """The parameters of the parallel trials that follow these, all of which are over."""
    with quietly():
        direction = cast("Literal['minimize', 'maximize']", direction_of(tuning.goal))
        study = optuna.create_study(direction=direction, sampler=_sampler(tuning, len(before)))
    study.add_trials(before)
    space = dict(space_of(tuning.searches))
    return [dict(study.ask(space).params) for _ in range(tuning.parallel_trials)]


def _sampler(tuning: Tuning, first: int) -> TPESampler:
    """The sampler of the group whose first trial has this number."""
    seed = derive_key("tuning", tuning.sampler_seed, first) & LOW32
    # Parallel trials do not know each other's values: the sampler takes these for bad, so that the trials keep apart.
    return TPESampler(seed=seed, constant_liar=True)


def importance_of(study: StudyFile) -> Mapping[str, float]:
    """The share of each path, by falling importance, 1 in all; empty of one path alone, or where it is unknown.

    It measures how differently a parameter is spread in the best tenth of the trials and in all of them.
    """
    complete = [trial for trial in study.frozen() if trial.state == TrialState.COMPLETE]
    if len(complete) < MIN_TRIALS or len(complete[0].params) < 2:
        return {}
    with warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)  # of trials that are too few, or all alike
        try:
            return get_param_importances(study.study, evaluator=PedAnovaImportanceEvaluator())
        except UserWarning:
            return {}
