"""What users rely on is only changed on purpose, and what is written for another version is refused in one line."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgpack
import pytest

from swarmwire.agent import API_VERSION
from swarmwire.agent.agent import NoAgent, load_agent
from swarmwire.agent.on_robot.settings import read_settings
from swarmwire.agent.radios.zenoh_radio import PacketHeader
from swarmwire.comms.base.config import check_format
from swarmwire.comms.base.errors import BadFrame, BadInput
from swarmwire.comms.observe.run_views import ObservedRun
from swarmwire.comms.wire import control_frames, frames, observer_frames
from swarmwire.comms.wire.join import JoinRequest, SessionInfo
from swarmwire.comms.wire.radio_bridge import BridgeInfo
from swarmwire.deploy import RunFolder
from swarmwire.deploy.campaigns.spec import campaign_file
from swarmwire.deploy.campaigns.tuning.spec import read_tuning
from swarmwire.deploy.robots.certificates.register import Register
from swarmwire.deploy.robots.fleet_file import read_fleet
from swarmwire.deploy.runs.record.inputs import LENGTH_BYTES, recorded_inputs
from swarmwire.deploy.runs.record.provenance import read_facts
from swarmwire.metrics.real.real_log.robot_log import read_about_robot
from swarmwire.metrics.records.campaign.campaign_json import read_campaign
from swarmwire.metrics.records.campaign.folder import CampaignFolder
from swarmwire.metrics.records.run_folder.verify import verify
from swarmwire.world.scenario_file import load_scenario
from tests.support.agent.runners import assigned_robots
from tests.tools.stable import lists

FILES: dict[str, tuple[str, Callable[[Path], Any]]] = {
    "scenario": ("scenario.toml", load_scenario),
    "campaign file": ("campaign.toml", campaign_file),
    "fleet": ("fleet.toml", read_fleet),
    "robot settings": ("robot.toml", lambda at: read_settings(at, {})),
    "summary": ("summary.json", lambda at: RunFolder(at.parent).summary),
    "static": ("static.json", lambda at: RunFolder(at.parent).static),
    "tables": ("static.json", lambda at: RunFolder(at.parent).ticks()),
    "run": ("run.json", lambda at: RunFolder(at.parent).measured),
    "run to repeat": ("run.json", lambda at: read_facts(at.parent)),
    "campaign": ("campaign.json", lambda at: read_campaign(at.parent)),
    "campaign results": ("campaign.json", lambda at: CampaignFolder(at.parent)),
    "tuning": ("tuning.json", lambda at: read_tuning(at.parent)),
    "robot log": ("robot.json", read_about_robot),
    "certificates": ("certs.json", lambda at: Register.read(at.parent)),
}
NEWER = "expected 1, got 2: made by a newer swarmwire; upgrade to read it"
NUMBERS = (
    (2, NEWER), (0, "expected 1, got 0"), (None, "is missing: expected 1"),
    ("1", "expected 1, got '1'"), (True, "expected 1, got True"),
)  # fmt: skip


def fault_of(read: Callable[[Path], Any], path: Path) -> BadInput | None:
    try:
        read(path)
    except BadInput as fault:
        return fault
    return None


def written(path: Path, number: object) -> None:
    """A file that holds this format number, or none, and a key that no format has."""
    held = {"weather": "fine", **({} if number is None else {"format": number})}
    toml = "\n".join(f"{key} = {json.dumps(value)}" for key, value in held.items())
    path.write_text(toml if path.suffix == ".toml" else json.dumps(held))


@pytest.mark.parametrize(("number", "message"), NUMBERS)
@pytest.mark.parametrize("kind", FILES)
def test_file_of_another_format_is_refused_by_its_format_alone(kind, number, message, tmp_path):
    name, read = FILES[kind]
    written(tmp_path / name, number)
    with pytest.raises(BadInput) as caught:
        read(tmp_path / name)
    assert str(caught.value) == f"{tmp_path / name}: format: {message}"


@pytest.mark.parametrize("kind", FILES)
def test_file_of_the_current_format_passes_the_format_check(kind, tmp_path):
    name, read = FILES[kind]
    written(tmp_path / name, 1)
    fault = fault_of(read, tmp_path / name)
    assert fault is None or fault.key != "format"


def test_file_of_an_older_format_names_the_version_that_reads_it():
    with pytest.raises(BadInput, match="^a: format: expected 3, got 2: made by an older swarmwire; that one reads it$"):
        check_format({"format": 2}, 3, "a")


def test_verify_names_the_format_of_each_file(tmp_path):
    for name in ("summary.json", "static.json", "run.json"):
        written(tmp_path / name, 2)
    findings = {finding.part: finding.text for finding in verify(tmp_path)}
    assert all(NEWER in findings[name] for name in ("summary.json", "static.json", "run.json"))


def packed(**values: Any) -> bytes:
    return msgpack.packb({key: value for key, value in values.items() if value is not None})


def frame(kind: str, number: Any) -> frames.Frame:
    return frames.Frame(kind, -1, {}, {} if number is None else {"version": number})


WIRE: dict[str, tuple[type[Exception], Callable[[Any], Any]]] = {
    "frame": (BadFrame, lambda v: frames.decode(packed(v=v, kind="", tick=0, arrays={}, values={}))),
    "request to join": (BadFrame, lambda v: JoinRequest.decode(packed(v=v))),
    "offer": (BadFrame, lambda v: SessionInfo.decode(packed(v=v))),
    "assignment": (BadFrame, lambda v: assigned_robots(packed(v=v))),
    "terms of a medium": (BadFrame, lambda v: BridgeInfo.decode(packed(v=v))),
    "scene": (BadFrame, lambda v: observer_frames.decode_scene(frame("scene", v))),
    "truth": (BadFrame, lambda v: observer_frames.decode_truth(frame("truth", v), ObservedRun.__new__(ObservedRun))),
    "control": (BadInput, lambda v: control_frames.decode_request(packed(v=v, do="pause"))),
    "answer to control": (BadFrame, lambda v: control_frames.decode_reply(packed(v=v))),
}


@pytest.mark.parametrize("number", [2, 0, None, True, "1"])
@pytest.mark.parametrize("kind", WIRE)
def test_wire_message_of_another_version_is_refused_in_one_line(kind, number):
    refusal, read = WIRE[kind]
    with pytest.raises(refusal, match=r"^[^\n]*$") as caught:
        read(number)
    assert "expected" in str(caught.value)


@pytest.mark.parametrize("number", [0, 2])
def test_packet_header_of_another_version_is_refused(number):
    packet = PacketHeader(to=-1, sequence=7, sent_utc_ns=1).encode()
    with pytest.raises(BadFrame, match=f"version {number} to -1, expected 1"):
        PacketHeader.decode(bytes([number]) + packet[1:])


@pytest.mark.parametrize("number", [0, 2])
def test_recorded_actions_of_another_version_are_refused(number, tmp_path):
    path = tmp_path / "inputs" / "actions.frames"
    path.parent.mkdir()
    data = packed(v=number, kind="actions", tick=0, arrays={}, values={})
    path.write_bytes(len(data).to_bytes(LENGTH_BYTES, "little") + data)
    with pytest.raises(BadInput) as caught:
        recorded_inputs(tmp_path)
    assert str(caught.value).startswith(f"{path}: frame 0: expected the actions of a tick: ")
    assert str(caught.value).endswith(f"version {number}, expected 1")


AGENT = """
from swarmwire.agent import Agent
class Mine(Agent):
    api = {version}
    def step(self, robot): ...
