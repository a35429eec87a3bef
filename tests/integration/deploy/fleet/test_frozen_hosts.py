"""Hosts that freeze, and that send more than any log holds: a line each, and this machine keeps its disk."""

from threading import Event

import pytest

from swarmwire.deploy.fleet import connecting, host_session, logs
from swarmwire.deploy.fleet.host_side.files import Refusal, unpack
from tests.integration.deploy.fleet.test_hostile_logs import member, packed

LONG_S = 100.0  # for which a host is frozen, unless it is thawed


@pytest.fixture
def frozen(fleet, packages, monkeypatch):
    """A host that freezes in the middle of a deployment, with what it waited for."""
    monkeypatch.setattr(connecting, "ALIVE_S", 0.1)
    thaw, waited = Event(), list[bool]()
    host = fleet.add("flock-0")
    packages.size, host.cut_after = 400_000, 70_000
    host.before_cut = lambda: waited.append(thaw.wait(LONG_S))
    yield waited
    thaw.set()


def test_a_host_that_freezes_in_the_middle_is_told_long_before_anybody_would_give_up(robots, frozen):
    code, lines = robots("deploy")
    assert code == 1
    assert "connection was lost" in lines[0]
    assert frozen == []  # it has not gone on yet


def test_a_host_that_takes_requests_and_answers_none_is_told(fleet, robots, monkeypatch):
    monkeypatch.setattr(host_session, "TIMEOUT_S", 0.2)
    fleet.add("flock-0").set_python("exec cat > /dev/null")
    code, lines = robots("deploy")
    assert code == 1
    assert "within 0.2 s" in lines[0]


@pytest.fixture
def sends(fleet, robots, tmp_path, monkeypatch):
    """What comes of a fetch of which the host sends this, where a log may have 10 kB."""
    host = fleet.add("flock-0")
    (host.root / "flock-0" / "log" / "flock-0-1").mkdir(parents=True)
    monkeypatch.setattr(logs, "MAX_BYTES", 10_000)

    def fetched(command):
        (host.bin / "tar").write_text(f"#!/bin/sh\nexec {command}\n")
        (host.bin / "tar").chmod(0o755)
        return robots("logs", "--fetch", tmp_path / "logs")

    return fetched


def test_a_log_without_end_is_fetched_no_further_than_to_its_limit(sends, tmp_path):
    code, lines = sends("head -c 100000000 /dev/zero")  # as good as endless, but for a fetch that has no limit
    assert code == 1
    assert "larger than" in lines[0]
    assert "~/swarmwire/flock-0/log" in " ".join(lines)
    assert list((tmp_path / "logs").iterdir()) == []


def test_a_small_archive_of_a_large_log_is_unpacked_no_further_either(fleet, sends, tmp_path):
    small = tmp_path / "small"
    small.write_bytes(packed(member("robot.json", data=bytes(20_000))))
    assert small.stat().st_size < 1_000
    code, lines = sends(f"cat {small}")
    assert code == 1
    assert "10000 bytes" in lines[0]
    assert list((tmp_path / "logs").iterdir()) == []


def test_names_without_files_count_too(tmp_path):
    archive = tmp_path / "many"
    archive.write_bytes(packed(*(member(f"empty-{number}") for number in range(100))))
    with archive.open("rb") as file, pytest.raises(Refusal, match="10000 bytes"):
        unpack(file, tmp_path / "log", most_bytes=10_000)
