"""Deployments, also through OpenSSH."""

import getpass
import re
import stat

import pytest

from swarmwire.deploy.robots import deploy as deploy_module
from swarmwire.deploy.robots import estop
from tests.support.deploy.fleet.fleets import AGENT
from tests.support.deploy.fleet.hosts import new_key, openssh, write_key

STUMBLES = AGENT + "# stumbles on robots\n"
SLOW_TO_WRITE = "ulimit -f 100"  # blocks of half a kilobyte that a file may have: a disk that fills up on the way


def other(number: int) -> str:
    """An agent that differs from others."""
    return f"{AGENT}# {number}\n"


def test_deploy_makes_a_release_with_packages_current(fleet, robots):
    host = fleet.add("flock-0")
    code, lines = robots("deploy")
    assert code == 0, lines
    release = host.current("flock-0")
    assert lines == [f"flock-0 deployed {release} and 0.1 MB of packages"]
    folder = host.root / "flock-0" / "current"
    assert {path.name for path in folder.iterdir()} == {
        "robot.toml", "still.py", "packages-0", "packages-1", "swarmwire-flock-0.service",
    }  # fmt: skip
    assert (folder / "packages-1" / "other" / "large.bin").stat().st_size == 100_000
    assert (host.home / ".config/systemd/user/swarmwire-flock-0.service").exists()
    assert host.parts() == []


def test_deploy_again_changes_nothing(fleet, robots):
    host = fleet.add("flock-0")
    robots("deploy")
    before = host.files()
    code, lines = robots("deploy")
    assert (code, lines) == (0, [f"flock-0 up to date: {host.current('flock-0')}"])
    assert host.files() == before


def test_deploy_sends_only_missing_packages(fleet, robots, packages):
    host = fleet.add("flock-0")
    robots("deploy")
    fleet.agent(other(1))
    _, lines = robots("deploy")
    assert lines == [f"flock-0 deployed {host.current('flock-0')}"]
    packages.version = "2"
    _, lines = robots("deploy")
    assert lines == [f"flock-0 deployed {host.current('flock-0')} and 0.1 MB of packages"]


def test_deploy_keeps_three_releases_and_their_packages(fleet, robots, packages):
    host = fleet.add("flock-0")
    deployed = []
    for number in range(5):
        packages.version = str(number)
        fleet.agent(other(number))
        robots("deploy")
        deployed.append(host.current("flock-0"))
    assert host.releases("flock-0") == sorted(deployed[2:])
    assert len(host.environments()) == 1 + 3  # the agent's program, and three versions of others


def test_deploy_shares_packages_between_robots_of_a_host(fleet, robots, packages):
    host = fleet.add("flock-0")
    fleet.add("flock-1", host, driver={"address": "127.0.0.1:2"})
    code, lines = robots("deploy")
    assert code == 0, lines
    assert [line.split()[:2] for line in lines] == [["flock-0", "deployed"], ["flock-1", "deployed"]]
    assert "packages" not in lines[1]
    assert host.current("flock-0") != host.current("flock-1")
    assert len(host.environments()) == 2
    assert len(host.commands) == 1  # one connection, one program


def test_deploy_selects_robots_by_groups_and_names(fleet, robots):
    fleet.table["groups"] = {"red": {"rate_hz": 20}, "blue": {}}
    hosts = {name: fleet.add(name, groups=groups) for name, groups in (("a", ["red"]), ("b", ["blue"]), ("c", []))}
    assert [line.split()[0] for line in robots("deploy", "--group", "red")[1]] == ["a"]
    assert [line.split()[0] for line in robots("deploy", "--robots", "c", "--group", "blue")[1]] == ["b", "c"]
    settings = {name: (host.root / name / "current" / "robot.toml").read_text() for name, host in hosts.items()}
    assert "rate_hz = 20" in settings["a"]
    assert "rate_hz" not in settings["b"]
    code, lines = robots("deploy", "--group", "rad")
    assert (code, len(lines)) == (2, 1)
    assert lines[0].startswith("error: --group: ")
    assert all(name in lines[0] for name in ("red", "blue", "rad"))


