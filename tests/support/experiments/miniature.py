"""An experiment in small: its own campaign files with fewer seeds and points, swept here, digested and drawn."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import polars as pl

from docs.experiments.digest import digest_of
from docs.experiments.experiment import Experiment, find_experiment
from docs.experiments.places import HERE
from swarmwire.deploy.campaign.design import vary_from
from swarmwire.deploy.campaign.spec import campaign_file, plan_of, spec_in
from swarmwire.deploy.campaign.sweep import ExecutionOptions, begin_sweep
from swarmwire.deploy.config import seed_list
from tests.support.deploy.campaign.small import InThisProcess


@dataclass(frozen=True)
class Miniature:
    """What came of it."""

    runs: Mapping[str, pl.DataFrame]  # digests by campaign
    figure: Any
    told: str


def miniature(
    name: str,
    folder: Path,
    *,
    seeds: int | Sequence[int],
    vary: Mapping[str, Any] | None = None,
    overrides: Sequence[str] = (),
    campaigns: Sequence[str] | None = None,
) -> Miniature:
    """The experiment with these seeds, and by path other values of what its campaign files vary.

    `overrides` are for all its campaigns. With `campaigns` only these are run, and nothing is drawn or told. No run may
    fail.
    """
    experiment = find_experiment(name, HERE)
    asked = experiment.campaigns if campaigns is None else campaigns
    runs = {campaign: _digest(experiment, campaign, folder, seeds, vary or {}, overrides) for campaign in asked}
    if campaigns is not None:
        return Miniature(runs, None, "")
    return Miniature(runs, experiment.draw(runs), experiment.told(runs))


def _digest(
    experiment: Experiment,
    campaign: str,
    folder: Path,
    seeds: int | Sequence[int],
    vary: Mapping[str, Any],
    overrides: Sequence[str],
) -> pl.DataFrame:
    file = HERE.campaigns / f"{campaign}.toml"
    found = campaign_file(file)
    assert found is not None, file
    spec = replace(spec_in(file, found), seeds=seed_list(seeds))
    varied = tuple(vary_from(of.path, vary[of.path], of.path) if of.path in vary else of for of in spec.varied)
    plan = plan_of(replace(spec, varied=varied, overrides=(*spec.overrides, *overrides)))
    done = begin_sweep(plan, folder / campaign, "a miniature", ExecutionOptions(executor=InThisProcess(1)))
    assert done.is_over
    assert not done.failed
    return digest_of(experiment, folder / campaign)
