"""An experiment from its campaign files to its figure: what is missing is swept, the rest is taken as it is."""

from dataclasses import replace
from pathlib import Path

from rich.console import Console

from docs.experiments.digest import digest
from docs.experiments.drawing import draw
from docs.experiments.experiment import Experiment
from docs.experiments.places import Places
from swarmwire.comms.errors import BadInput, Interrupted
from swarmwire.deploy.campaign.spec import campaign_file, plan_of, spec_in
from swarmwire.deploy.campaign.sweep import ExecutionOptions, Sweep, begin_sweep, check_same, resume_sweep
from swarmwire.deploy.terminal.sweep import SweepProgress
from swarmwire.metrics.campaign.folder import CampaignFolder
from swarmwire.metrics.campaign.spec import ABOUT, read_campaign


def run(experiment: Experiment, places: Places, seeds: str | None, options: ExecutionOptions, console: Console) -> str:
    """Sweep what is missing of an experiment's campaigns, digest and draw it; the numbers.

    With `seeds` other seeds than the campaigns' own are taken, in folders of their own. BadInput as of `swarmwire
    sweep`, and if a campaign that lies there is not the one that its file describes now; Interrupted by Ctrl-C: the
    same call goes on.
    """
    where = places if seeds is None else places.trial(seeds)
    for name in experiment.campaigns:
        swept = _swept(where.campaigns / f"{name}.toml", where.swept / name, seeds, options, console)
        if swept is not None and not swept.is_over:
            raise Interrupted(f"{swept.done} of {swept.runs} runs of {name} are done: the same command goes on")
    digest(experiment, where)
    return draw(experiment, where)


def _swept(file: Path, folder: Path, seeds: str | None, options: ExecutionOptions, console: Console) -> Sweep | None:
    """How far the campaign has come; None: it had been finished before."""
    campaign = campaign_file(file)
    if campaign is None:
        raise BadInput(str(file), "", "expected a campaign, not a scenario")
    plan = plan_of(spec_in(file, campaign, seeds))
    options = replace(options, observer=SweepProgress(console))
    if not (folder / ABOUT).exists():
        return begin_sweep(plan, folder, f"swarmwire sweep {file.name}", options)
    if not CampaignFolder(folder).finished:
        return resume_sweep(folder, options, plan=plan)
    check_same(plan, read_campaign(folder), folder)
    console.print(f"there already: {folder}", soft_wrap=True)
    return None
