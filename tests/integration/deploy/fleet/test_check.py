"""What `robots check` tells before anything is deployed."""

import re

import pytest

from swarmwire.deploy.fleet import check as check_module


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
    monkeypatch.setattr(check_module, "MAX_AHEAD_NS", -(10**12))
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
