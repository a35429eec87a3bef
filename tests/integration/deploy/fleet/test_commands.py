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
STOPPED_BY_SSH = "stopped, confirmed by SSH (over the network: no answer)"


@pytest.fixture
def epuck(servers):
    """The port of something that answers where a driver's robot should."""
    return servers.add_port()


def test_check_of_a_usable_host_is_one_line(fleet, robots, epuck):
    fleet.add("flock-0", driver={"address": f"127.0.0.1:{epuck}"})
    code, lines = robots("check")
    assert code == 0, lines
    system, room, clock = r"Python 3\.\d+\.\d+, \w+, glibc 2\.\d+", r"[\d.]+ GB", r"clock [+-]\d+ ms \(within \d+\)"
    for text in (system, room, clock, f":{epuck} answers", "linger is off"):
        assert re.search(text, lines[0]), text
    assert not fleet.hosts["flock-0"].root.exists()


def test_check_fails_for_a_driver_address_without_answer(fleet, robots):
    fleet.add("flock-0")
    code, lines = robots("check")
    assert code == 1
    assert "127.0.0.1:1 does not answer" in lines[0]
    assert "driver.address" in lines[0]


def test_check_offline_prints_settings_without_connecting(fleet, robots):
    host = fleet.add("flock-0")
    fleet.add("flock-1", host, rate_hz=0)
    code, lines = robots("check", "--offline")
    assert code == 1
    for text in ("flock-0 still.py:Still ", "epuck2", "127.0.0.1:1", "10 Hz"):
        assert text in lines[0]
    assert lines[1].startswith(f"flock-1 failed: {fleet.file}: robots.flock-1.rate_hz: ")
    assert host.commands == []


def test_check_fails_for_an_agent_whose_needs_the_driver_lacks(fleet, robots, epuck):
    fleet.add("flock-0", driver={"address": f"127.0.0.1:{epuck}"})
    fleet.agent((fleet.folder / "still.py").read_text().replace("needs = ()", 'needs = ("positioning",)'))
    assert "agent: Still needs 'positioning'" in robots("check")[1][0]


def test_check_reports_a_wrong_clock_with_a_remedy(fleet, robots, epuck, monkeypatch):
    fleet.add("flock-0", driver={"address": f"127.0.0.1:{epuck}"})
    monkeypatch.setattr(check_module, "MAX_CLOCK_OFFSET_NS", -(10**12))
    assert "run NTP" in robots("check")[1][0]


def test_trust_adds_keys_of_new_hosts_and_no_changed_keys(fleet, robots, epuck):
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


def test_trust_reports_hosts_that_do_not_answer(fleet, robots):
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
    stopped = list[str]()
    session = open_swarm(network, access, small=False)

    def control(query):
        with query:
            assert query.payload.to_string() == ESTOP
            stopped.append(str(query.key_expr).rpartition("/")[2])
            query.reply(query.key_expr, answer)

    declared = [session.declare_queryable(KEYS.control(robot), control) for robot in robots]
    try:
        assert declared
        yield int(endpoints_of(session, network)[0].rpartition(":")[2]), stopped
    finally:
        close_session(session)


@pytest.fixture
def impatient(monkeypatch):
    """A short wait for replies over the network."""
    monkeypatch.setattr(estop_module, "NETWORK_TIMEOUT_S", 0.2)


def test_estop_stops_over_both_routes(fleet, robots):
    host = fleet.add("flock-0")
    robots("deploy")
    robots("start")
    with on_network(["flock-0"]) as (port, stopped):
        fleet.change("flock-0", network_port=port)
        assert robots("estop") == (0, ["flock-0 stopped, confirmed over the network and by SSH"])
    assert stopped == ["flock-0"]
    assert (host.root / "flock-0" / "log" / "stopped").exists()


def test_estop_is_confirmed_by_ssh_alone(fleet, robots, impatient):
    host = fleet.add("flock-0")
    fleet.add("flock-1", host)
    robots("deploy")
    robots("start")
    assert robots("estop") == (0, [f"flock-{i} {STOPPED_BY_SSH}" for i in (0, 1)])
    assert (host.root / "flock-1" / "log" / "stopped").exists()


def test_estop_shows_a_confirmation_and_the_fault_of_the_other_route(fleet, robots):
    fleet.add("flock-0")
    with on_network(["flock-0"]) as (port, _):
        fleet.change("flock-0", network_port=port)
        (fleet.folder / "known_hosts").write_bytes(b"\xff\xfe")
        code, (line,) = robots("estop")
    assert (code, line.partition(" (")[0]) == (0, "flock-0 stopped, confirmed over the network")
    assert f"{fleet.folder}/known_hosts" in line


