"""Files of a host: paths, the unpacking of archives, and the refusal of a request.

An archive is unpacked next to its final path, and renamed when every byte is as it was sent.
"""

import errno
import hashlib
import json
import os
import shutil
import tarfile
from pathlib import Path
from typing import Any, BinaryIO, cast

FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
MAX_RELEASES = 3  # releases of a robot that are stored, the current one among them
RESERVED_NAMES = ("env", "lock")  # names in `root` that no robot can have
PART = ".part"  # suffix of incomplete files and folders
BLOCK_BYTES = 1 << 18
ARCHIVE_ERRORS = (tarfile.TarError, EOFError)  # errors of `unpack` for data that is no archive


class Refusal(Exception):
    """Failure of one request: `kind` is for the program at the other end, `text` for people."""

    def __init__(self, kind: str, text: str) -> None:
        self.kind, self.text = kind, text
        super().__init__(text)


class ConnectionCut(Exception):
    """The connection ended within a request."""


def refusal_of(error: OSError) -> Refusal:
    """Return the refusal for an error of the system."""
    kind = "full" if error.errno in FULL else "system"
    path = f": {error.filename}" if error.filename else ""
    return Refusal(kind, f"{error.strerror or error}{path}")


def root() -> Path:
    """Return the folder of all deployed files."""
    return Path.home() / "swarmwire"


def environment_folder(name: str) -> Path:
    """Return the folder of an environment's packages."""
    return root() / "env" / name


def releases_folder(robot: str) -> Path:
    """Return the folder of a robot's releases."""
    return root() / robot / "releases"


def current_release(robot: str) -> str | None:
    """Return the release that starts next; None without one."""
    try:
        name = (root() / robot / "current").readlink().name
    except OSError:
        return None
    return name if (releases_folder(robot) / name).is_dir() else None


def complete_folders(folder: Path) -> list[str]:
    """Return the names of the complete folders in a folder."""
    if not folder.is_dir():
        return []
    return sorted(path.name for path in folder.iterdir() if path.is_dir() and not path.name.endswith(PART))


def read_status(robot: str) -> dict[str, Any] | None:
    """Return the last status of the robot's agent; None if it never ran, or writes the file at the moment."""
    try:
        return json.loads((root() / robot / "log" / f"{robot}-status.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None


def sync_files(folder: Path) -> None:
    """Flush a folder's files to the disk, so that they survive a power cut."""
    for path in folder.iterdir():
        if path.is_file() and not path.is_symlink():
            sync(path)
    sync(folder)


def sync(path: Path) -> None:
    """Flush a file, or the names in a folder, to the disk."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def replace_file(path: Path, text: str) -> None:
    """Replace a file's content atomically."""
    part = path.with_name(path.name + PART)
    with part.open("w", encoding="utf-8") as file:
        file.write(text)
        file.flush()
        os.fsync(file.fileno())
    part.replace(path)


class ArchiveStream:
    """The next `size` bytes of a stream, and the digest of those that were read."""

    def __init__(self, stream: BinaryIO, size: int) -> None:
        self._stream, self._remaining = stream, size
        self._digest = hashlib.sha256()

    def read(self, size: int = -1) -> bytes:
        """Read at most `size` bytes, none at the end; ConnectionCut if the stream ends earlier."""
        count = self._remaining if size < 0 else min(size, self._remaining)
        if not count:
            return b""
        data = self._stream.read(count)
        if len(data) < count:
            raise ConnectionCut
        self._remaining -= len(data)
        self._digest.update(data)
        return data

    def drain(self) -> str:
        """Read the remaining bytes; return the digest of all, in hexadecimal digits."""
        while self.read(BLOCK_BYTES):
            pass
        return self._digest.hexdigest()


def part_of(folder: Path) -> Path:
    """Return the path of a folder while it is incomplete."""
    return folder.with_name(folder.name + PART)


def unpack_part(archive: ArchiveStream, sha256: str, folder: Path) -> Path:
    """Unpack an archive as `<folder>.part` and return that path; a failure leaves nothing."""
    part = part_of(folder)
    shutil.rmtree(part, ignore_errors=True)
    try:
        part.mkdir(parents=True)
        unpack(archive, part, links=True)
        if archive.drain() != sha256:
            raise Refusal("damaged", "the received archive differs from the sent one")
    except OSError as error:
        shutil.rmtree(part, ignore_errors=True)
        archive.drain()
        raise refusal_of(error) from None
    except ARCHIVE_ERRORS:
        shutil.rmtree(part, ignore_errors=True)
        archive.drain()
        raise Refusal("damaged", "the received archive differs from the sent one") from None
    except BaseException:  # an exit, too, must leave no incomplete folder
        shutil.rmtree(part, ignore_errors=True)
        raise
    return part


def unpack(stream: ArchiveStream | BinaryIO, into: Path, *, links: bool = False, max_bytes: int | None = None) -> None:
    """Unpack the files and folders of a compressed tar below `into`; Refusal for any other member.

    Allow `links` only in archives of swarmwire: a file that is written through a link may end up anywhere. Set
    `max_bytes`, a limit for the sum of all files, for other archives: a few bytes may unpack to a full disk.
    """
    remaining = max_bytes
    with tarfile.open(fileobj=cast("BinaryIO", stream), mode="r|gz", bufsize=BLOCK_BYTES) as archive:
        for member in archive:
            path = into / member.name
            is_outside = Path(member.name).is_absolute() or ".." in Path(member.name).parts
            if is_outside or (member.issym() and not links):
                raise Refusal("damaged", f"expected files within the archive, got {member.name!r}")
            if remaining is not None and (remaining := remaining - tarfile.BLOCKSIZE - member.size) < 0:
                raise Refusal("damaged", f"expected {max_bytes} bytes at most, got more")
            if member.isdir():
                path.mkdir(parents=True, exist_ok=True)
            elif member.issym():
                path.symlink_to(member.linkname)
            elif (source := archive.extractfile(member)) is not None:
                path.parent.mkdir(parents=True, exist_ok=True)
                descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, member.mode & 0o777)
                with os.fdopen(descriptor, "wb") as file:
                    shutil.copyfileobj(source, file, BLOCK_BYTES)
