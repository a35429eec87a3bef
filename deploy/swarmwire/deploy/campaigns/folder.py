"""The beginning of a campaign's or tuning's folder: the scenario with all its files, and their provenance.

A resumed campaign or tuning is compared with this provenance.
"""

import shutil
from collections.abc import Generator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, cast

from swarmwire.comms.base.clock import WallClock
from swarmwire.comms.base.errors import BadInput
from swarmwire.deploy.campaigns.design import Point
from swarmwire.deploy.campaigns.spec import CampaignPlan, overrides_of
from swarmwire.deploy.runs.record.provenance import (
    Copies,
    changed_files,
    changes_since,
    copied_mapping,
    copy_scenario,
    cpu,
    module_digests,
    versions,
)
from swarmwire.metrics.records.campaign.campaign_json import SCENARIO_FOLDER, Provenance
from swarmwire.world.scenario.scenario import Scenario


@contextmanager
def new_folder(folder: Path, kind: str) -> Generator[Path]:
    """Make the folder of a campaign or a tuning, and yield the empty folder for its scenario.

    The folder is empty again after an error within the context. BadInput unless `folder` is new or empty, and can be
    written.
    """
    scenario_folder = folder / SCENARIO_FOLDER
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if any(folder.iterdir()):
            begun = f"to continue a {kind}: `resume`"
            if scenario_folder.is_dir() and not (folder / f"{kind}.json").exists():
                begun = f"a {kind} was interrupted here before its first run: remove {folder}"
            raise BadInput("out", str(folder), f"expected a new or empty folder; {begun}")
        scenario_folder.mkdir()  # fails in all but one of several processes that begin here at once
        try:
            yield scenario_folder
        except BaseException:
            shutil.rmtree(scenario_folder, ignore_errors=True)
            raise
    except OSError as error:
        raise BadInput("out", str(folder), f"expected a folder that can be written: {error.strerror}") from error


def provenance(
    scenario: Scenario, seeds: tuple[int, ...], command: str, code: tuple[str, ...], copies: Copies
) -> dict[str, Any]:
    """Copy the scenario with its files; return the present values of the fields of `Provenance`.

    `code` has the specs of users' classes.
    """
    return {
        "scenario": scenario.name,
        "command": command,
        "began_utc": WallClock().utc_stamp(),
        "versions": versions(),
        "cpu": cpu(),
        "modules": module_digests(code),
        "files": copy_scenario(scenario, seeds, copies),
    }


def copied_overrides(plan: CampaignPlan, point: Point, copies: Copies) -> list[str]:
    """Return the values of a point as overrides of the copied scenario; files that they name are copied, too."""
    if not any(isinstance(value, str | list) for value in point.values()):
        return overrides_of(point)
    copied = copied_mapping(plan.scenario_at(point), copies)
    return overrides_of({path: _value_at(copied, path) for path in point})


def _value_at(mapping: Mapping[str, Any], path: str) -> Any:
    value: Any = mapping
    for key in path.split("."):
        value = cast("list[Any]", value)[int(key)] if isinstance(value, list) else value[key]
    return value


def check_resumable(begun: Provenance, folder: Path, *, force: bool) -> None:
    """Raise BadInput if the scenario's files, or, unless `force`, code or versions have changed."""
    changed = changed_files(begun.files, folder / SCENARIO_FOLDER)
    if changed:
        raise BadInput(f"--resume {folder}", "", f"{SCENARIO_FOLDER}/{changed[0]}")
    changed = [] if force else code_changes(begun)
    if changed:
        more = f" (and {len(changed) - 1} more)" if len(changed) > 1 else ""
        expected = f"{changed[0]}{more}: runs would not be comparable; --force resumes all the same"
        raise BadInput(f"--resume {folder}", "", expected)


def code_changes(begun: Provenance) -> list[str]:
    """Return changes of code and versions since the beginning, a line each."""
    return changes_since(begun.modules, begun.versions, [f"{module}:" for module in begun.modules])
