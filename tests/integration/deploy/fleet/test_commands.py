"""Commands for a fleet: check, estop, start, stop, status."""

import json
import re
from contextlib import contextmanager

import pytest

from swarmwire.comms.wire.access_control import access_control
from swarmwire.comms.wire.keys import SwarmKeys
from swarmwire.comms.wire.network import Network
from swarmwire.comms.wire.robot_network import ESTOP, STOPPED, endpoints_of, open_swarm
from swarmwire.comms.wire.sessions import close_session
from swarmwire.deploy.robots import deploy as check_module
from swarmwire.deploy.robots import estop as estop_module
from tests.support.deploy.fleet.fleets import AGENT
from tests.support.deploy.runs import ROOT

PLAIN = Network(listen=("tcp/127.0.0.1:0",))
KEYS = SwarmKeys("lab")


@pytest.fixture
def epuck(servers):
    """The port of something that answers where a driver's robot should."""
    return servers.add_port()


def test_a_host_that_will_do_is_told_in_a_line(fleet, robots, epuck):
    fleet.add("flock-0", driver={"address": f"127.0.0.1:{epuck}"})
    code, lines = robots("check")
    assert code == 0, lines
    system, room, clock = r"Python 3\.\d+\.\d+, \w+, glibc 2\.\d+", r"[\d.]+ GB", r"clock [+-]\d+ ms \(within \d+\)"
    for told in (system, room, clock, f":{epuck} answers", "linger is off"):
        assert re.search(told, lines[0]), told
    assert not fleet.hosts["flock-0"].root.exists()


def test_a_drivers_address_that_does_not_answer_is_told(fleet, robots):
    fleet.add("flock-0")
    code, lines = robots("check")
    assert code == 1
    assert "127.0.0.1:1 does not answer" in lines[0]
    assert "driver.address" in lines[0]


def test_settings_that_do_not_fit_are_told_by_robot(fleet, robots, epuck):
    address = f"127.0.0.1:{epuck}"
    fleet.add("flock-0", driver={"address": address})
    fleet.add("flock-1", driver={"address": address}, rate_hz=0)
    code, lines = robots("check")
    assert code == 1
    assert "failed" not in lines[0]
    assert lines[1].startswith(f"flock-1 failed: {fleet.file}: robots.flock-1.rate_hz: ")


def test_offline_nothing_is_connected_and_settings_are_told(fleet, robots):
    host = fleet.add("flock-0")
    fleet.add("flock-1", host, rate_hz=0)
    code, lines = robots("check", "--offline")
    assert code == 1
    for told in ("flock-0 still.py:Still ", "epuck2", "127.0.0.1:1", "10 Hz"):
        assert told in lines[0]
    assert lines[1].startswith(f"flock-1 failed: {fleet.file}: robots.flock-1.rate_hz: ")
    assert host.commands == []


def test_an_agent_that_needs_more_than_the_driver_gives_is_told(fleet, robots, epuck):
    fleet.add("flock-0", driver={"address": f"127.0.0.1:{epuck}"})
    fleet.agent((fleet.folder / "still.py").read_text().replace("needs = ()", 'needs = ("positioning",)'))
    assert "agent: Still needs 'positioning'" in robots("check")[1][0]


def test_a_clock_that_is_off_is_told_with_its_cure(fleet, robots, epuck, monkeypatch):
    fleet.add("flock-0", driver={"address": f"127.0.0.1:{epuck}"})
    monkeypatch.setattr(check_module, "MAX_CLOCK_OFFSET_NS", -(10**12))
    assert "run NTP" in robots("check")[1][0]


def test_trust_adds_the_keys_of_new_hosts_once_and_never_those_that_changed(fleet, robots, epuck):
    address = {"address": f"127.0.0.1:{epuck}"}
    old, new = fleet.add("old", driver=address), fleet.add("new", driver=address)
    fleet.know(old)
    fleet.servers.change_key(old)
    code, lines = robots("check", "--trust")
    fingerprint = new.host_key.get_fingerprint()
    assert lines[0].startswith(f"new: 127.0.0.1:{new.port}: ssh-ed25519 {fingerprint}, ")
    assert f"{fleet.folder}/known_hosts" in lines[0]
    assert code == 1
    assert lines[1].startswith("old failed: ")
    assert lines[2].startswith("new Python 3")
    assert not any(line.startswith("new: ") for line in robots("check", "--trust")[1])


def test_trust_tells_hosts_that_do_not_answer(fleet, robots):
    host = fleet.add("off")
    fleet.know()
    fleet.servers.close(host)
    code, lines = robots("check", "--trust")
    assert code == 1
    assert lines[0].startswith(f"new: 127.0.0.1:{host.port}: ")
    assert lines[1].startswith(f"off failed: pi@127.0.0.1:{host.port} does not answer")


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
    monkeypatch.setattr(estop_module, "NETWORK_TIMEOUT_S", 0.2)


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


