import hashlib
import math
import re
import tomllib
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.agent.drivers.driver import GROUP, Command, Driver, driver_names, load_driver
from swarmwire.agent.on_robot.controller import Controller, group_of
from swarmwire.agent.on_robot.network_check import check_certificates
from swarmwire.agent.on_robot.plan import (
    POSE_MEASUREMENTS,
    Capabilities,
    RobotConfig,
    SpeedLimits,
    agent_sha256,
    check_needs,
    limits_for,
    robot_config,
    tracked_sensors,
)
from swarmwire.agent.on_robot.settings import NO_FILE, read_settings
from swarmwire.agent.policy_io import PolicyIO
from swarmwire.comms.base.clock import WallClock
from swarmwire.comms.robot.bodies.body import load_body
from swarmwire.comms.robot.packets import NO_TX_STATUSES, ReceivedPackets
from swarmwire.comms.wire.network import Network
from swarmwire.deploy.robots.certificates.folder import begin_authority, issue
from swarmwire.deploy.robots.certificates.register import certificate_request
from tests.support.agent.on_robot.scripted import PLAYERS, DatedFakeClock
from tests.support.agent.policies import saved
from tests.support.refusals import refused_input

ALL_SETTINGS = """
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
FAULTS = {
    "rate_hz = 0": "rate_hz",
    "rate_hz = 2.5": "rate_hz",
    "rate = 10": "rate",
    "watchdog_s = 0": "watchdog_s",
    "watchdog_s = nan": "watchdog_s",
    "max_linear_mps = 0": "max_linear_mps",
    'max_linear_mps = "fast"': "max_linear_mps",
    "max_angular_radps = -1": "max_angular_radps",
    'name = "a/b"': "name",
    "name = 3": "name",
    'swarm = "*"': "swarm",
    'robots = ["robot-0", "a b"]': "robots[1]",
    'robots = ["robot-0", "robot-0"]': "robots",
    'robots = ["robot-1"]': "name",
    'robots = "robot-0"': "robots",
    "robots = []": "robots",
    "params = 3": "params",
    "params = { day = 2026-01-01 }": "params.day",
    'radio = { kind = "zenho" }': "radio.kind",
    'radio = { kind = "zenoh" }': "network",
    "radio = { max_payload_bytes = 1 }": "radio.max_payload_bytes",
    "radio = { size = 3 }": "radio.size",
    'radio = "zenoh"': "radio",
    "tracker = true": "network",
    "tracker = 1": "tracker",
    "network = { listn = [] }": "network.listn",
    'network = { listen = ["tcp/0.0.0.0:7447"] }': "network.listen",
    'network = { listen = ["tls/127.0.0.1:7447"], key = "a.key" }': "network.ca",
    "pace = 0": "pace",
    "seed = -1": "seed",
    "log = false": "log",
    'log = "a\\u0000b"': "log",
}
MISSING = {
    'format = 1\nagent = "a.b:C"': "driver",
    'format = 1\nagent = "a.b:C"\ndriver = { address = "10.0.0.1" }': "driver.name",
    'format = 1\nagent = "a.b:C"\ndriver = "epuck2"': "driver",
    'format = 1\nagent = "a.b:C"\ndriver = { name = 3 }': "driver.name",
    'format = 1\ndriver = { name = "epuck2" }': "agent",
    "format = 1\nagent = ": "",
}
SWARM = {"robots": ["flock-0", "flock-1", "flock-2"], "name": "flock-1"}
ROOT = Path(__file__).parents[4]
BODY = load_body("epuck2")  # it has a compass, and no positioning
SPEEDS = st.floats(-1e3, 1e3)
LIMITS = SpeedLimits(0.1, 2.0, wheel_mps=0.12, wheel_base_m=0.053)


def _file(folder: Path, text: str) -> Path:
    file = folder / "robot.toml"
    file.write_text(text)
    return file


def test_settings_file_is_read_with_paths_relative_to_it(tmp_path):
    settings = read_settings(_file(tmp_path, ALL_SETTINGS), {})
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


def test_settings_need_only_agent_and_driver(tmp_path):
    settings = read_settings(_file(tmp_path, LEAST), {})
    assert (settings.name, settings.robots, settings.index) == ("robot-0", ("robot-0",), 0)
    assert (settings.radio.kind, settings.network, settings.tracker) == ("none", None, False)
    assert (settings.max_linear_mps, settings.log, settings.body) == (None, "", "")


def test_flags_override_the_file_and_replace_it(tmp_path):
    flags: dict[str, tuple[str, Any]] = {
        "agent": ("AGENT", "package.module:Mine"),  # names of modules and bodies are no paths
        "body": ("--body", "epuck"),
        "rate_hz": ("--rate-hz", 5),
        "driver.address": ("--address", "10.0.0.2"),
        "params.gain": ("--param gain", 2),
    }
    settings = read_settings(_file(tmp_path, ALL_SETTINGS), flags)
    assert (settings.agent, settings.body) == ("package.module:Mine", "epuck")
    assert (settings.rate_hz, settings.driver.address, settings.driver.name) == (5, "10.0.0.2", "epuck2")
    assert settings.params == {"gain": 2}
    alone = read_settings(None, {"agent": ("AGENT", "a.b:C"), "driver.name": ("--driver", "epuck2")})
    assert (alone.agent, alone.driver.name, alone.driver.address) == ("a.b:C", "epuck2", "")


@pytest.mark.parametrize(
    ("text", "key"), [*((f"{line}\n{LEAST}", key) for line, key in FAULTS.items()), *MISSING.items()]
)
def test_wrong_or_missing_settings_are_refused_with_file_and_key(tmp_path, text, key):
    file = _file(tmp_path, text)
    with refused_input(file, key):
        read_settings(file, {})


def test_missing_file_is_named_or_else_the_command_line():
    for file, where in ((Path("nowhere.toml"), "nowhere.toml"), (None, NO_FILE)):
        with refused_input(where):
            read_settings(file, {})


@pytest.fixture(scope="module")
def folders(tmp_path_factory) -> tuple[Path, Path]:
    """Two authorities, each with certificates of two robots."""
    authorities: list[Path] = []
    for name in ("lab", "other"):
        folder = tmp_path_factory.mktemp(name) / "ca"
        begin_authority(folder, WallClock())
        issue(folder, [certificate_request("flock-0"), certificate_request("flock-1")], 30, WallClock())
        authorities.append(folder)
    return authorities[0], authorities[1]


def test_certificates_that_do_not_match_are_refused(folders):
    def check(ca: Path, certificate: Path, key: Path) -> None:
        network = Network(listen=("tls/127.0.0.1:0",), ca=ca, certificate=certificate, key=key)
        check_certificates(network, "robot.toml")

    lab, other = folders
    ca, certificate, key = lab / "ca.pem", lab / "flock-0.pem", lab / "flock-0.key"
    check(ca, certificate, key)
    cases = {
        "network.key": (ca, certificate, lab / "flock-1.key"),
        "network.certificate": (other / "ca.pem", certificate, key),
        "network.ca": (key, certificate, key),
    }
    for name, files in cases.items():
        with refused_input("robot.toml", name):
            check(*files)


def _plan(agent: str = "Driving", folder: Path | None = None, **more: Any) -> RobotConfig:
    """The plan of an e-puck2; nothing is connected."""
    spec = agent if agent.endswith(".onnx") else f"{PLAYERS}:{agent}"
    flags = {"agent": spec, "driver.name": "epuck2", "driver.address": "10.0.0.1", **more}
    file = None
    if folder:
        file = folder / "robot.toml"
        file.write_text("format = 1\n")
    settings = read_settings(file, {key: (key, value) for key, value in flags.items()})
    return robot_config(settings, "robot.toml", DatedFakeClock())


def test_parameter_list_gives_each_robot_its_value():
    plan = _plan("Laned", params={"lane": [3, 4, 5]}, **SWARM)
    assert plan.params == {"lane": 4}
    settings = plan.settings
    group = group_of(settings.name, settings.index, settings.agent, plan.params, plan.body, seed=1)
    mind = Controller(group, 10, None, plan.limits)
    assert mind.step(0, {}, ReceivedPackets.none(), NO_TX_STATUSES).command.linear_mps == pytest.approx(0.04)


@pytest.mark.parametrize(
    ("params", "key"), [({"lane": [3, 4]}, "lane"), ({"lane": 0.5}, "lane"), ({"lanes": 1}, "lanes")]
)
def test_wrong_parameters_are_refused(params, key):
    with refused_input("robot.toml", f"params.{key}"):
        _plan("Laned", params=params, **SWARM)


def test_body_defaults_to_that_of_the_driver(tmp_path):
    assert _plan().body.name == "epuck2"
    sheet = tmp_path / "mine.toml"
    sheet.write_text('like = "epuck2"\nmass_kg = 0.2\n')
    plan = _plan(folder=tmp_path, body="mine.toml")
    assert (plan.body.name, plan.body.mass_kg) == ("mine", 0.2)
    sheet.write_text('like = "epuck2"\nmass_kg = -1\n')
    with refused_input(sheet, "mass_kg"):
        _plan(folder=tmp_path, body="mine.toml")


def test_policy_runs_only_on_the_body_of_its_training(tmp_path):
    fitting, other = (
        saved(tmp_path / f"{body}.onnx", body, PolicyIO(sensors=("proximity",))) for body in ("epuck2", "footbot")
    )
    agent = _plan(agent=str(fitting)).agent
    assert agent.needs == ("proximity",)
    assert agent_sha256(agent) == hashlib.sha256(fitting.read_bytes()).hexdigest()
    with refused_input("robot.toml", "agent", "was trained for another body than epuck2"):
        _plan(agent=str(other))


def test_radio_needs_in_a_world_are_checked_after_joining():
    medium = {"radio.kind": "world", "network.connect": ["tcp/127.0.0.1:7447"]}
    assert _plan("Ranging", **medium).settings.radio.kind == "world"
    with refused_input("robot.toml", "agent"):
        _plan("Ranging", **{**medium, "radio.kind": "zenoh"})


def test_shipped_drivers_are_installed():
    shipped = tomllib.loads((ROOT / "agent" / "pyproject.toml").read_text("utf-8"))["project"]["entry-points"][GROUP]
    assert set(shipped) <= set(driver_names())
    for name in shipped:
        kind = load_driver(name, "robot.toml", "driver.name")
        assert issubclass(kind, Driver)
        assert f"{kind.__module__}:{kind.__name__}".startswith("swarmwire.agent.drivers.")


def test_unknown_driver_is_refused_with_the_installed_ones():
    with refused_input("robot.toml", "driver.name", r"epuck2.*ros2.*epuck3"):
        load_driver("epuck3", "robot.toml", "driver.name")


def _offer(
    driver: tuple[str, ...] = ("proximity",), radio: str = "none", tracker: bool = False, body=BODY
) -> Capabilities:
    measured = frozenset(POSE_MEASUREMENTS) if radio == "zenoh" and tracker else frozenset[str]()
    return Capabilities(body, "epuck2", frozenset(driver), radio, measured, tracker)


MET = {
    "of the driver": (("proximity",), _offer()),
    "nothing": ((), _offer(())),
    "the compass from the tracker": (("compass",), _offer(tracker=True)),
    "range and bearing from the tracker": (POSE_MEASUREMENTS, _offer(radio="zenoh", tracker=True)),
}


@pytest.mark.parametrize("case", MET)
def test_met_needs_are_accepted(case):
    check_needs("Mine", *MET[case], "robot.toml")


UNMET = {
    "ground": (_offer(), "the driver epuck2 does not give (it gives proximity)"),
    "compass": (_offer(), "does not give (it gives proximity): expected tracker = true"),
    "camera": (_offer(), "the body epuck2 lacks: it has proximity"),
    "positioning": (_offer(tracker=True), "the body epuck2 lacks"),
    "radio.range": (_offer(), 'needs a radio: expected radio.kind "zenoh" with tracker = true, or radio.kind "world"'),
    "radio.bearing": (_offer(radio="zenoh"), "a real radio does not measure it: expected tracker = true"),
    "radio.tx_status": (
        _offer(radio="zenoh", tracker=True),
        "the radio zenoh does not measure it: it measures radio.bearing",
    ),
    "radio.rssi": (_offer(radio="world"), "the radio world does not measure it: it measures nothing"),
}


@pytest.mark.parametrize("need", UNMET)
def test_unmet_needs_are_refused_with_a_remedy(need):
    offer, message = UNMET[need]
    with refused_input("robot.toml", "agent", f"Mine needs {need!r}, which .*{re.escape(message)}"):
        check_needs("Mine", ("proximity", need), offer, "robot.toml")


def test_tracker_replaces_only_sensors_that_the_driver_lacks():
    needs = ("compass", "positioning", "proximity")
    assert tracked_sensors(needs, _offer(("compass",), tracker=True)) == {"positioning"}
    assert tracked_sensors(needs, _offer(("compass",))) == frozenset()


def test_speed_limits_default_to_half_the_body_limits():
    limits = limits_for(BODY, None, None, "robot.toml")
    assert limits.linear_mps == pytest.approx(0.0691)
    assert limits.angular_radps == pytest.approx(0.1382 / 0.053)
    raised = limits_for(BODY, 0.1382, 5.0, "robot.toml")
    assert (raised.linear_mps, raised.angular_radps) == (0.1382, 5.0)


@pytest.mark.parametrize(("limits", "key"), [((0.14, None), "max_linear_mps"), ((None, 5.3), "max_angular_radps")])
def test_speed_limits_above_the_body_limits_are_refused(limits, key):
    with refused_input("robot.toml", key):
        limits_for(BODY, *limits, "robot.toml")


@given(SPEEDS, SPEEDS, SPEEDS)
def test_speed_limits_scale_commands_and_keep_their_curve(linear, angular, lateral):
    command = Command(linear, angular, lateral, {0: 3})
    got = LIMITS.clipped(command)
    slack = 1.0 + 1e-9
    assert math.hypot(got.linear_mps, got.lateral_mps) <= 0.1 * slack
    assert abs(got.angular_radps) <= 2.0 * slack
    assert abs(got.linear_mps) + 0.5 * 0.053 * abs(got.angular_radps) <= 0.12 * slack
    assert got.linear_mps * angular == pytest.approx(got.angular_radps * linear)
    assert got.leds == {0: 3}
    assert got is command or got != command


def test_speed_limits_leave_slower_commands_and_the_direction_of_infinite_ones():
    command = Command(0.05, -1.0)
    assert LIMITS.clipped(command) is command
    got = LIMITS.clipped(Command(math.inf, 1.0))
    assert got.linear_mps == pytest.approx(0.1)
    assert abs(got.angular_radps) < 1e-3