def test_estop_reports_an_unconfirmed_robot_and_stops_the_others(fleet, robots, impatient):
    fleet.add("good")
    fleet.servers.close(fleet.add("lost"))
    robots("deploy", "--robots", "good")
    code, lines = robots("estop")
    assert code == 1
    assert lines[0] == f"good {STOPPED_BY_SSH}"
    assert lines[1].startswith("lost failed: NOT CONFIRMED: over the network: no answer; by SSH: pi@127.0.0.1:")
    assert lines[1].endswith("; switch it off by hand")


def test_estop_does_not_accept_another_reply_as_stopped(fleet, robots):
    fleet.servers.close(fleet.add("flock-0"))
    with on_network(["flock-0"], "the driver is lost") as (port, _):
        fleet.change("flock-0", network_port=port)
        code, lines = robots("estop")
    assert code == 1
    assert "over the network: the driver is lost" in lines[0]


def test_estop_without_the_operators_certificate_stops_by_ssh(fleet, robots, lab_certificates):
    fleet.add("flock-0")
    lab_certificates("flock-0")
    robots("deploy")
    code, lines = robots("estop")
    assert code == 0
    assert lines[0].startswith("flock-0 stopped, confirmed by SSH (over the network: ")
    assert "operator" in lines[0]


def test_estop_with_certificates_needs_the_operators_own(fleet, robots, lab_certificates):
    fleet.servers.close(fleet.add("flock-0"))
    lab_certificates("flock-0", "operator")
    folder = fleet.folder / "certs"
    files = {"ca": folder / "ca.pem", "certificate": folder / "flock-0.pem", "key": folder / "flock-0.key"}
    robot = Network(listen=("tls/127.0.0.1:0",), **files)
    with on_network(["flock-0"], network=robot, access=access_control(KEYS, ["flock-0"], "flock-0")) as (port, stopped):
        fleet.change("flock-0", network_port=port)
        assert robots("estop")[1][0].startswith("flock-0 stopped, confirmed over the network (by SSH: ")
        fleet.table["operator"] = "flock-0"  # a robot's certificate, which may stop nobody
        fleet.write()
        assert robots("estop")[1][0].startswith("flock-0 failed: NOT CONFIRMED: over the network: ")
    assert stopped == ["flock-0"]


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
    """Return the first robot's status."""
    return json.loads(robots("status", "--json")[1][0])[0]


def test_start_runs_the_current_release_until_stop(robots, host):
    release = host.current("flock-0")
    assert not (host.home / ".linger").exists()
    assert robots("logs")[1][0].startswith("flock-0 failed: has no log")
    for result in ("started", "runs already"):
        assert robots("start") == (0, [f"flock-0 {result}: {release}"])
    state = runs(robots)
    assert (state["unit"], state["release"]) == ("active (running)", release)
    assert state["since"] == "2026-11-21 12:00:00 UTC"
    assert (host.home / ".linger").exists()
    assert robots("stop") == (0, ["flock-0 stopped"])
    assert robots("stop") == (0, ["flock-0 did not run"])
    assert (host.root / "flock-0" / "log" / "stopped").read_text() == "stopped\n"  # its motors
    assert runs(robots)["unit"] == "inactive (dead)"


def test_start_after_an_emergency_stop_fails_until_stop(robots, host):
    robots("start")
    status = {"state": "estop", "tick": 43, "late_ticks": 0, "charge": None}  # confirmed over the network: it runs on
    (host.root / "flock-0" / "log" / "flock-0-status.json").write_text(json.dumps(status))
    code, lines = robots("start")
    assert code == 1
    assert lines[0] == "flock-0 failed: an emergency stop keeps its motors off; swarmwire robots stop, then start"
    assert robots("stop")[0] == 0
    assert robots("start") == (0, [f"flock-0 started: {host.current('flock-0')}"])


def test_start_without_linger_is_refused(robots, host):
    (host.bin / "loginctl").write_text("#!/bin/sh\necho 'Access denied' >&2; exit 1\n")
    code, lines = robots("start")
    assert code == 1
    assert "Access denied" in lines[0]
    assert "sudo loginctl" in lines[0]


def test_start_without_a_release_fails_and_stop_succeeds(fleet, robots):
    fleet.add("flock-0")
    code, lines = robots("start")
    assert (code, lines[0].startswith("flock-0 failed: "), "robots deploy" in lines[0]) == (1, True, True)
    assert robots("stop")[0] == 0
    assert runs(robots)["unit"] == "never deployed"


def test_deploy_restarts_a_running_robot_only_with_restart(fleet, robots, host):
    first = host.current("flock-0")
    robots("start")
    second = deployed(fleet, robots, host, 2)
    assert runs(robots)["release"] == f"{first} (next: {second})"
    third = deployed(fleet, robots, host, 3, "--restart")
    assert runs(robots)["release"] == third


