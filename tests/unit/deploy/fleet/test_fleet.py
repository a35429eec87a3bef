"""The fleet file, packages of robots, and how work on robots is shown."""

import io
import sys
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import tomli_w
from rich.console import Console

from swarmwire.comms.base.errors import BadInput, Interrupted
from swarmwire.deploy.cli.display.robots import progress_watcher
from swarmwire.deploy.cli.robots import run_work
from swarmwire.deploy.robots.archives import ArchiveEntry, name_of, write_archive
from swarmwire.deploy.robots.deploy import release_contents
from swarmwire.deploy.robots.fleet import Fleet, Host, hosts_of
from swarmwire.deploy.robots.fleet_file import FleetTable, RobotTable, read_fleet
from swarmwire.deploy.robots.host_side.messages import HostFacts
from swarmwire.deploy.robots.packages import RobotPlatform, pins
from swarmwire.deploy.robots.release import release_entries, robot_settings
from swarmwire.deploy.robots.result import SILENT, HostFailed, RobotResult, result_lines
from tests.support.deploy.runs import ROOT
from tests.support.refusals import refused_input

EXAMPLE = ROOT / "examples" / "fleet" / "fleet.toml"
LEAST: dict[str, Any] = {
    "format": 1, "swarm": "lab", "insecure": True,
    "defaults": {"user": "pi", "agent": "still.py:Still", "driver": {"name": "epuck2", "address": "e"}},
    "groups": {"red": {}, "blue": {}},
    "robots": {"a": {"address": "10.0.0.1"}, "b": {"address": "10.0.0.2"}},
}  # fmt: skip


def read(tmp_path: Path, **changed: Any) -> Fleet:
    """The fleet of the least file with some tables changed; None takes a key away."""
    table = {key: value for key, value in {**LEAST, **changed}.items() if value is not None}
    (tmp_path / "fleet.toml").write_text(tomli_w.dumps(table))
    return read_fleet(tmp_path / "fleet.toml")


def test_example_fleet_is_read():
    fleet = read_fleet(EXAMPLE)
    assert [robot.name for robot in fleet.robots] == ["flock-0", "flock-1", "flock-2", "flock-3"]
    assert [len(robots) for robots in hosts_of(fleet.robots).values()] == [1, 1, 2]
    assert fleet.robots[3].host == Host("lab", "192.168.1.20", 22, "", "")
    assert fleet.robots[2].settings["params"] == {"near": 0.2, "speed_mps": 0.03}
    assert fleet.robots[2].settings["driver"] == {"name": "epuck2", "address": "192.168.1.43"}


def test_example_agent_fits_its_robots(tmp_path):
    text = EXAMPLE.read_text().replace('certificates = "certs"', "insecure = true")
    (tmp_path / "fleet.toml").write_text(text)
    (tmp_path / "shy.py").write_bytes((EXAMPLE.parent / "shy.py").read_bytes())
    fleet = read_fleet(tmp_path / "fleet.toml")
    contents = release_contents(fleet, fleet.robots)
    assert contents.faults == {}
    assert {entry.name for entry in contents.entries["flock-0"]} == {"robot.toml", "shy.py"}


RADIO = {"name": "crazyflie", "address": "radio://0/80/2M/E7E7E7E701"}
BEHAVIOURS = "swarmwire.agent.behaviours"


@pytest.mark.parametrize(
    ("other", "at", "expected"),
    [
        ("radio://1/80/2M/E7E7E7E702", "10.0.0.1", None),
        ("radio://0/80/2M/E7E7E7E702", "10.0.0.2", None),
        ("radio://0/90/2M/E7E7E7E702", "10.0.0.1", "another device than Crazyradio 0 at pi@10.0.0.1: a has it"),
        ("radio://1/80/2M/e7e7e7e701", "10.0.0.1", "another robot: a has it"),
        ("radio://0/80/2M/E7E7E7E701", "10.0.0.2", "another robot: a has it"),  # in reach of both radios
        ("radio://0/81", "10.0.0.2", None),
        ("radio://0/126/2M/E7E7E7E702", "10.0.0.2", "a URI of cflib"),
        ("80/2M/E7E7E7E702", "10.0.0.2", "a URI of cflib"),
    ],
)
def test_crazyflie_and_crazyradio_belong_to_one_agent(tmp_path, other, at, expected):
    defaults = {"user": "pi", "agent": f"{BEHAVIOURS}:Avoidance", "body": "crazyflie.toml"}
    (tmp_path / "crazyflie.toml").write_bytes((ROOT / "scenarios" / "robots" / "crazyflie.toml").read_bytes())
    drivers = {"a": ("10.0.0.1", RADIO), "b": (at, {**RADIO, "address": other})}
    robots = {name: {"address": host, "driver": driver} for name, (host, driver) in drivers.items()}
    fleet = read(tmp_path, defaults=defaults, robots=robots)
    faults = release_contents(fleet, fleet.robots).faults
    assert "a" not in faults
    assert ("b" in faults) == (expected is not None)
    if expected:
        assert str(faults["b"]).startswith(f"{fleet.file}: robots.b.driver.address: expected {expected}")
    alone = release_contents(fleet, fleet.robots[:1]).faults  # also if the other is not chosen
    assert set(alone) == ({"a"} if expected and "a has it" in expected else set())
    if expected and alone:
        clash = f"{expected.replace('a has it', 'b has it')}; got {RADIO['address']!r}"
        assert str(alone["a"]) == f"{fleet.file}: robots.a.driver.address: expected {clash}"


