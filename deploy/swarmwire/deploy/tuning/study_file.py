"""A tuning's trials on disk: a study of Optuna's in a journal, a line for each thing that happens.

A trial is written when it begins, with its parameters, and when it is over. One that was under way when the process was
killed stands there as running, and is run again under its number.
"""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Literal, cast

import optuna
from optuna.samplers import RandomSampler
from optuna.storages.journal import JournalFileBackend, JournalFileOpenLock, JournalStorage
from optuna.trial import FrozenTrial, TrialState, create_trial

from swarmwire.deploy.campaign.storage import storing
from swarmwire.deploy.tuning.quietly import quietly
from swarmwire.deploy.tuning.search import Parameter
from swarmwire.deploy.tuning.space import direction_of, space_of
from swarmwire.deploy.tuning.trial import State, Trial, TrialResult
from swarmwire.deploy.tuning.tuning import Tuning

FILE = "study.journal"
NAME = "swarmwire"
STATES: Mapping[TrialState, State] = {TrialState.COMPLETE: "complete", TrialState.FAIL: "failed"}


class StudyFile:
    """The study of the tuning in a folder, made if need be; the folder must be taken.

    StorageFailed if the disk refuses.

    Attributes:
        study: as Optuna sees it, for what it can tell of one.
    """

    def __init__(self, folder: Path, tuning: Tuning) -> None:
        self._folder, path = folder, folder / FILE
        self._space = dict(space_of(tuning.searches))
        with storing(folder, "tune"), quietly():
            _drop_half_a_line(path)
            self._storage = JournalStorage(JournalFileBackend(str(path), lock_obj=_FolderIsTaken(str(path))))
            self.study = optuna.create_study(
                storage=self._storage,
                study_name=NAME,
                direction=cast("Literal['minimize', 'maximize']", direction_of(tuning.goal)),
                sampler=RandomSampler(),  # it is never asked: see proposals
                load_if_exists=True,
            )

    def frozen(self) -> list[FrozenTrial]:
        """All trials as Optuna has them, by number."""
        return self.study.get_trials(deepcopy=False)

    def trials(self) -> list[Trial]:
        """All trials, by number."""
        return [_trial(of) for of in self.frozen()]

    def over(self) -> list[Trial]:
        """Those that ended, well or not."""
        return [trial for trial in self.trials() if trial.is_over]

    def begin(self, parameters: Mapping[str, Parameter]) -> None:
        """Write that the next trial begins."""
        frozen = create_trial(state=TrialState.RUNNING, params=dict(parameters), distributions=self._space)
        with storing(self._folder, "tune"):
            self.study.add_trial(frozen)

    def finish(self, number: int, result: TrialResult) -> Trial:
        """Write what came of a trial that is under way, and give it back."""
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


def _trial(frozen: FrozenTrial) -> Trial:
    state = STATES.get(frozen.state, "running")
    result = TrialResult() if state == "running" else TrialResult(value=frozen.value, **frozen.user_attrs)
    return Trial(frozen.number, cast("dict[str, Parameter]", frozen.params), state, result)
