"""Archives: files in a compressed tar that is the same, byte by byte, for the same files."""

import gzip
import hashlib
import io
import tarfile
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from swarmwire.metrics.atomic import atomic_write

LEVEL = 6  # of compression: the next ones cost twice the time for a hundredth of the size


@dataclass(frozen=True)
class Entry:
    """A file, or a link, of an archive."""

    name: str  # with "/"
    data: bytes = b""
    mode: int = 0o644
    link: str = ""  # where it leads; "": it is a file


@dataclass(frozen=True)
class Archive:
    """An archive on this machine's disk, under a name that only the same content has."""

    name: str
    path: Path
    sha256: str
    size: int
    unpacked: int  # bytes


def name_of(entries: Iterable[Entry]) -> str:
    """The name of a content: the same entries in any order give the same."""
    digest = hashlib.sha256()
    for entry in sorted(entries, key=lambda entry: entry.name):
        data = hashlib.sha256(entry.data).hexdigest()
        digest.update(f"{entry.name}\0{entry.mode:o}\0{entry.link}\0{data}\n".encode())
    return digest.hexdigest()[:12]


def write_archive(entries: Iterable[Entry], path: Path, name: str | None = None) -> Archive:
    """The archive of these entries at a path, which is there whole or not at all; named after them if not given."""
    ordered = sorted(entries, key=lambda entry: entry.name)
    made = io.BytesIO()
    with (
        gzip.GzipFile(fileobj=made, mode="wb", compresslevel=LEVEL, mtime=0) as packed,
        tarfile.open(fileobj=packed, mode="w", format=tarfile.PAX_FORMAT) as tar,
    ):
        for entry in ordered:
            member = tarfile.TarInfo(entry.name)
            member.mode, member.size = entry.mode, len(entry.data)
            if entry.link:
                member.type, member.linkname = tarfile.SYMTYPE, entry.link
            tar.addfile(member, io.BytesIO(entry.data))
    data = made.getvalue()
    path.parent.mkdir(parents=True, exist_ok=True)
    with atomic_write(path) as aside:
        aside.chmod(0o600)  # it may hold keys
        aside.write_bytes(data)
    unpacked = sum(len(entry.data) for entry in ordered)
    return Archive(name or name_of(ordered), path, hashlib.sha256(data).hexdigest(), len(data), unpacked)
