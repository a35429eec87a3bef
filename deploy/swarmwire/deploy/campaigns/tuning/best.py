"""The best trial: `best.toml`, ready to run, and its comparison with the scenario's parameters on fresh seeds.

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
from swarmwire.deploy.runs.record.provenance import FILES, Copies, copy_scenario
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
    """Return the best complete trial, the first of equals; None without a complete trial."""
    best: tuple[float, TuningTrial] | None = None
    for trial in trials:
        value = trial.result.value
        if value is not None and (best is None or goal.better(value, best[0])):
            best = value, trial
    return None if best is None else best[1]


def write_best(folder: Path, tuning: Tuning, trial: TuningTrial) -> Path:
    """Write `best.toml` and `files/` into a tuning's folder; StorageFailed if they cannot be written."""
    scenario = load_scenario(scenario_file(folder), tuning.overrides_of(trial.parameters))
    with storing(folder, "tune"), tempfile.TemporaryDirectory(prefix=".aside-best-", dir=folder) as temporary:
        copy_scenario(scenario, (scenario.seed,), Copies(Path(temporary)))
        shutil.rmtree(folder / FILES, ignore_errors=True)
        if (Path(temporary) / FILES).exists():
            (Path(temporary) / FILES).replace(folder / FILES)
        (Path(temporary) / SCENARIO).replace(folder / FILE)
    return folder / FILE


@dataclass(frozen=True)
class FreshCheck:
    """The results of the check."""

    baseline: Sample
    best: Sample
    baseline_folder: Path
    best_folder: Path


@dataclass(frozen=True)
class CheckRun:
    """Runs a check."""

    folder: Path
    tuning: Tuning
    executor: Executor
    observer: CampaignObserver
    interrupt: Interrupt

    def run(self, best: TuningTrial, best_file: Path) -> FreshCheck | None:
        """Run the missing runs of the two campaigns; return None if interrupted."""
        baseline = self._sweep(BASELINE, scenario_file(self.folder))
        if not baseline.is_over:
            return None
        tuned = self._sweep(f"trial-{best.number}", best_file)
        if not tuned.is_over:
            return None
        column = self.tuning.goal.response.column
        return FreshCheck(
            _sample(baseline.folder, column), _sample(tuned.folder, column), baseline.folder, tuned.folder
        )

    def _sweep(self, name: str, file: Path) -> Sweep:
        path = self.folder / CHECK / name
        with storing(self.folder, "tune"):
            for folder in (path.parent, path):
                refuse_link(folder)
        options = ExecutionOptions(self.executor, observer=self.observer, interrupt=self.interrupt)
        if (path / CAMPAIGN_FILE).exists():
            # The code was checked, or --force was given, when the tuning was resumed.
            return resume_sweep(path, options, force=True)
        if path.exists():
            shutil.rmtree(path)  # left by a process that was killed before the campaign began
        label = "as it is" if name == BASELINE else name.replace("-", " ")
        spec = SweepSpec(file, self.tuning.check_seeds, name=f"{self.tuning.scenario}, {label}")
        return begin_sweep(plan_of(spec), path, self.tuning.command, options)


def _sample(folder: Path, column: str) -> Sample:
    campaign = CampaignFolder(folder)
    if column in (response.column for response in campaign.responses):
        return campaign.sample(column, 0)
    return number_sample(np.empty(0))  # only other choices of the search have this metric


def _censored(sample: Sample) -> Sample:
    """Return 1 for each censored run and 0 for others: the mean is the censored share."""
    return number_sample((~sample.observed).astype(np.float64), sample.seed)


def gained(check: FreshCheck, goal: Goal) -> tuple[str, float, Interval]:
    """Return best minus baseline on the fresh seeds: name of the statistic, difference, and bootstrap interval.

    The statistic is the mean or the censored share if the goal's is; the median for all quantiles.
    """
    baseline, best = check.baseline, check.best
    if goal.stat == "censored":
        shares = difference(_censored(baseline), _censored(best))
        return "shares censored", shares.mean, shares.mean_interval
    gain = difference(baseline, best)
    if goal.stat == "mean":
        return "means", gain.mean, gain.mean_interval
    return "medians", gain.median, gain.median_interval
