"""Archives: compressed tar files of entries, under names that only the same content has."""

import gzip
import hashlib
import io
import tarfile
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from swarmwire.comms.base.atomic import PRIVATE, write_bytes

COMPRESSION_LEVEL = 6  # the next ones cost twice the time for a hundredth of the size


@dataclass(frozen=True)
class ArchiveEntry:
    """A file, or a link, of an archive."""

    name: str  # path with "/"
    data: bytes = b""
    mode: int = 0o644
    link: str = ""  # target of a link; "": a file


@dataclass(frozen=True)
class Archive:
    """An archive on this machine's disk, under a name that only the same content has."""

    name: str
    path: Path
    sha256: str
    size: int
    unpacked: int  # size of all entries, in bytes


def name_of(entries: Iterable[ArchiveEntry]) -> str:
    """Return the name of a content, the same for the same entries in any order."""
    digest = hashlib.sha256()
    for entry in sorted(entries, key=lambda entry: entry.name):
        data = hashlib.sha256(entry.data).hexdigest()
        digest.update(f"{entry.name}\0{entry.mode:o}\0{entry.link}\0{data}\n".encode())
    return digest.hexdigest()[:12]


def write_archive(entries: Iterable[ArchiveEntry], path: Path, name: str | None = None) -> Archive:
    """Write an archive of these entries atomically; its name defaults to that of its content."""
    ordered = sorted(entries, key=lambda entry: entry.name)
    buffer = io.BytesIO()
    with (
        gzip.GzipFile(fileobj=buffer, mode="wb", compresslevel=COMPRESSION_LEVEL, mtime=0) as packed,
        tarfile.open(fileobj=packed, mode="w", format=tarfile.PAX_FORMAT) as tar,
    ):
        for entry in ordered:
            member = tarfile.TarInfo(entry.name)
            member.mode, member.size = entry.mode, len(entry.data)
            if entry.link:
                member.type, member.linkname = tarfile.SYMTYPE, entry.link
            tar.addfile(member, io.BytesIO(entry.data))
    data = buffer.getvalue()
    path.parent.mkdir(parents=True, exist_ok=True)
    write_bytes(path, data, mode=PRIVATE)  # an archive may contain keys
    unpacked = sum(len(entry.data) for entry in ordered)
    return Archive(name or name_of(ordered), path, hashlib.sha256(data).hexdigest(), len(data), unpacked)