def test_driver_at_loopback_is_another_robot_on_each_machine(tmp_path):
    driver = {"name": "epuck2", "address": "127.0.0.1:1000"}
    defaults = {**LEAST["defaults"], "agent": f"{BEHAVIOURS}:Avoidance", "driver": driver}
    robots = {name: {"address": at} for name, at in (("a", "10.0.0.1"), ("b", "10.0.0.2"), ("c", "10.0.0.1"))}
    fleet = read(tmp_path, defaults=defaults, robots=robots)
    ((robot, fault),) = release_contents(fleet, fleet.robots).faults.items()
    assert (robot, fault.key) == ("c", "defaults.driver.address")


def test_robot_values_precede_groups_and_these_defaults(tmp_path):
    defaults = {**LEAST["defaults"], "rate_hz": 1, "watchdog_s": 3.0, "seed": 1, "params": {"x": 1, "y": 1, "z": 1}}
    groups = {"red": {"rate_hz": 2, "params": {"y": 2, "z": 2}}, "blue": {"seed": 3, "params": {"z": 3}}}
    robots = {"a": {"address": "h", "groups": ["red", "blue"], "seed": 4}}
    (robot,) = read(tmp_path, defaults=defaults, groups=groups, robots=robots).robots
    assert {key: robot.settings[key] for key in ("rate_hz", "watchdog_s", "seed", "params")} == {
        "rate_hz": 2, "watchdog_s": 3.0, "seed": 4, "params": {"x": 1, "y": 2, "z": 3},
    }  # fmt: skip
    assert (robot.key_paths["rate_hz"], robot.key_paths["seed"]) == ("groups.red.rate_hz", "robots.a.seed")


def test_robots_at_one_address_get_consecutive_ports(tmp_path):
    robots = {
        "a": {"address": "h"}, "b": {"address": "h"}, "c": {"address": "i"},
        "d": {"address": "h", "network_port": 9000},
    }  # fmt: skip
    endpoints = [robot.endpoint for robot in read(tmp_path, robots=robots).robots]
    assert endpoints == ["tcp/h:7557", "tcp/h:7558", "tcp/i:7557", "tcp/h:9000"]
    robots["d"]["network_port"] = 7557
    with refused_input(key="robots.d.network_port"):
        read(tmp_path, robots=robots)


def test_connections_join_each_pair_of_robots_once(tmp_path):
    fleet = read(tmp_path, robots={name: {"address": name} for name in "abc"})
    networks = [robot_settings(fleet, robot, [])["network"] for robot in fleet.robots]
    assert [network.get("connect", []) for network in networks] == [[], ["tcp/a:7557"], ["tcp/a:7557", "tcp/b:7557"]]
    assert all(network["listen"] == ["tcp/0.0.0.0:7557"] for network in networks)


def test_robot_settings_with_certificates_have_keys_and_revoked_names(tmp_path):
    fleet = read(tmp_path, insecure=None, certificates="certs", operator="boss")
    assert fleet.certificates == tmp_path / "certs"
    network = robot_settings(fleet, fleet.robots[0], ["b"])["network"]
    assert network == {
        "listen": ["tls/0.0.0.0:7557"], "ca": "ca.pem", "certificate": "a.pem", "key": "a.key",
        "operator": "boss", "revoked": ["b"],
    }  # fmt: skip


