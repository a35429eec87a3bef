"""Targets that an emergency stop reads from a fleet's file, with or without faults."""

from pathlib import Path

import pytest

from swarmwire.comms.base.errors import BadInput
from swarmwire.deploy.robots.fleet import Host
from swarmwire.deploy.robots.fleet_file import read_fleet
from swarmwire.deploy.robots.stop_targets import StopTargets, read_targets
from tests.support.deploy.runs import ROOT

EXAMPLE = ROOT / "examples" / "fleet" / "fleet.toml"
TEXT = EXAMPLE.read_text()


def targets(tmp_path: Path, text: str) -> StopTargets:
    (tmp_path / "fleet.toml").write_text(text)
    return read_targets(tmp_path / "fleet.toml")


def test_stop_targets_of_a_valid_file_are_its_robots():
    fleet, stops = read_fleet(EXAMPLE), read_targets(EXAMPLE)
    for name in ("file", "swarm", "known_hosts", "certificates", "operator"):
        assert getattr(stops, name) == getattr(fleet, name)
    assert [(stop.robot, stop.endpoint, stop.host, stop.groups) for stop in stops.robots] == [
        (robot.name, robot.endpoint, robot.host, robot.groups) for robot in fleet.robots
    ]
    assert (stops.spare_endpoints, stops.faults, stops.insecure) == ((), (), False)


BLOCK = '[robots.flock-1]\naddress = "192.168.1.32"'


@pytest.mark.parametrize(
    "broken",
    [
        BLOCK + "\ncolour = 3",
        BLOCK + "\nrate_hz = ",
        BLOCK + "\nport = 0.5",
        "[robots.flock-1]\naddress = 3",
        "[robots.flock-1]",
        '[robots.flock-1]\naddress = "192.168.1.3',
        '[robots.flock-1\naddress = "192.168.1.32"',
        "[robots.]",
        '[robots."flock 1; reboot"]\naddress = "192.168.1.32"',
    ],
)
def test_stop_targets_with_one_broken_robot_are_all_others(tmp_path, broken):
    assert TEXT.count(BLOCK) == 1
    stops = targets(tmp_path, TEXT.replace(BLOCK, broken))
    expected = [robot for robot in read_targets(EXAMPLE).robots if robot.robot != "flock-1"]
    assert [stop for stop in stops.robots if stop.robot != "flock-1"] == expected
    with pytest.raises(BadInput):
        read_fleet(tmp_path / "fleet.toml")
    (selected, unknown) = stops.select(["flock-0", "flok-3"], [])
    assert [stop.robot for stop in selected] == ["flock-0"]
    assert [error.where for error in unknown] == ["--robots"]


@pytest.mark.parametrize(
    ("line", "changed"),
    [
        ("format = 1", "format = 2"),
        ("format = 1", ""),
        ('known_hosts = "known_hosts"', "known_hosts = 3"),
        ('operator = "operator"', "operator = false"),
        ('agent = "shy.py:Shy"', ""),
        ("rate_hz = 10", "rate_hz = -1"),
        ("params = { near = 0.2 }", "params = { near = 0.2"),
        ("[groups.blue]", "[groups.blue"),
    ],
)
def test_stop_targets_need_only_the_keys_of_addresses(tmp_path, line, changed):
    stops = targets(tmp_path, TEXT.replace(line, changed, 1))
    assert stops.robots == read_targets(EXAMPLE).robots
    assert (stops.swarm, stops.operator, stops.known_hosts) == ("lab", "operator", tmp_path / "known_hosts")


def test_stop_targets_of_one_name_are_two_where_they_differ(tmp_path):
    again = '\n[robots.flock-0]\naddress = "192.168.1.99"\n'
    hosts = [stop.host for stop in targets(tmp_path, TEXT + again).robots if stop.robot == "flock-0"]
    assert hosts == [Host("pi", address, 22, "", "") for address in ("192.168.1.31", "192.168.1.99")]


def test_stop_targets_connect_to_ports_that_a_robot_without_address_may_have(tmp_path):
    robots = "".join(f'[robots.{name}]\naddress = "h"\n' for name in "abc")
    head = 'format = 1\nswarm = "lab"\ninsecure = true\n[defaults]\nuser = "pi"\n'
    good = targets(tmp_path, head + robots)
    assert good.endpoints(good.robots[2:]) == ("tcp/h:7559",)
    stops = targets(tmp_path, head + robots.replace("address", "adress", 1))  # b and c keep their ports
    assert set(stops.endpoints(stops.robots[2:])) == {"tcp/h:7557", "tcp/h:7558", "tcp/h:7559"}


def test_stop_targets_of_a_certificates_register_that_cannot_be_read_are_all(tmp_path):
    (tmp_path / "certs").mkdir()
    (tmp_path / "certs" / "certs.json").write_text("{")
    stops = targets(tmp_path, TEXT)
    assert len(stops.robots) == 4
    assert [fault.where for fault in stops.faults] == [str(tmp_path / "certs" / "certs.json")]
