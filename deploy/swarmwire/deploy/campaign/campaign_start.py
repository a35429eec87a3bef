"""The folder of a campaign that is about to begin: its scenario with all files, and `campaign.json`."""

from collections.abc import Mapping
from itertools import chain, count
from pathlib import Path
from typing import Any, cast

from swarmwire.comms.clock import WallClock
from swarmwire.comms.errors import BadInput
from swarmwire.deploy.campaign.campaign import SCENARIO_FOLDER, Campaign
from swarmwire.deploy.campaign.design import Point
from swarmwire.deploy.campaign.plan import Plan, overrides_of
from swarmwire.deploy.record import machine
from swarmwire.deploy.record.modules import module_digests
from swarmwire.deploy.record.scenario_copy import Copies, copied_mapping, copy_scenario


def default_folder(scenario: str) -> Path:
    """campaigns/<scenario>-<UTC>, with a number behind it if another campaign has taken that in the same second."""
    wanted = Path("campaigns") / f"{scenario}-{WallClock().utc_stamp()}"
    numbered = (wanted.with_name(f"{wanted.name}-{number}") for number in count(2))
    return next(folder for folder in chain([wanted], numbered) if not folder.exists())


def begin(plan: Plan, folder: Path, command: str) -> Campaign:
    """Make the folder, put into it all that its runs are made from, and `campaign.json` last.

    BadInput unless the folder is new or empty, and can be made.
    """
    scenario_folder = folder / SCENARIO_FOLDER
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if any(folder.iterdir()):
            raise BadInput("--out", str(folder), "expected a new or empty folder; to go on with a campaign: --resume")
        scenario_folder.mkdir()  # of several campaigns that found it empty, the system lets one alone make it
        campaign = campaign_of(plan, scenario_folder, command)
        campaign.write(folder)
    except OSError as error:
        raise BadInput("--out", str(folder), f"expected a folder that can be written: {error.strerror}") from error
    return campaign


def campaign_of(plan: Plan, scenario_folder: Path, command: str) -> Campaign:
    """The campaign of a plan, with its scenario and all its files copied into this folder, which is empty."""
    asked, scenario = plan.asked, plan.scenario
    copies = Copies(scenario_folder)
    point_overrides = tuple(tuple(copied_overrides(plan, point, copies)) for point in plan.points)
    return Campaign(
        name=asked.name or scenario.name,
        scenario=scenario.name,
        command=command,
        began_utc=WallClock().utc_stamp(),
        versions=machine.versions(),
        cpu=machine.cpu(),
        modules=module_digests(plan.code),
        files=copy_scenario(scenario, asked.seeds, scenario_folder, copies),
        design=asked.design,
        seeds=asked.seeds,
        vary=plan.vary(),
        points=plan.points,
        overrides=asked.overrides,
        point_overrides=point_overrides,
        duration_s=scenario.duration_s,
        robots=plan.robots,
        outcomes=plan.outcomes,
        series=asked.series,
        record_seeds=asked.record_seeds,
        pack=asked.pack,
    )


def copied_overrides(plan: Plan, point: Point, copies: Copies) -> list[str]:
    """The values of a point for the copied scenario: a file that one names is named, and copied, as there."""
    if not any(isinstance(value, str | list) for value in point.values()):
        return overrides_of(point)
    copied = copied_mapping(plan.at(point), copies)
    return overrides_of({path: _value_at(copied, path) for path in point})


def _value_at(mapping: Mapping[str, Any], path: str) -> Any:
    at: Any = mapping
    for key in path.split("."):
        at = cast("list[Any]", at)[int(key)] if isinstance(at, list) else at[key]
    return at
