"""Settings of a robot: what is read, what is refused by file and key, certificates that go together."""

from pathlib import Path
from typing import Any

import pytest

from swarmwire.agent.on_robot.network_check import check_certificates
from swarmwire.agent.on_robot.settings import NO_FILE, read_settings
from swarmwire.comms.clock import WallClock
from swarmwire.comms.errors import BadInput
from swarmwire.comms.wire.network import Network
from swarmwire.deploy.certificates.folder import begin_authority, issue
from swarmwire.deploy.certificates.register import certificate_request

WHOLE = """
format = 1
name = "flock-3"
swarm = "lab"
robots = ["flock-0", "flock-3"]
agent = "flocking.py:Flock"
params = { gain = 0.5 }
body = "sheet.toml"
rate_hz = 20
watchdog_s = 0.25
max_linear_mps = 0.1
max_angular_radps = 2
driver = { name = "epuck2", address = "192.168.1.23", connect_s = 1.5 }
radio = { kind = "zenoh", max_payload_bytes = 64 }
tracker = true
network = { listen = ["tcp/127.0.0.1:7447"], connect = [], revoked = ["flock-1"], insecure = true }
log = "log"
pace = 2.0
seed = 4
"""
LEAST = 'format = 1\nagent = "mine.py:Mine"\ndriver = { name = "epuck2", address = "192.168.1.23" }\n'


def _file(folder: Path, text: str) -> Path:
    file = folder / "robot.toml"
    file.write_text(text)
    return file


def test_all_that_is_said_is_read_and_paths_lie_beside_the_file(tmp_path):
    settings = read_settings(_file(tmp_path, WHOLE), {})
    assert (settings.name, settings.index, settings.swarm) == ("flock-3", 1, "lab")
    assert settings.robots == ("flock-0", "flock-3")
    assert settings.agent == f"{tmp_path}/flocking.py:Flock"
    assert settings.params == {"gain": 0.5}
    assert (settings.body, settings.log) == (f"{tmp_path}/sheet.toml", f"{tmp_path}/log")
    assert (settings.rate_hz, settings.watchdog_s, settings.pace, settings.seed) == (20, 0.25, 2.0, 4)
    assert (settings.max_linear_mps, settings.max_angular_radps) == (0.1, 2.0)
    assert (settings.driver.name, settings.driver.address) == ("epuck2", "192.168.1.23")
    assert settings.driver.options == {"connect_s": 1.5}
    assert (settings.radio.kind, settings.radio.max_payload_bytes) == ("zenoh", 64)
    assert settings.tracker
    assert settings.network is not None
    assert settings.network.listen == ("tcp/127.0.0.1:7447",)
    assert settings.network.revoked == ("flock-1",)


def test_agent_and_driver_are_all_that_must_be_said(tmp_path):
    settings = read_settings(_file(tmp_path, LEAST), {})
    assert (settings.name, settings.robots, settings.index) == ("robot-0", ("robot-0",), 0)
    assert (settings.radio.kind, settings.network, settings.tracker) == ("none", None, False)
    assert (settings.max_linear_mps, settings.log, settings.body) == (None, "", "")


def test_a_module_and_a_body_by_name_are_no_paths(tmp_path):
    settings = read_settings(
        _file(tmp_path, LEAST), {"agent": ("AGENT", "package.module:Mine"), "body": ("--body", "epuck")}
    )
    assert (settings.agent, settings.body) == ("package.module:Mine", "epuck")


def test_flags_come_before_the_file_and_make_one_unneeded(tmp_path):
    flags: dict[str, tuple[str, Any]] = {
        "rate_hz": ("--rate-hz", 5),
        "driver.address": ("--address", "10.0.0.2"),
        "params.gain": ("--param gain", 2),
    }
    settings = read_settings(_file(tmp_path, WHOLE), flags)
    assert (settings.rate_hz, settings.driver.address, settings.driver.name) == (5, "10.0.0.2", "epuck2")
    assert settings.params == {"gain": 2}
    alone = read_settings(None, {"agent": ("AGENT", "a.b:C"), "driver.name": ("--driver", "epuck2")})
    assert (alone.agent, alone.driver.name, alone.driver.address) == ("a.b:C", "epuck2", "")