def test_missing_certificate_is_refused_with_the_commands_that_issue_it(tmp_path):
    robots = {"a": {"address": "h", "agent": "swarmwire.agent.behaviours:Flocking"}}
    fleet = read(tmp_path, insecure=None, certificates="certs", robots=robots)
    certs = tmp_path / "certs"
    issue = f"swarmwire certs issue {certs} --fleet {fleet.file}"
    with pytest.raises(BadInput, match=rf"; swarmwire certs init {certs}, then {issue}$"):
        release_entries(fleet, fleet.robots[0], [])
    certs.mkdir()
    (certs / "ca.pem").touch()
    with pytest.raises(BadInput, match=rf"; {issue}$"):
        release_entries(fleet, fleet.robots[0], [])


def test_robot_settings_name_files_in_their_own_folder(tmp_path):
    defaults = {**LEAST["defaults"], "agent": "agents/still.py:Still", "body": "sheets/mine.toml"}
    fleet = read(tmp_path, defaults=defaults)
    settings = robot_settings(fleet, fleet.robots[0], [])
    assert (settings["agent"], settings["body"]) == ("still.py:Still", "mine.toml")
    assert settings["robots"] == ["a", "b"]
    assert tomllib.loads(tomli_w.dumps(settings)) == settings


ROBOT_FAULTS: dict[str, list[Any]] = {  # of robot a, by the key below robots.a
    "": [3],
    ".address": [{}, {"address": 3}, {"address": ""}],
    ".adress": [{"adress": "h"}],
    ".port": [{"address": "h", "port": 0}, {"address": "h", "port": True}],
    ".groups": [{"address": "h", "groups": ["rad"]}],
    ".groups[0]": [{"address": "h", "groups": [1]}],
}


@pytest.mark.parametrize(
    ("changed", "key"),
    [
        *(({"robots": {"a": robot}}, f"robots.a{key}") for key, robots in ROBOT_FAULTS.items() for robot in robots),
        *(({"robots": {name: {"address": "h"}}}, f"robots.{name}") for name in ("a b", "env")),
        *(({"swarm": swarm}, "swarm") for swarm in (None, "a/*")),
        ({"robot": {}}, "robot"),
        ({"robots": {}}, "robots"),
        ({"robots": {"a": {"address": "h"}, "b": {"address": "h", "python": "p"}}}, "robots.b"),
        ({"defaults": {"user": "pi", "address": "h"}}, "defaults.address"),
        ({"groups": {"red": {"groups": ["blue"]}}}, "groups.red.groups"),
        ({"groups": {"red": {"rate_hz": 1.5}}}, "groups.red.rate_hz"),
        ({"insecure": None}, "certificates"),
        ({"certificates": "certs"}, "insecure"),
    ],
)
def test_fleet_file_fault_is_refused_with_its_key(tmp_path, changed, key):
    with refused_input(tmp_path / "fleet.toml", key, "^[^\n]*$"):
        read(tmp_path, **changed)


@pytest.mark.parametrize("text", ["a = ", None])
def test_fleet_file_that_is_not_toml_or_missing_is_refused(tmp_path, text):
    if text is not None:
        (tmp_path / "fleet.toml").write_text(text)
    with refused_input(tmp_path / "fleet.toml"):
        read_fleet(tmp_path / "fleet.toml")


def test_example_fleet_shows_every_key():
    in_example = {line.lstrip("# ").split(" ")[0] for line in EXAMPLE.read_text().splitlines() if " = " in line}
    keys = {*RobotTable.__struct_fields__, *FleetTable.__struct_fields__}
    assert keys - in_example <= {"defaults", "robots", "groups", "insecure", "seed"}


PI = HostFacts(
    python=(3, 11, 2), implementation="cpython", executable="/usr/bin/python3", system="Linux", machine="aarch64",
    bits=64, libc=("glibc", "2.36"), free_bytes=10**10, manager="running",
)  # fmt: skip


def on_python(*version: int) -> RobotPlatform:
    return replace(RobotPlatform.from_facts(PI), python=version)


def pinned(driver: str, *packages: str, python: tuple[int, ...] = (3, 11)) -> set[str]:
    return {pin.name for pin in pins([driver], packages, on_python(*python))}