def test_deployed_keys_are_private(fleet, robots, lab_certificates):
    host = fleet.add("flock-0")
    lab_certificates("flock-0", "operator")
    code, lines = robots("deploy")
    assert code == 0, lines
    folder = host.root / "flock-0" / "current"
    assert stat.S_IMODE((folder / "flock-0.key").stat().st_mode) == 0o600
    assert (folder / "ca.pem").exists()
    assert 'listen = [\n    "tls/0.0.0.0:7557",\n]' in (folder / "robot.toml").read_text()


def test_deploy_refuses_a_settings_fault_before_it_connects(fleet, robots):
    host = fleet.add("flock-0", params={"speed": 3})
    code, lines = robots("deploy")
    assert code == 2
    assert lines[0].startswith(f"error: {fleet.file}: robots.flock-0.params.speed: ")
    assert host.commands == []


def fails(robots, name: str) -> str:
    """Deploy to all; the line of the one robot for which it fails, while it works for the others."""
    code, lines = robots("deploy")
    assert code == 1, lines
    assert lines[-1] == f"1 of {len(lines) - 1} failed"
    bad = [line for line in lines[:-1] if " failed: " in line]
    assert [line.split()[0] for line in bad] == [name], lines
    assert all(" deployed " in line or " up to date" in line for line in lines[:-1] if line not in bad), lines
    return bad[0]


def test_deploy_to_a_full_disk_leaves_nothing(fleet, robots):
    good, full = fleet.add("good"), fleet.add("full")
    python = full.python
    full.set_python(f"{SLOW_TO_WRITE}\n{python}")
    line = fails(robots, "full")
    assert "disk is full" in line
    assert full.current("full") is None
    assert (full.environments(), full.releases("full"), full.parts()) == (full.environments()[:1], [], [])
    full.set_python(python)
    assert robots("deploy")[0] == 0
    assert (good.current("good"), full.current("full")) != (None, None)


def test_deploy_to_a_disk_without_space_sends_nothing(fleet, robots, monkeypatch):
    host = fleet.add("flock-0")
    monkeypatch.setattr(deploy_module, "SPARE_BYTES", 10**18)
    code, lines = robots("deploy")
    assert code == 1
    assert "1000000000000 MB" in lines[0]
    assert host.environments() == []


@pytest.mark.parametrize("after", [70_000, 135_000])
def test_deploy_over_a_cut_connection_leaves_the_robot_unchanged(fleet, robots, packages, after):
    packages.size = 400_000
    cut = fleet.add("cut")
    robots("deploy")
    before, release = cut.files(), cut.current("cut")
    fleet.add("good")
    packages.version, packages.size = "2", 500_000
    cut.cut_after = after
    assert "connection was lost" in fails(robots, "cut")
    assert cut.current("cut") == release
    assert before <= cut.files()
    cut.cut_after = None
    code, lines = robots("deploy")
    assert code == 0, lines
    assert cut.parts() == []
    assert cut.current("cut") != release


def test_deploy_removes_remains_of_an_interrupted_deployment(fleet, robots):
    host = fleet.add("flock-0")
    remains = host.root / "flock-0" / "releases" / "0123456789ab.part"
    remains.mkdir(parents=True)
    (remains / "robot.toml").touch()
    (host.root / "env" / "ba9876543210.part").mkdir(parents=True)
    assert robots("deploy")[0] == 0
    assert host.parts() == []


@pytest.mark.parametrize(
    ("script", "text"),
    [
        ("""test "$1" = -c && echo '{"refused": "python", "text": "3.9.2"}'""", "3.9.2"),
        ("echo 'Fatal Python error: no home' >&2; exit 1", "Fatal Python error: no home"),
        ("echo Welcome!", "'Welcome!'"),
    ],
)
def test_unsuitable_python_or_shell_of_a_host_is_reported(fleet, robots, script, text):
    fleet.add("good")
    fleet.add("odd").set_python(script)
    assert text in fails(robots, "odd")


def test_host_without_python_is_reported(fleet, robots):
    fleet.add("good")
    fleet.add("none", python="python-that-is-not-there")
    assert "no python-that-is-not-there" in fails(robots, "none")


def changed_key(fleet):
    fleet.servers.change_key(host := fleet.add("bad"))
    return host


def unknown_key(fleet):
    host = fleet.add("bad")
    fleet.know(fleet.hosts["good"])
    return host


