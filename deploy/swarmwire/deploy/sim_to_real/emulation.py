"""The emulated side of a sim-to-real comparison: runs of a folder, their scenario and its metrics."""

from dataclasses import dataclass
from pathlib import Path

from swarmwire.comms.errors import BadInput
from swarmwire.comms.truth import Static
from swarmwire.deploy.campaign.campaign import read_campaign
from swarmwire.deploy.campaign.campaign_folder import CampaignFolder
from swarmwire.deploy.measuring import measuring
from swarmwire.metrics.campaign.formats import ABOUT
from swarmwire.metrics.campaign.selection import select
from swarmwire.metrics.metric import Metric
from swarmwire.metrics.record.names import SCENARIO, STATIC
from swarmwire.metrics.run_folder import RunFolder
from swarmwire.metrics.sim_to_real.emulated_runs import EmulatedRuns, runs_of_campaign, runs_of_folder
from swarmwire.world.scenario.scenario import Scenario
from swarmwire.world.scenario_file import load_scenario
from swarmwire.world.world import World


@dataclass(frozen=True)
class Emulation:
    """Runs of one scenario, and what is known of it."""

    runs: EmulatedRuns
    scenario: Scenario
    static: Static  # of the first of them, in whose arena the robots are taken to have been
    metrics: tuple[Metric, ...]  # that were measured, with their parameters


def read_emulation(text: str) -> Emulation:
    """Of a run folder, or of a campaign's, as `FOLDER` or `FOLDER@path=value`; BadInput where it is neither."""
    path = Path(text if Path(text).exists() else text.partition("@")[0])
    if (path / ABOUT).exists():
        return _of_campaign(text)
    if not (path / STATIC).exists():
        raise BadInput(text, "", f"expected the folder of a run ({STATIC}) or of a campaign ({ABOUT})")
    scenario = load_scenario(path / SCENARIO)
    metrics = measuring(scenario).metrics
    runs = runs_of_folder(path, tuple(metric.name for metric in metrics))
    return Emulation(runs, scenario, RunFolder(path).static, metrics)


def _of_campaign(text: str) -> Emulation:
    selection = select(text)
    campaign = read_campaign(selection.campaign.path)
    overrides = campaign.point_overrides[selection.points[0]]
    scenario = load_scenario(CampaignFolder(selection.campaign.path, campaign).scenario, overrides)
    metrics = measuring(scenario).metrics
    static = World(scenario, campaign.seeds[:1], {}).static
    names = tuple(metric.name for metric in metrics)
    return Emulation(runs_of_campaign(selection, names, static.rate_hz, static.robots), scenario, static, metrics)
