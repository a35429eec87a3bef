"""Whether a campaign that was begun can be gone on with: by the same code, from the same files, as the same design."""

from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Protocol, cast

from swarmwire.comms.errors import BadInput
from swarmwire.deploy.campaign.campaign import SCENARIO_FOLDER, Campaign
from swarmwire.deploy.campaign.campaign_start import campaign_of
from swarmwire.deploy.campaign.plan import Plan
from swarmwire.deploy.record import machine
from swarmwire.deploy.record.modules import changed_modules, module_digests
from swarmwire.deploy.record.scenario_copy import CopiedFile, changed_files

SAME = ("files", "overrides", "design", "seeds", "vary", "points")  # of a plan and of the campaign that it goes on with


class Begun(Protocol):
    """Something with a folder that was begun before, a campaign or a tuning."""

    @property
    def files(self) -> tuple[CopiedFile, ...]:
        """In the folder of the scenario."""
        ...

    @property
    def modules(self) -> Mapping[str, str]:
        """sha256 of the installed code, by module."""
        ...

    @property
    def versions(self) -> Mapping[str, str]:
        """Of Python and packages."""
        ...

    @property
    def cpu(self) -> str:
        """The CPU's model."""
        ...


def check_files(campaign: Begun, folder: Path) -> None:
    """BadInput if what the runs are made from is not as it was."""
    changed = changed_files(campaign.files, folder / SCENARIO_FOLDER)
    if changed:
        raise BadInput(f"--resume {folder}", "", f"{SCENARIO_FOLDER}/{changed[0]}")


def check_code(campaign: Begun, folder: Path) -> None:
    """BadInput if code, versions or CPU are not those that the campaign began with."""
    changed = code_changes(campaign)
    if changed:
        more = f" (and {len(changed) - 1} more)" if len(changed) > 1 else ""
        expected = f"{changed[0]}{more}: runs would not be comparable; --anyway goes on all the same"
        raise BadInput(f"--resume {folder}", "", expected)


def code_changes(campaign: Begun) -> list[str]:
    """What is not as it was when the campaign began, a line each."""
    versions, code = machine.versions(), [f"{module}:" for module in campaign.modules]
    changed = [name for name in campaign.versions if campaign.versions[name] != versions.get(name)]
    return [
        *changed_modules(campaign.modules, module_digests(code)),
        *(f"{name} is {versions.get(name, 'not there')}; it was {campaign.versions[name]}" for name in changed),
        *([f"the CPU is {machine.cpu()}; it was {campaign.cpu}"] if machine.cpu() != campaign.cpu else []),
    ]


def check_same(plan: Plan, campaign: Campaign, folder: Path) -> None:
    """BadInput if a plan is for another campaign than that of the folder."""
    with TemporaryDirectory() as aside:
        wanted = campaign_of(plan, Path(aside), "")
    for name in SAME:
        if _said(wanted, name) != _said(campaign, name):
            what = "another scenario" if name == "files" else f"other {name}"
            expected = f"the campaign in the folder has {what}; --resume alone goes on with it"
            raise BadInput(f"--resume {folder}", name, expected)


def _said(campaign: Campaign, name: str) -> Any:
    """What a campaign says of this, as JSON would keep it: lists and tuples are the same."""
    found: Any = getattr(campaign, name)
    return list(cast("tuple[Any, ...]", found)) if isinstance(found, tuple) else found
