"""A campaign begins or is resumed: its folder with the files of its scenario, and checks that nothing has changed."""

from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, cast

from swarmwire.comms.clock import WallClock
from swarmwire.comms.errors import BadInput
from swarmwire.deploy.campaign.design import Point
from swarmwire.deploy.campaign.spec import Plan, overrides_of
from swarmwire.deploy.campaign.store import new_folder
from swarmwire.deploy.record.folder import stamped_folder
from swarmwire.deploy.record.provenance import changes_since, cpu, module_digests, versions
from swarmwire.deploy.record.scenario_copy import Copies, changed_files, copied_mapping, copy_scenario
from swarmwire.metrics.campaign.spec import SCENARIO_FOLDER, Campaign, CopiedFile, Design, Provenance, write_campaign
from swarmwire.world.scenario.scenario import Scenario

SAME = ("files", "overrides", "design", "seeds", "vary", "points")  # of a plan and of the campaign that it resumes


def default_folder(scenario: str) -> Path:
    """campaigns/<scenario>-<UTC>, as `stamped_folder` has it."""
    return stamped_folder(Path("campaigns") / scenario)


def begin(plan: Plan, folder: Path, command: str) -> Campaign:
    """Make the folder, put into it all that its runs are made from, and `campaign.json` last.

    BadInput unless the folder is new or empty, and can be made.
    """
    with new_folder(folder, "campaign") as scenario_folder:
        campaign = campaign_of(plan, scenario_folder, command)
        write_campaign(campaign, folder)
    return campaign


def campaign_of(plan: Plan, scenario_folder: Path, command: str) -> Campaign:
    """The campaign of a plan, with its scenario and all its files copied into this folder, which is empty."""
    spec, scenario = plan.spec, plan.scenario
    copies = Copies(scenario_folder)
    point_overrides = tuple(tuple(copied_overrides(plan, point, copies)) for point in plan.points)
    return Campaign(
        **provenance(scenario, command, plan.code, copy_scenario(scenario, spec.seeds, scenario_folder, copies)),
        name=spec.name or scenario.name,
        design=cast("Design", spec.design),  # `points_of` has checked it
        seeds=spec.seeds,
        vary=plan.vary(),
        points=plan.points,
        overrides=spec.overrides,
        point_overrides=point_overrides,
        duration_s=scenario.duration_s,
        robots=plan.robots,
        responses=plan.responses,
        series=spec.series,
        record_seeds=spec.record_seeds,
        batch=spec.batch,
    )


def provenance(
    scenario: Scenario, command: str, code: tuple[str, ...], files: tuple[CopiedFile, ...]
) -> dict[str, Any]:
    """The fields of `Provenance`, as they are now; `code` are the specs of users' classes."""
    return {
        "scenario": scenario.name,
        "command": command,
        "began_utc": WallClock().utc_stamp(),
        "versions": versions(),
        "cpu": cpu(),
        "modules": module_digests(code),
        "files": files,
    }


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


def check_resumable(begun: Provenance, folder: Path, *, force: bool) -> None:
    """BadInput if the scenario's files, or, unless `force`, code, versions or CPU are not as at the beginning."""
    changed = changed_files(begun.files, folder / SCENARIO_FOLDER)
    if changed:
        raise BadInput(f"--resume {folder}", "", f"{SCENARIO_FOLDER}/{changed[0]}")
    changed = [] if force else code_changes(begun)
    if changed:
        more = f" (and {len(changed) - 1} more)" if len(changed) > 1 else ""
        expected = f"{changed[0]}{more}: runs would not be comparable; --force resumes all the same"
        raise BadInput(f"--resume {folder}", "", expected)


def code_changes(begun: Provenance) -> list[str]:
    """Code, versions and CPU that are not as at the beginning, a line each."""
    return changes_since(begun.modules, begun.versions, begun.cpu, [f"{module}:" for module in begun.modules])


def check_same(plan: Plan, campaign: Campaign, folder: Path) -> None:
    """BadInput if a plan is for another campaign than that of the folder."""
    with TemporaryDirectory() as aside:
        planned = campaign_of(plan, Path(aside), "")
    for name in SAME:
        if _plain(planned, name) != _plain(campaign, name):
            what = "another scenario" if name == "files" else f"other {name}"
            expected = f"the campaign in the folder has {what}; --resume alone goes on with it"
            raise BadInput(f"--resume {folder}", name, expected)


def _plain(campaign: Campaign, name: str) -> Any:
    """A field as JSON would keep it: lists and tuples are the same."""
    found: Any = getattr(campaign, name)
    return list(cast("tuple[Any, ...]", found)) if isinstance(found, tuple) else found
