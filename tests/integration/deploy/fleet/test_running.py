"""What runs on robots: started, stopped, told, gone back from, and its logs."""

import json

import pytest

from tests.support.deploy.fleet.small_fleet import AGENT


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