def switched_off(fleet):
    fleet.servers.close(host := fleet.add("bad"))
    return host


def key_not_let_in(fleet):
    write_key(new_key(), fleet.folder / "other")
    return fleet.add("bad", key="other")


def key_with_a_passphrase(fleet):
    new_key().write_private_key(str(fleet.folder / "locked"), "pkcs8-pem", passphrase="secret")
    return fleet.add("bad", key="locked")


@pytest.mark.parametrize(
    ("bad", "message"),
    [
        (changed_key, "another machine.*swarmwire robots check --trust"),
        (unknown_key, "is not in.*swarmwire robots check --trust"),
        (switched_off, "cannot be reached"),
        (key_not_let_in, "ssh-copy-id -p"),
        (key_with_a_passphrase, "/locked cannot be used"),
    ],
)
def test_host_that_refuses_the_login_is_reported_with_a_remedy(fleet, robots, bad, message):
    fleet.add("good")
    host = bad(fleet)
    assert re.search(message, fails(robots, "bad"))
    assert host.commands == []


def test_failed_trial_leaves_the_previous_release(fleet, robots):
    host = fleet.add("flock-0")
    robots("deploy")
    before, files = host.current("flock-0"), host.files()
    fleet.agent(STUMBLES)
    code, lines = robots("deploy")
    assert code == 1
    assert "ImportError: it stumbles" in lines[0]
    assert host.current("flock-0") == before
    assert host.files() == files


def test_failed_trial_with_a_missing_package_names_it(fleet, robots):
    fleet.add("flock-0")
    fleet.agent(AGENT + "# lacks a package on robots\n")
    text = robots("deploy")[1][0]
    assert "ModuleNotFoundError: No module named 'scipy.spatial'" in text
    assert 'packages = ["scipy"]' in text


def test_failed_trial_does_not_stop_other_robots(fleet, robots):
    host = fleet.add("good")
    fleet.add("bad", host, agent="bad.py:Still")
    fleet.add("other")
    (fleet.folder / "bad.py").write_text(STUMBLES)
    fails(robots, "bad")


def test_deploy_to_a_locked_host_is_refused(fleet, robots):
    import fcntl

    host = fleet.add("flock-0")
    host.root.mkdir()
    with (host.root / "lock").open("w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        code, lines = robots("deploy")
    assert code == 1
    assert "another deployment" in lines[0]


def test_deploy_to_a_host_without_systemd_sends_nothing(fleet, robots):
    host = fleet.add("flock-0")
    (host.bin / "systemctl").write_text("#!/bin/sh\necho 'Failed to connect to bus' >&2; exit 1\n")
    code, lines = robots("deploy")
    assert code == 1
    assert "systemd" in lines[0]
    assert host.environments() == []


@pytest.fixture
def host(fleet, tmp_path, client_key):
    """A robot whose host OpenSSH serves."""
    with openssh(tmp_path / "home-flock-0", client_key) as host:
        yield fleet.add("flock-0", host, user=getpass.getuser())


def test_openssh_host_runs_through_all_commands(fleet, robots, host, monkeypatch):
    monkeypatch.setattr(estop, "NETWORK_TIMEOUT_S", 0.2)
    assert robots("deploy")[1] == [f"flock-0 deployed {host.current('flock-0')} and 0.1 MB of packages"]
    first = host.current("flock-0")
    assert robots("deploy") == (0, [f"flock-0 up to date: {first}"])
    assert robots("start") == (0, [f"flock-0 started: {first}"])
    fleet.agent((fleet.folder / "still.py").read_text() + "# another\n")
    _, lines = robots("deploy", "--restart")
    second = host.current("flock-0")
    assert lines == [f"flock-0 deployed {second}, restarted"]
    assert f" active (running) {second} " in robots("status")[1][1]
    assert robots("rollback") == (0, [f"flock-0 back to {first}, restarted"])
    assert robots("logs")[1] == ["flock-0 it runs"] * 3
    assert robots("estop") == (0, ["flock-0 stopped, confirmed by SSH (over the network: no answer)"])
    assert robots("start") == (0, [f"flock-0 started: {first}"])
    assert robots("stop") == (0, ["flock-0 stopped"])
    assert host.parts() == []
