"""The best parameters against the scenario's own, on seeds with which neither was chosen: two campaigns.

check/baseline, check/trial-N    campaigns of one point each, with the same seeds
"""

import shutil
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from swarmwire.deploy.campaign.executor import Executor
from swarmwire.deploy.campaign.plan import Asked, planned
from swarmwire.deploy.campaign.sweeping import Means, Sweep, begin_sweep, resume_sweep
from swarmwire.deploy.campaign.watcher import Watcher
from swarmwire.deploy.interrupt import Interrupt
from swarmwire.deploy.tuning.goal import Goal
from swarmwire.deploy.tuning.trial import Trial
from swarmwire.deploy.tuning.tuning import Tuning, scenario_file
from swarmwire.metrics.campaign.campaign_folder import CampaignFolder
from swarmwire.metrics.campaign.formats import ABOUT
from swarmwire.metrics.statistics.difference import difference
from swarmwire.metrics.statistics.sample import Interval, Sample, number_sample

CHECK = "check"
BASELINE = "baseline"


@dataclass(frozen=True)
class FreshCheck:
    """What came of the check."""

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
    watcher: Watcher
    interrupt: Interrupt

    def run(self, best: Trial, best_file: Path) -> FreshCheck | None:
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
        path, means = self.folder / CHECK / name, Means(executor=self.executor)
        if (path / ABOUT).exists():
            # The code was checked, or people insisted, when the tuning was gone on with.
            return resume_sweep(path, means, anyway=True, watcher=self.watcher, interrupt=self.interrupt)
        if path.exists():
            shutil.rmtree(path)  # killed before it had begun
        label = "as it is" if name == BASELINE else name.replace("-", " ")
        asked = Asked(file, self.tuning.check_seeds, name=f"{self.tuning.scenario}, {label}")
        return begin_sweep(planned(asked), path, self.tuning.command, means, self.watcher, self.interrupt)


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
