"""Logs come from other machines: whatever these send, nothing is written but the log's own folder."""

import io
import tarfile

import pytest


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
