"""The best trial: `best.toml`, ready to run, and its comparison with the scenario's own parameters on fresh seeds.

best.toml, files/                the scenario with the best parameters, and the files that it needs
check/baseline, check/trial-N    campaigns of one point each, with the same seeds
"""

import shutil
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from swarmwire.comms.base.atomic import refuse_link
from swarmwire.deploy.campaigns.schedule import Executor
from swarmwire.deploy.campaigns.spec import SweepSpec, plan_of
from swarmwire.deploy.campaigns.store import storing
from swarmwire.deploy.campaigns.sweep import CampaignObserver, ExecutionOptions, Sweep, begin_sweep, resume_sweep
from swarmwire.deploy.campaigns.tuning.spec import Goal, Tuning, scenario_file
from swarmwire.deploy.campaigns.tuning.study import TuningTrial
from swarmwire.deploy.runs.controls import Interrupt
from swarmwire.deploy.runs.record.provenance import FILES, copy_scenario
from swarmwire.metrics.records.campaign.campaign_json import CAMPAIGN_FILE
from swarmwire.metrics.records.campaign.folder import CampaignFolder
from swarmwire.metrics.records.run_folder.layout import SCENARIO
from swarmwire.metrics.statistics.difference import difference
from swarmwire.metrics.statistics.sample import Interval, Sample, number_sample
from swarmwire.world.scenario_file import load_scenario

FILE = "best.toml"
CHECK = "check"
BASELINE = "baseline"


def best_of(trials: Sequence[TuningTrial], goal: Goal) -> TuningTrial | None:
    """The best of those that are complete, the first of equals; None if none is."""
    best: tuple[float, TuningTrial] | None = None
    for trial in trials:
        value = trial.result.value
        if value is not None and (best is None or goal.better(value, best[0])):
            best = value, trial
    return None if best is None else best[1]


def write_best(folder: Path, tuning: Tuning, trial: TuningTrial) -> Path:
    """Write `best.toml` with `files/` beside it into a tuning's folder; StorageFailed if the disk refuses."""
    scenario = load_scenario(scenario_file(folder), tuning.overrides_of(trial.parameters))
    with storing(folder, "tune"), tempfile.TemporaryDirectory(prefix=".aside-best-", dir=folder) as aside:
        copy_scenario(scenario, (scenario.seed,), Path(aside))
        shutil.rmtree(folder / FILES, ignore_errors=True)
        if (Path(aside) / FILES).exists():
            (Path(aside) / FILES).replace(folder / FILES)
        (Path(aside) / SCENARIO).replace(folder / FILE)
    return folder / FILE


@dataclass(frozen=True)
class FreshCheck:
    """The results of the check."""

    own: Sample
    best: Sample
    own_folder: Path
    best_folder: Path


@dataclass(frozen=True)
class CheckRun:
    """With what a check is run."""

    folder: Path
    tuning: Tuning
    executor: Executor
    observer: CampaignObserver
    interrupt: Interrupt

    def run(self, best: TuningTrial, best_file: Path) -> FreshCheck | None:
        """Run both campaigns, or what is missing of them; None if interrupted."""
        sweeps: list[Sweep] = []
        for name, file in ((BASELINE, scenario_file(self.folder)), (f"trial-{best.number}", best_file)):
            sweeps.append(self._swept(name, file))
            if not sweeps[-1].is_over:
                return None
        own, tried = (sweep.folder for sweep in sweeps)
        column = self.tuning.goal.response.column
        return FreshCheck(_sample(own, column), _sample(tried, column), own, tried)

    def _swept(self, name: str, file: Path) -> Sweep:
        path = self.folder / CHECK / name
        with storing(self.folder, "tune"):
            for folder in (path.parent, path):
                refuse_link(folder)
        options = ExecutionOptions(self.executor, observer=self.observer, interrupt=self.interrupt)
        if (path / CAMPAIGN_FILE).exists():
            # The code was checked, or --force was given, when the tuning was resumed.
            return resume_sweep(path, options, force=True)
        if path.exists():
            shutil.rmtree(path)  # killed before it had begun
        label = "as it is" if name == BASELINE else name.replace("-", " ")
        spec = SweepSpec(file, self.tuning.check_seeds, name=f"{self.tuning.scenario}, {label}")
        return begin_sweep(plan_of(spec), path, self.tuning.command, options)


def _sample(folder: Path, column: str) -> Sample:
    campaign = CampaignFolder(folder)
    if column in (response.column for response in campaign.responses):
        return campaign.sample(column, 0)
    return number_sample(np.empty(0))  # a choice brought the metric along


def _censored(sample: Sample) -> Sample:
    """1 of each run that is censored, 0 of others: the mean is their share."""
    return number_sample((~sample.observed).astype(np.float64), sample.seed)


def gained(check: FreshCheck, goal: Goal) -> tuple[str, float, Interval]:
    """Best less own on the fresh seeds: of what, the difference, and its bootstrap interval.

    Of means and shares it is theirs; of all quantiles that of the medians.
    """
    own, best = check.own, check.best
    if goal.stat == "censored":
        of_shares = difference(_censored(own), _censored(best))
        return "shares censored", of_shares.mean, of_shares.mean_interval
    found = difference(own, best)
    if goal.stat == "mean":
        return "means", found.mean, found.mean_interval
    return "medians", found.median, found.median_interval
