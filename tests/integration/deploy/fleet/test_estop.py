"""The emergency stop: by the swarm's network, by SSH, by both, by neither."""

from contextlib import contextmanager

import pytest

from swarmwire.comms.wire.access_control import access_control
from swarmwire.comms.wire.keys import SwarmKeys
from swarmwire.comms.wire.network import Network
from swarmwire.comms.wire.robot_network import ESTOP, STOPPED, endpoints_of, open_swarm
from swarmwire.comms.wire.sessions import close_session
from swarmwire.deploy.fleet import units as estop_module

PLAIN = Network(listen=("tcp/127.0.0.1:0",))
KEYS = SwarmKeys("lab")


@contextmanager
def on_network(robots: list[str], answer: str = STOPPED, network: Network = PLAIN, access=None):
    """Robots in the swarm's network, which answer an emergency stop: yields their port, and who was asked."""
    asked = list[str]()
    session = open_swarm(network, access, small=False)

    def control(query):
        with query:
            assert query.payload.to_string() == ESTOP
            asked.append(str(query.key_expr).rpartition("/")[2])
            query.reply(query.key_expr, answer)

    declared = [session.declare_queryable(KEYS.control(robot), control) for robot in robots]
    try:
        assert declared
        yield int(endpoints_of(session, network)[0].rpartition(":")[2]), asked
    finally:
        close_session(session)


@pytest.fixture
def impatient(monkeypatch):
    """Who is not there will not come."""
    monkeypatch.setattr(estop_module, "NETWORK_S", 0.2)


def test_robots_are_stopped_both_ways(fleet, robots):
    host = fleet.add("flock-0")
    robots("deploy")
    robots("start")
    with on_network(["flock-0"]) as (port, asked):
        fleet.table["robots"]["flock-0"]["network_port"] = port
        fleet.write()
        assert robots("estop") == (0, ["flock-0 stopped, confirmed over the network and by SSH"])
    assert asked == ["flock-0"]
    assert (host.root / "flock-0" / "log" / "stopped").exists()


def test_ssh_alone_is_enough(fleet, robots, impatient):
    host = fleet.add("flock-0")
    fleet.add("flock-1", host)
    robots("deploy")
    robots("start")
    assert robots("estop") == (
        0,
        [f"flock-{i} stopped, confirmed by SSH (over the network: no answer)" for i in (0, 1)],
    )
    assert (host.root / "flock-1" / "log" / "stopped").exists()


def test_the_network_alone_is_enough(fleet, robots):
    fleet.servers.close(fleet.add("flock-0"))
    with on_network(["flock-0"]) as (port, _):
        fleet.table["robots"]["flock-0"]["network_port"] = port
        fleet.write()
        code, lines = robots("estop")
    assert code == 0
    assert lines[0].startswith("flock-0 stopped, confirmed over the network (by SSH: pi@127.0.0.1:")


def test_what_one_way_lacks_does_not_hide_what_the_other_says(fleet, robots):
    fleet.add("flock-0")
    with on_network(["flock-0"]) as (port, _):
        fleet.table["robots"]["flock-0"]["network_port"] = port
        fleet.write()
        (fleet.folder / "known_hosts").write_bytes(b"\xff\xfe")
        code, (line,) = robots("estop")
    assert (code, line.partition(" (")[0]) == (0, "flock-0 stopped, confirmed over the network")
    assert f"{fleet.folder}/known_hosts" in line


def test_a_robot_that_neither_way_confirms_is_told_and_holds_up_no_other(fleet, robots, impatient):
    fleet.add("good")
    fleet.servers.close(fleet.add("lost"))
    robots("deploy", "--robots", "good")
    code, lines = robots("estop")
    assert code == 1
    assert lines[0] == "good stopped, confirmed by SSH (over the network: no answer)"
    assert lines[1].startswith("lost failed: NOT CONFIRMED: over the network: no answer; by SSH: pi@127.0.0.1:")
    assert lines[1].endswith("; switch it off by hand")


def test_a_robot_that_says_otherwise_is_not_taken_as_stopped(fleet, robots):
    fleet.servers.close(fleet.add("flock-0"))
    with on_network(["flock-0"], "the driver is lost") as (port, _):
        fleet.table["robots"]["flock-0"]["network_port"] = port
        fleet.write()
        code, lines = robots("estop")
    assert code == 1
    assert "over the network: the driver is lost" in lines[0]


def test_without_the_operators_certificate_ssh_still_stops(fleet, robots, lab_certificates):
    fleet.add("flock-0")
    lab_certificates("flock-0")
    robots("deploy")
    code, lines = robots("estop")
    assert code == 0
    assert lines[0].startswith("flock-0 stopped, confirmed by SSH (over the network: ")
    assert "operator" in lines[0]


def test_with_certificates_the_operator_is_asked_for_its_own(fleet, robots, lab_certificates):
    fleet.servers.close(fleet.add("flock-0"))
    lab_certificates("flock-0", "operator")
    folder = fleet.folder / "certs"
    files = {"ca": folder / "ca.pem", "certificate": folder / "flock-0.pem", "key": folder / "flock-0.key"}
    robot = Network(listen=("tls/127.0.0.1:0",), **files)
    with on_network(["flock-0"], network=robot, access=access_control(KEYS, ["flock-0"], "flock-0")) as (port, asked):
        fleet.table["robots"]["flock-0"]["network_port"] = port
        fleet.write()
        assert robots("estop")[1][0].startswith("flock-0 stopped, confirmed over the network (by SSH: ")
        fleet.table["operator"] = "flock-0"  # a robot's certificate, which may stop nobody
        fleet.write()
        assert robots("estop")[1][0].startswith("flock-0 failed: NOT CONFIRMED: over the network: ")
    assert asked == ["flock-0"]
