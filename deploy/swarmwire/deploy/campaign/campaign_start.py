"""The folder of a campaign that is about to begin: its scenario with all files, and `campaign.json`."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, cast

from swarmwire.comms.clock import WallClock
from swarmwire.deploy.campaign.campaign import Campaign
from swarmwire.deploy.campaign.design import Point
from swarmwire.deploy.campaign.fresh_folder import fresh_folder
from swarmwire.deploy.campaign.plan import Plan, overrides_of
from swarmwire.deploy.record import machine
from swarmwire.deploy.record.modules import module_digests
from swarmwire.deploy.record.new_folder import stamped_folder
from swarmwire.deploy.record.scenario_copy import Copies, copied_mapping, copy_scenario


def default_folder(scenario: str) -> Path:
    """campaigns/<scenario>-<UTC>, as `stamped_folder` has it."""
    return stamped_folder(Path("campaigns") / scenario)


def begin(plan: Plan, folder: Path, command: str) -> Campaign:
    """Make the folder, put into it all that its runs are made from, and `campaign.json` last.

    BadInput unless the folder is new or empty, and can be made.
    """
    with fresh_folder(folder, "campaign") as scenario_folder:
        campaign = campaign_of(plan, scenario_folder, command)
        campaign.write(folder)
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
        responses=plan.responses,
        series=asked.series,
        record_seeds=asked.record_seeds,
        batch=asked.batch,
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
