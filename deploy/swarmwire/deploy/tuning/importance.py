"""How much each parameter mattered for the goal: PED-ANOVA over the trials (Watanabe et al., IJCAI 2023)."""

import warnings
from collections.abc import Mapping

from optuna.importance import PedAnovaImportanceEvaluator, get_param_importances
from optuna.trial import TrialState

from swarmwire.deploy.tuning.study_file import StudyFile

MIN_TRIALS = 10  # complete ones: of fewer nothing can be told


def importance_of(study: StudyFile) -> Mapping[str, float]:
    """The share of each path, by falling importance, 1 in all; empty of one path alone, or where nothing can be told.

    It tells how differently a parameter is spread in the best tenth of the trials and in all of them.
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
