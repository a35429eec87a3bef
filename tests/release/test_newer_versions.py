"""Each kind of file that a later version wrote is refused by whoever reads it, in a line that says so."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from swarmwire.agent.on_robot.settings_file import read_settings
from swarmwire.comms.errors import BadInput
from swarmwire.deploy.campaign.campaign import read_campaign
from swarmwire.deploy.campaign.campaign_file import campaign_table
from swarmwire.deploy.certificates.register import Register
from swarmwire.deploy.fleet.fleet_file import read_fleet
from swarmwire.deploy.record.inputs import RecordedInputs, recorded_inputs
from swarmwire.deploy.record.origin import read_origin
from swarmwire.deploy.tuning.tuning import read_tuning
from swarmwire.metrics.campaign.campaign_folder import CampaignFolder
from swarmwire.metrics.real_log.real_logs import read_real_logs
from swarmwire.metrics.run_folder import RunFolder
from swarmwire.world.scenario.scenario_file import load_scenario
from tests.release.test_records import RECORDS

ROBOT = "flock-0-20261121T120000Z/robot.json"
READERS: dict[str, tuple[str, Callable[[Path], Any]]] = {
    "summary": ("run-2/summary.json", lambda at: RunFolder(at.parent).summary),
    "static": ("run-2/static.json", lambda at: RunFolder(at.parent).static),
    "tables": ("run-2/static.json", lambda at: RunFolder(at.parent).ticks()),
    "origin": ("run-2/run.json", lambda at: read_origin(at.parent)),
    "campaign": ("campaign-1/campaign.json", lambda at: read_campaign(at.parent)),
    "campaign, its table": ("campaign-1/campaign.json", lambda at: CampaignFolder(at.parent)),
    "tuning": ("tuning-1/tuning.json", lambda at: read_tuning(at.parent)),
    "robot's log": (f"robots-1/{ROBOT}", lambda at: read_real_logs(at.parents[1])),
    "certificates": ("certificates-1/certs.json", lambda at: Register.read(at.parent)),
}
TYPED: dict[str, Callable[[Path], Any]] = {
    "scenario.toml": load_scenario,
    "campaign.toml": campaign_table,
    "fleet.toml": read_fleet,
    "robot.toml": lambda at: read_settings(at, {}),
}


def line_of(read: Callable[[Path], Any], path: Path) -> str:
    with pytest.raises(BadInput) as caught:
        read(path)
    return str(caught.value)


@pytest.mark.parametrize("kind", READERS)
def test_what_a_newer_version_wrote_is_refused(kind: str, tmp_path: Path) -> None:
    """What it holds besides may be anything: nothing of it is looked at."""
    name, read = READERS[kind]
    folder = Path(name).parts[0]
    path = shutil.copytree(RECORDS / folder, tmp_path / folder) / Path(name).relative_to(folder)
    known = json.loads(path.read_text())["format"]
    path.write_text(json.dumps({"format": known + 1, "weather": "fine"}))
    expected = f"expected {known}, got {known + 1}: made by a newer swarmwire; upgrade to read it"
    assert line_of(read, path) == f"{path}: format: {expected}"


@pytest.mark.parametrize("name", TYPED)
def test_what_is_written_for_a_newer_version_is_refused(name: str, tmp_path: Path) -> None:
    path = tmp_path / name
    path.write_text('format = 2\nscenario = "s.toml"\nweather = "fine"\n')
    assert line_of(TYPED[name], path) == (
        f"{path}: format: expected 1, got 2: made by a newer swarmwire; upgrade to read it"
    )


def test_frames_of_a_newer_version_in_a_record_are_refused(tmp_path: Path) -> None:
    run = shutil.copytree(RECORDS / "run-2-frames-2", tmp_path / "run")
    path = run / "inputs" / "actions.frames"
    path.write_bytes(path.read_bytes().replace(b"\xa1v\x02", b"\xa1v\x03"))
    line = line_of(lambda _: recorded_inputs(run), path)
    assert line == f"{path}: v: expected 2, got 3: made by a newer swarmwire; upgrade to read it"
    path.write_bytes((4).to_bytes(4, "little") + b"\xc1\xc1\xc1\xc1")
    assert "expected the actions of a tick" in line_of(RecordedInputs, path)