FAULTS = {
    "rate_hz = 0": ("rate_hz", "at least 1 Hz"),
    "rate_hz = 2.5": ("rate_hz", "a whole number"),
    "rate = 10": ("rate", "did you mean rate_hz?"),
    "watchdog_s = 0": ("watchdog_s", "at least 0.01 s"),
    "watchdog_s = nan": ("watchdog_s", "a finite number"),
    "max_linear_mps = 0": ("max_linear_mps", "more than 0 m/s"),
    'max_linear_mps = "fast"': ("max_linear_mps", "a number"),
    "max_angular_radps = -1": ("max_angular_radps", "more than 0 rad/s"),
    'name = "a/b"': ("name", "letters"),
    "name = 3": ("name", "a text"),
    'swarm = "*"': ("swarm", "letters"),
    'robots = ["robot-0", "a b"]': ("robots[1]", "letters"),
    'robots = ["robot-0", "robot-0"]': ("robots", "robot-0 twice"),
    'robots = ["robot-1"]': ("name", "did you mean robot-1?"),
    'robots = "robot-0"': ("robots", "a list"),
    "robots = []": ("robots", "at least one"),
    "params = 3": ("params", "a table"),
    "params = { day = 2026-01-01 }": ("params.day", "a number, text"),
    'radio = { kind = "zenho" }': ("radio.kind", "did you mean zenoh?"),
    'radio = { kind = "zenoh" }': ("network", "listen, connect or multicast"),
    "radio = { max_payload_bytes = 1 }": ("radio.max_payload_bytes", "at least 2 B"),
    "radio = { size = 3 }": ("radio.size", "max_payload_bytes"),
    'radio = "zenoh"': ("radio", "a table"),
    "tracker = true": ("network", "listen, connect or multicast"),
    "tracker = 1": ("tracker", "true or false"),
    "network = { listn = [] }": ("network.listn", "did you mean listen?"),
    'network = { listen = ["tcp/0.0.0.0:7447"] }': ("network.listen", "insecure = true"),
    'network = { listen = ["tls/127.0.0.1:7447"], key = "a.key" }': ("network.ca", "is missing"),
    "pace = 0": ("pace", "at least 0.01"),
    "seed = -1": ("seed", "at least 0"),
    "log = false": ("log", "a text"),
    'log = "a\\u0000b"': ("log", "a folder"),
}


@pytest.mark.parametrize("line", FAULTS)
def test_what_is_wrong_is_refused_by_file_and_key_in_one_line(tmp_path, line):
    key, expected = FAULTS[line]
    file = _file(tmp_path, f"{line}\n{LEAST}")
    with pytest.raises(BadInput) as refused:
        read_settings(file, {})
    assert (refused.value.where, refused.value.key) == (str(file), key)
    assert expected in refused.value.expected
    assert "\n" not in str(refused.value)


MISSING = {
    'agent = "a.b:C"': ("driver", 'name = "epuck2"'),
    'agent = "a.b:C"\ndriver = { address = "10.0.0.1" }': ("driver.name", "swarmwire-agent drivers"),
    'agent = "a.b:C"\ndriver = "epuck2"': ("driver", "a table"),
    'agent = "a.b:C"\ndriver = { name = 3 }': ("driver.name", "a text"),
    'driver = { name = "epuck2" }': ("agent", "is missing"),
    "agent = ": ("", "TOML"),
}


@pytest.mark.parametrize("text", MISSING)
def test_what_is_missing_is_named(tmp_path, text):
    key, expected = MISSING[text]
    with pytest.raises(BadInput, match=expected) as refused:
        read_settings(_file(tmp_path, f"format = 1\n{text}"), {})
    assert refused.value.key == key


def test_a_file_that_is_not_there_is_named_and_without_one_the_command_line():
    with pytest.raises(BadInput, match=r"nowhere\.toml: expected a readable file"):
        read_settings(Path("nowhere.toml"), {})
    with pytest.raises(BadInput) as refused:
        read_settings(None, {})
    assert refused.value.where == NO_FILE


@pytest.fixture(scope="module")
def folders(tmp_path_factory) -> tuple[Path, Path]:
    """Two authorities, each with certificates of two robots."""
    made: list[Path] = []
    for name in ("lab", "other"):
        folder = tmp_path_factory.mktemp(name) / "ca"
        begin_authority(folder, WallClock())
        issue(folder, [certificate_request("flock-0"), certificate_request("flock-1")], 30, WallClock())
        made.append(folder)
    return made[0], made[1]


def _check(ca: Path, certificate: Path, key: Path) -> None:
    check_certificates(Network(listen=("tls/127.0.0.1:0",), ca=ca, certificate=certificate, key=key), "robot.toml")


def test_what_goes_together_is_taken(folders):
    lab, _ = folders
    _check(lab / "ca.pem", lab / "flock-0.pem", lab / "flock-0.key")


def test_a_certificate_of_another_key_authority_or_none_is_refused_in_one_line(folders):
    lab, other = folders
    refused = {
        "network.key": (lab / "ca.pem", lab / "flock-0.pem", lab / "flock-1.key"),
        "network.certificate": (other / "ca.pem", lab / "flock-0.pem", lab / "flock-0.key"),
        "network.ca": (lab / "flock-0.key", lab / "flock-0.pem", lab / "flock-0.key"),
    }
    for key, files in refused.items():
        with pytest.raises(BadInput) as error:
            _check(*files)
        assert (error.value.where, error.value.key) == ("robot.toml", key)
        assert "\n" not in str(error.value)
