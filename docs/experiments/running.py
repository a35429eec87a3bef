"""An experiment from its campaign files to its figure: what is missing is swept, the rest is taken as it is."""

from pathlib import Path

from rich.console import Console

from docs.experiments.digest import digest
from docs.experiments.drawing import draw
from docs.experiments.experiment import Experiment
from docs.experiments.places import Places
from swarmwire.comms.errors import BadInput, Interrupted
from swarmwire.deploy.campaign.campaign import read_campaign
from swarmwire.deploy.campaign.campaign_file import asked_in, campaign_table
from swarmwire.deploy.campaign.plan import planned
from swarmwire.deploy.campaign.resumption import check_same
from swarmwire.deploy.campaign.sweeping import Means, Sweep, begin_sweep, resume_sweep
from swarmwire.deploy.terminal.sweep_progress import sweep_progress
from swarmwire.metrics.campaign.campaign_folder import CampaignFolder
from swarmwire.metrics.campaign.formats import ABOUT


def run(experiment: Experiment, places: Places, seeds: str | None, means: Means, console: Console) -> str:
    """Sweep what is missing of an experiment's campaigns, digest and draw it; the numbers.

    With `seeds` other seeds than the campaigns' own are taken, in folders of their own. BadInput as of `swarmwire
    sweep`, and if a campaign that lies there is not the one that its file describes now; Interrupted by Ctrl-C: the
    same call goes on.
    """
    where = places if seeds is None else places.trial(seeds)
    for name in experiment.campaigns:
        swept = _swept(where.campaigns / f"{name}.toml", where.swept / name, seeds, means, console)
        if swept is not None and not swept.is_over:
            raise Interrupted(f"{swept.done} of {swept.runs} runs of {name} are done: the same command goes on")
    digest(experiment, where)
    return draw(experiment, where)


def _swept(file: Path, folder: Path, seeds: str | None, means: Means, console: Console) -> Sweep | None:
    """How far the campaign has come; None: it had been finished before."""
    table = campaign_table(file)
    if table is None:
        raise BadInput(str(file), "", "expected a campaign, not a scenario")
    plan = planned(asked_in(file, table if seeds is None else {**table, "seeds": seeds}))
    if not (folder / ABOUT).exists():
        return begin_sweep(plan, folder, f"swarmwire sweep {file.name}", means, sweep_progress(console))
    if not CampaignFolder(folder).finished:
        return resume_sweep(folder, means, plan=plan, watcher=sweep_progress(console))
    check_same(plan, read_campaign(folder), folder)
    console.print(f"there already: {folder}", soft_wrap=True)
    return None