@pytest.fixture
def host(fleet, robots):
    """The host of flock-0, to which something was deployed."""
    host = fleet.add("flock-0")
    assert robots("deploy")[0] == 0
    return host


def deployed(fleet, robots, host, number: int, *options: object) -> str:
    """Another release: its name."""
    fleet.agent(f"{AGENT}# {number}\n")
    assert robots("deploy", *options)[0] == 0
    return host.current("flock-0")


def runs(robots) -> dict[str, object]:
    """What the first robot's status says."""
    return json.loads(robots("status", "--json")[1][0])[0]


def test_a_started_robot_runs_its_current_release_until_it_is_stopped(robots, host):
    release = host.current("flock-0")
    for said in ("started", "runs already"):
        assert robots("start") == (0, [f"flock-0 {said}: {release}"])
    state = runs(robots)
    assert (state["unit"], state["release"]) == ("active (running)", release)
    assert state["since"] == "2026-11-21 12:00:00 UTC"
    assert robots("stop") == (0, ["flock-0 stopped"])
    assert robots("stop") == (0, ["flock-0 did not run"])
    assert (host.root / "flock-0" / "log" / "stopped").read_text() == "stopped\n"  # its motors
    assert runs(robots)["unit"] == "inactive (dead)"


def test_a_start_does_not_pass_an_emergency_stop_off_as_running(robots, host):
    robots("start")
    status = {"state": "estop", "tick": 43, "late_ticks": 0, "charge": None}  # confirmed over the network: it runs on
    (host.root / "flock-0" / "log" / "flock-0-status.json").write_text(json.dumps(status))
    code, lines = robots("start")
    assert code == 1
    assert lines[0] == "flock-0 failed: an emergency stop keeps its motors off; swarmwire robots stop, then start"
    assert robots("stop")[0] == 0
    assert robots("start") == (0, [f"flock-0 started: {host.current('flock-0')}"])


def test_units_outlive_the_connection_that_started_them(robots, host):
    assert not (host.home / ".linger").exists()
    robots("start")
    assert (host.home / ".linger").exists()


def test_a_host_on_which_units_would_end_is_refused(robots, host):
    (host.bin / "loginctl").write_text("#!/bin/sh\necho 'Access denied' >&2; exit 1\n")
    code, lines = robots("start")
    assert code == 1
    assert "Access denied" in lines[0]
    assert "sudo loginctl" in lines[0]


def test_what_was_never_deployed_neither_starts_nor_needs_to_be_stopped(fleet, robots):
    fleet.add("flock-0")
    code, lines = robots("start")
    assert (code, lines[0].startswith("flock-0 failed: "), "robots deploy" in lines[0]) == (1, True, True)
    assert robots("stop")[0] == 0
    assert runs(robots)["unit"] == "never deployed"


def test_a_deployment_leaves_what_runs_alone_until_it_is_asked_to_restart(fleet, robots, host):
    first = host.current("flock-0")
    robots("start")
    second = deployed(fleet, robots, host, 2)
    assert runs(robots)["release"] == f"{first} (next: {second})"
    third = deployed(fleet, robots, host, 3, "--restart")
    assert runs(robots)["release"] == third


def test_a_release_that_runs_is_kept_whatever_was_deployed_since(fleet, robots, host):
    first = host.current("flock-0")
    robots("start")
    later = [deployed(fleet, robots, host, number) for number in range(4)]
    assert host.releases("flock-0") == sorted([first, *later[1:]])


def test_a_rollback_goes_back_step_by_step_and_is_refused_at_the_first(fleet, robots, host):
    first = host.current("flock-0")
    second, third = deployed(fleet, robots, host, 2), deployed(fleet, robots, host, 3)
    robots("start")
    assert runs(robots)["release"] == third
    assert robots("rollback") == (0, [f"flock-0 back to {second}, restarted"])
    assert runs(robots)["release"] == second
    robots("stop")
    assert robots("rollback") == (0, [f"flock-0 back to {first}"])
    code, lines = robots("rollback")
    assert (code, lines[0].startswith("flock-0 failed: ")) == (1, True)
    assert host.current("flock-0") == first


def test_what_was_gone_back_from_can_be_deployed_again(fleet, robots, host):
    first, second = host.current("flock-0"), deployed(fleet, robots, host, 2)
    robots("rollback")
    assert host.current("flock-0") == first
    assert robots("deploy") == (0, [f"flock-0 deployed {second}"])
    assert robots("rollback") == (0, [f"flock-0 back to {first}"])


