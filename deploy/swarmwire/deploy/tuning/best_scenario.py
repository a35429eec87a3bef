"""The best trial, and `best.toml`: the scenario with its parameters, ready to run, with the files that it needs."""

import shutil
import tempfile
from collections.abc import Sequence
from pathlib import Path

from swarmwire.deploy.campaign.storage import storing
from swarmwire.deploy.record.scenario_copy import FILES, copy_scenario
from swarmwire.deploy.tuning.goal import Goal
from swarmwire.deploy.tuning.trial import Trial
from swarmwire.deploy.tuning.tuning import Tuning, scenario_file
from swarmwire.metrics.run_folder.layout import SCENARIO
from swarmwire.world.scenario_file import load_scenario

FILE = "best.toml"


def best_of(trials: Sequence[Trial], goal: Goal) -> Trial | None:
    """The best of those that are complete, the first of equals; None if none is."""
    best: tuple[float, Trial] | None = None
    for trial in trials:
        value = trial.result.value
        if value is not None and (best is None or goal.better(value, best[0])):
            best = value, trial
    return None if best is None else best[1]


def write_best(folder: Path, tuning: Tuning, trial: Trial) -> Path:
    """Write `best.toml` with `files/` beside it into a tuning's folder; StorageFailed if the disk refuses."""
    scenario = load_scenario(scenario_file(folder), tuning.overrides_of(trial.parameters))
    with storing(folder, "tune"), tempfile.TemporaryDirectory(prefix=".aside-best-", dir=folder) as aside:
        copy_scenario(scenario, (scenario.seed,), Path(aside))
        shutil.rmtree(folder / FILES, ignore_errors=True)
        if (Path(aside) / FILES).exists():
            (Path(aside) / FILES).replace(folder / FILES)
        (Path(aside) / SCENARIO).replace(folder / FILE)
    return folder / FILE