def test_deploy_keeps_a_running_release(fleet, robots, host):
    first = host.current("flock-0")
    robots("start")
    later = [deployed(fleet, robots, host, number) for number in range(4)]
    assert host.releases("flock-0") == sorted([first, *later[1:]])


def test_rollback_goes_back_step_by_step_until_the_first_release(fleet, robots, host):
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


def test_deploy_after_a_rollback_deploys_the_release_again(fleet, robots, host):
    first, second = host.current("flock-0"), deployed(fleet, robots, host, 2)
    robots("rollback")
    assert host.current("flock-0") == first
    assert robots("deploy") == (0, [f"flock-0 deployed {second}"])
    assert robots("rollback") == (0, [f"flock-0 back to {first}"])


def test_status_is_a_table(fleet, robots, host):
    robots("start")
    fleet.add("flock-1")
    fleet.servers.close(fleet.hosts["flock-1"])
    code, lines = robots("status")
    assert code == 1
    assert lines[0] == "robot unit release since tick late charge agent"
    assert lines[1] == f"flock-0 active (running) {host.current('flock-0')} 2026-11-21 12:00:00 UTC 42 1 50% running"
    assert lines[2].startswith("flock-1 failed: pi@127.0.0.1:")
    assert len(lines) == 3


def test_status_of_a_host_without_unit_states_is_a_fault(fleet, robots, host):
    other = fleet.add("flock-1")
    (other.bin / "systemctl").write_text('#!/bin/sh\ntest "$2" = show || echo running\n')
    for verb, good in (("status", "inactive (dead)"), ("stop", "did not run")):
        code, lines = robots(verb)
        assert code == 1
        assert sum(line.startswith("flock-0") and good in line for line in lines) == 1
        assert sum(line.startswith("flock-1 failed: ") and "swarmwire-flock-1.service" in line for line in lines) == 1


def test_check_of_a_machine_without_systemd_names_it(fleet, robots, host):
    (host.bin / "systemctl").write_text("#!/bin/sh\necho offline; exit 1\n")
    for verb in ("check", "deploy", "start"):
        code, lines = robots(verb)
        assert code == 1
        assert "does not run systemd" in lines[0]


def test_stop_reports_robots_whose_motors_may_run(robots, host):
    robots("start")
    (host.root / "flock-0" / "log" / "stopped").mkdir()  # where the program that stops them writes to
    code, lines = robots("stop")
    assert code == 1
    assert "(exit-code)" in lines[0]
    assert "motors" in lines[0]


def test_logs_are_shown_with_robot_names(fleet, robots, host):
    robots("start")
    robots("stop")
    assert robots("logs") == (0, ["flock-0 it runs"])


def test_fetch_copies_the_last_log_and_replaces_the_previous_one(robots, host, tmp_path):
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


def test_fetch_replaces_only_logs(robots, host, tmp_path):
    (tmp_path / "flock-0").mkdir()
    assert robots("logs", "--fetch", tmp_path)[0] == 2
    assert robots("logs", "--fetch", tmp_path / "new")[1][0].startswith("flock-0 failed: has no log")
    (tmp_path / "file").touch()
    code, lines = robots("logs", "--fetch", tmp_path / "file")
    assert (code, len(lines)) == (2, 1)
    assert lines[0].startswith(f"error: --fetch: {tmp_path}/file: ")


def test_host_drives_two_crazyflies_over_two_radios(fleet, robots, impatient):
    sheet = ROOT / "scenarios" / "robots" / "crazyflie.toml"
    (fleet.folder / "crazyflie.toml").write_bytes(sheet.read_bytes())
    fleet.table["defaults"] |= {"body": "crazyflie.toml", "driver": {"name": "crazyflie"}}
    base = fleet.add("cf-0", driver={"address": "radio://0/80/2M/E7E7E7E701"})
    fleet.add("cf-1", base, driver={"address": "radio://0/90/2M/E7E7E7E702"})
    code, lines = robots("deploy")
    assert (code, len(lines), base.commands) == (2, 1, [])
    assert "robots.cf-1.driver.address: expected another device than Crazyradio 0 " in lines[0]

    fleet.change("cf-1", driver={"address": "radio://1/90/2M/E7E7E7E702"})
    assert [line.split()[:2] for line in robots("deploy")[1]] == [["cf-0", "deployed"], ["cf-1", "deployed"]]
    first = base.current("cf-1")
    fleet.change("cf-1", max_linear_mps=0.2)
    assert "deployed" in robots("deploy")[1][1]
    assert [line.split()[1] for line in robots("start")[1]] == ["started:", "started:"]
    assert robots("estop") == (0, [f"{name} {STOPPED_BY_SSH}" for name in ("cf-0", "cf-1")])
    assert robots("rollback", "--robots", "cf-1") == (0, [f"cf-1 back to {first}"])