@pytest.mark.parametrize(
    ("requirement", "is_needed"),
    [
        ("scipy; python_version >= '3.10' and python_version < '3.12'", True),
        ("scipy; python_version >= '3.10' and python_version < '3.11'", False),
        ("scipy; sys_platform == 'win32' or platform_machine == 'aarch64'", True),
        ("scipy; extra == 'fast' and python_version >= '3.12'", False),
        ("scipy (>=1) ; extra == 'fast' or extra == 'slow'", True),
    ],
)
def test_requirement_markers_are_evaluated_for_the_robot(tmp_path, monkeypatch, requirement, is_needed):
    folder = tmp_path / "marked-1.0.dist-info"
    folder.mkdir()
    about = "Metadata-Version: 2.1\nName: marked\nVersion: 1.0\nProvides-Extra: fast\nProvides-Extra: slow\n"
    (folder / "METADATA").write_text(f"{about}Requires-Dist: {requirement}\n")
    with_extra = tmp_path / "outer-1.0.dist-info"
    with_extra.mkdir()
    text = "Metadata-Version: 2.1\nName: outer\nVersion: 1.0\nRequires-Dist: marked[fast]\n"
    (with_extra / "METADATA").write_text(text)
    monkeypatch.syspath_prepend(str(tmp_path))
    names = pinned("epuck2", "outer")
    assert "marked" in names
    assert ("scipy" in names) == is_needed


def test_pins_of_an_agent_and_its_driver():
    assert pinned("epuck2") == {"eclipse-zenoh", "msgpack", "msgspec", "numpy"}
    assert {"rosbags", "lz4", "ruamel-yaml"} <= pinned("ros2", python=sys.version_info[:2])
    assert {"cflib", "pyusb", "libusb-package"} <= pinned("crazyflie")
    assert "scipy" in pinned("epuck2", "scipy")
    with pytest.raises(BadInput, match="^packages: not-there: "):
        pinned("epuck2", "not-there")


@pytest.mark.skipif(sys.version_info >= (3, 14), reason="what older versions need is not installed here")
def test_pins_depend_on_the_robots_python():
    names = {python: pinned("ros2", python=python) for python in ((3, 11), (3, 13), (3, 14))}
    assert names[3, 11] - names[3, 13] == {"typing-extensions"}  # rosbags needs it below 3.12
    assert names[3, 13] - names[3, 14] == {"backports-zstd"}  # and this below 3.14


@pytest.mark.parametrize(
    ("changed", "expected"),
    [
        ({"machine": "armv7l", "bits": 32}, "got armv7l with 32 bits"),
        ({"bits": 32}, "got aarch64 with 32 bits"),
        ({"libc": ("", "")}, "another C library"),
        ({"implementation": "pypy"}, "got pypy"),
    ],
)
def test_platform_without_wheels_is_refused(changed, expected):
    with pytest.raises(HostFailed, match=expected):
        RobotPlatform.from_facts(replace(PI, **changed))


def test_archive_is_equal_for_equal_files(tmp_path):
    entries = [ArchiveEntry("b", b"2"), ArchiveEntry("a", b"1", 0o600), ArchiveEntry("c", link="../a")]
    one, two = write_archive(entries, tmp_path / "1"), write_archive(entries[::-1], tmp_path / "2")
    assert (one.name, one.sha256, one.size) == (two.name, two.sha256, two.size)
    others = ArchiveEntry("b", b"2"), ArchiveEntry("b", b"2", 0o755), ArchiveEntry("b", b"3"), ArchiveEntry("c", b"2")
    assert len({name_of(entries), *(name_of([entry]) for entry in others)}) == 5


def test_missing_extra_is_refused_with_its_name(fleet, robots, monkeypatch):
    fleet.add("flock-0")
    monkeypatch.setattr("swarmwire.comms.base.extras.find_spec", lambda name: None if name == "asyncssh" else name)
    code, (line,) = robots("status")
    assert (code, "swarmwire[fleet]" in line) == (2, True)


def test_result_lines_have_cause_and_remedy_in_one_line():
    failed = RobotResult.failed("b", HostFailed("two\n lines", "mend it"))
    lines = result_lines([RobotResult("long-name", True, "done"), failed])
    assert lines == ["long-name  done", "b          failed: two lines; mend it"]


def test_progress_in_a_terminal_shows_a_bar_per_robot_until_its_end():
    screen = io.StringIO()
    with progress_watcher(Console(file=screen, force_terminal=True, width=100, _environ={"TERM": "xterm"})) as watcher:
        watcher.step("flock-0", "packages", 5_000_000, 10_000_000)
        watcher.step("flock-1", "trial run")
        watcher.end(RobotResult("flock-0", True, "done"))
        watcher.end(RobotResult("flock-2", True, "never began"))
    shown = screen.getvalue()
    assert "flock-1" in shown
    assert "trial run" in shown


def test_progress_without_a_terminal_is_silent():
    with progress_watcher(Console(file=io.StringIO())) as watcher:
        assert watcher is SILENT


def test_ctrl_c_raises_interrupted():
    async def interrupted(_):
        raise KeyboardInterrupt

    with pytest.raises(Interrupted):
        run_work(interrupted)