"""


def load_mine(folder: Path, version: int) -> Any:
    (folder / "mine.py").write_text(AGENT.format(version=version))
    return load_agent(f"{folder / 'mine.py'}:Mine")


def test_agent_of_another_api_version_is_refused(tmp_path):
    assert load_mine(tmp_path, API_VERSION).api == API_VERSION
    for other in (API_VERSION - 1, API_VERSION + 1):
        with pytest.raises(NoAgent, match=rf"\.api: expected {API_VERSION}[^\n]*, got {other}$"):
            load_mine(tmp_path, other)


DECIDE = (
    "no longer there. If that is wanted, raise the version (docs/stability.md says where it stands), tell users in "
    "CHANGELOG.md, and write the list again: `python -m tests.tools.stable.lists`."
)


@pytest.mark.parametrize("name", lists.STABLE)
def test_stable_interface_has_no_removals(name: str):
    assert lists.removed(name) == [], DECIDE


def test_stable_interface_accepts_additions_only(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    (tmp_path / "keys.txt").write_text("# one\na: number\n# two\na: number\nb: text\n")
    monkeypatch.setattr(lists, "place_of", lambda name: tmp_path / f"{name}.txt")
    for now, removed in (
        ("# one\na: number\nz: new\n# two\nb: text\na: number\n# three\n", []),
        ("# one\na: number\n# two\nb: text\n", ["# two: a: number"]),
        ("# one\na: number\n# two\na: number\nb: number\n", ["# two: b: text"]),
    ):
        monkeypatch.setitem(lists.STABLE, "keys", lambda text=now: text)
        assert lists.removed("keys") == removed
