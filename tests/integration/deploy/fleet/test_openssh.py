"""What holds of fake hosts holds of OpenSSH's server, too."""

import getpass

import pytest

from tests.support.deploy.fleet.sshd import openssh


@pytest.fixture
def host(fleet, tmp_path, client_key):
    """A robot whose host OpenSSH serves."""
    with openssh(tmp_path / "home-flock-0", client_key) as host:
        yield fleet.add("flock-0", host, user=getpass.getuser())


def test_a_fleet_of_openssh_is_deployed_started_told_gone_back_from_and_stopped(fleet, robots, host, monkeypatch):
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
    assert robots("stop") == (0, ["flock-0 stopped"])
    assert host.parts() == []


def test_a_key_of_openssh_that_changed_is_refused(fleet, robots, host):
    other = fleet.servers.add(host.home.parent / "home-other")
    host.host_key = other.host_key
    fleet.know(host)
    code, lines = robots("deploy")
    assert code == 1
    assert "another machine" in lines[0]
    assert not host.root.exists()


def test_an_emergency_stop_goes_through_openssh(robots, host, monkeypatch):
    from swarmwire.deploy.fleet import units

    monkeypatch.setattr(units, "NETWORK_S", 0.2)
    robots("deploy")
    robots("start")
    assert robots("estop") == (0, ["flock-0 stopped, confirmed by SSH (over the network: no answer)"])
