"""Hosts that freeze, and logs that are hostile."""

import io
import tarfile
from threading import Event

import pytest

from swarmwire.deploy.fleet import connecting, host_session, logs
from swarmwire.deploy.fleet.host_side.files import Refusal, unpack

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


def member(
    name: str, kind: bytes = tarfile.REGTYPE, link: str = "", data: bytes = b""
) -> tuple[tarfile.TarInfo, bytes]:
    info = tarfile.TarInfo(name)
    info.type, info.linkname, info.size = kind, link, len(data)
    return info, data


def packed(*members: tuple[tarfile.TarInfo, bytes]) -> bytes:
    made = io.BytesIO()
    with tarfile.open(fileobj=made, mode="w:gz") as tar:
        for info, data in members:
            tar.addfile(info, io.BytesIO(data))
    return made.getvalue()


TWICE = member("robot.json", data=b"{}")
HOSTILE = {
    "a path above": packed(member("../outside", data=b"x")),
    "a path of the machine": packed(member("/tmp/outside", data=b"x")),
    "a link and a file through it": packed(member("out", tarfile.SYMTYPE, ".."), member("out/outside", data=b"x")),
    "a hard link": packed(member("robot.json", tarfile.LNKTYPE, "../../fleet.toml")),
    "one file twice": packed(TWICE, TWICE),
    "half of an archive": packed(member("robot.json", data=b"{}" * 1000))[:40],
    "no archive": b"what is this?",
    "nothing": b"",
}


@pytest.mark.parametrize("sent", HOSTILE.values(), ids=HOSTILE.keys())
def test_what_is_no_log_leaves_nothing_and_is_told_in_a_line(fleet, robots, tmp_path, sent):
    host, to = fleet.add("flock-0"), tmp_path / "logs"
    (host.root / "flock-0" / "log" / "flock-0-1").mkdir(parents=True)
    (host.bin / "sent").write_bytes(sent)
    (host.bin / "tar").write_text(f"#!/bin/sh\nexec cat {host.bin}/sent\n")
    (host.bin / "tar").chmod(0o755)
    code, lines = robots("logs", "--fetch", to)
    assert code == 1
    assert lines[0].startswith("flock-0 failed: its log cannot be unpacked: ")
    assert len(lines) == 2
    assert not list(to.iterdir())
    assert not list(tmp_path.rglob("outside"))