def test_a_status_of_all_robots_is_a_table(fleet, robots, host):
    robots("start")
    fleet.add("flock-1")
    fleet.servers.close(fleet.hosts["flock-1"])
    code, lines = robots("status")
    assert code == 1
    assert lines[0] == "robot unit release since tick late charge agent"
    assert lines[1] == f"flock-0 active (running) {host.current('flock-0')} 2026-11-21 12:00:00 UTC 42 1 50% running"
    assert lines[2].startswith("flock-1 failed: pi@127.0.0.1:")
    assert len(lines) == 3


def test_a_host_whose_systemd_tells_no_state_fails_alone_and_in_a_line(fleet, robots, host):
    other = fleet.add("flock-1")
    (other.bin / "systemctl").write_text('#!/bin/sh\ntest "$2" = show || echo running\n')
    for verb, good in (("status", "inactive (dead)"), ("stop", "did not run")):
        code, lines = robots(verb)
        assert code == 1
        assert sum(line.startswith("flock-0") and good in line for line in lines) == 1
        assert sum(line.startswith("flock-1 failed: ") and "swarmwire-flock-1.service" in line for line in lines) == 1


def test_a_machine_without_systemd_is_told_what_agents_need(fleet, robots, host):
    (host.bin / "systemctl").write_text("#!/bin/sh\necho offline; exit 1\n")
    for verb in ("check", "deploy", "start"):
        code, lines = robots(verb)
        assert code == 1
        assert "does not run systemd" in lines[0]


def test_a_robot_that_never_ran_has_no_log_to_show(robots, host):
    code, lines = robots("logs")
    assert (code, lines[0].startswith("flock-0 failed: has no log")) == (1, True)


def test_robots_that_fail_to_stop_their_motors_are_told(robots, host):
    robots("start")
    (host.root / "flock-0" / "log" / "stopped").mkdir()  # where the program that stops them writes to
    code, lines = robots("stop")
    assert code == 1
    assert "(exit-code)" in lines[0]
    assert "motors" in lines[0]


def test_logs_are_shown_by_robot(fleet, robots, host):
    robots("start")
    robots("stop")
    assert robots("logs") == (0, ["flock-0 it runs"])


def test_the_log_of_the_last_start_is_fetched_and_takes_the_place_of_the_one_before(robots, host, tmp_path):
    robots("start")
    robots("stop")
    logs = host.root / "flock-0" / "log"
    (logs / "flock-0-20200101T000000Z").mkdir()
    to = tmp_path / "logs"
    for _ in range(2):
        code, lines = robots("logs", "--fetch", to)
        assert (code, lines) == (0, [f"flock-0 fetched: {to}/flock-0 (0.0 MB packed)"])
    assert json.loads((to / "flock-0" / "robot.json").read_text()) == {"release": host.current("flock-0")}
    assert [path.name for path in to.iterdir()] == ["flock-0"]


def test_a_fetch_replaces_nothing_but_logs(robots, host, tmp_path):
    (tmp_path / "flock-0").mkdir()
    assert robots("logs", "--fetch", tmp_path)[0] == 2
    assert robots("logs", "--fetch", tmp_path / "new")[1][0].startswith("flock-0 failed: has no log")
    (tmp_path / "file").touch()
    code, lines = robots("logs", "--fetch", tmp_path / "file")
    assert (code, len(lines)) == (2, 1)
    assert lines[0].startswith(f"error: --fetch: {tmp_path}/file: ")


def test_one_base_machine_drives_two_crazyflies_each_by_a_radio_of_its_own(fleet, robots, impatient):
    sheet = ROOT / "scenarios" / "robots" / "crazyflie.toml"
    (fleet.folder / "crazyflie.toml").write_bytes(sheet.read_bytes())
    fleet.table["defaults"] |= {"body": "crazyflie.toml", "driver": {"name": "crazyflie"}}
    base = fleet.add("cf-0", driver={"address": "radio://0/80/2M/E7E7E7E701"})
    fleet.add("cf-1", base, driver={"address": "radio://0/90/2M/E7E7E7E702"})
    code, lines = robots("deploy")
    assert (code, len(lines), base.commands) == (2, 1, [])
    assert "robots.cf-1.driver.address: expected another device than Crazyradio 0 " in lines[0]

    fleet.table["robots"]["cf-1"]["driver"]["address"] = "radio://1/90/2M/E7E7E7E702"
    fleet.write()
    assert [line.split()[:2] for line in robots("deploy")[1]] == [["cf-0", "deployed"], ["cf-1", "deployed"]]
    first = base.current("cf-1")
    fleet.table["robots"]["cf-1"]["max_linear_mps"] = 0.2
    fleet.write()
    assert "deployed" in robots("deploy")[1][1]
    assert [line.split()[1] for line in robots("start")[1]] == ["started:", "started:"]
    assert robots("estop") == (
        0,
        [f"{name} stopped, confirmed by SSH (over the network: no answer)" for name in ("cf-0", "cf-1")],
    )
    assert robots("rollback", "--robots", "cf-1") == (0, [f"cf-1 back to {first}"])
