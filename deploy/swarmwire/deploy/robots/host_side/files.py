"""Files of a host: where things lie, how archives are unpacked, and the refusal of a request.

An archive is unpacked beside its place, and moved there when every byte is as it was sent.
"""

import errno
import hashlib
import os
import shutil
import tarfile
from pathlib import Path
from typing import BinaryIO, cast

FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
KEPT = 3  # releases of a robot that can be gone back to, the current one among them
TAKEN = ("env", "lock")  # in `root`, so that no robot can have such a name
PART = ".part"  # of what is not whole yet
BLOCK = 1 << 18
NO_ARCHIVE = (tarfile.TarError, EOFError)  # what `unpack` raises for what is none


class Refusal(Exception):
    """One request fails: `kind` is for the program at the other end, `text` for people."""

    def __init__(self, kind: str, text: str) -> None:
        self.kind, self.text = kind, text
        super().__init__(text)


class Cut(Exception):
    """The connection ended in the middle of a request."""


def refusal_of(error: OSError) -> Refusal:
    """The refusal that an error of the system comes to."""
    kind = "full" if error.errno in FULL else "system"
    place = f": {error.filename}" if error.filename else ""
    return Refusal(kind, f"{error.strerror or error}{place}")


def root() -> Path:
    """The folder of all that is deployed."""
    return Path.home() / "swarmwire"


def environment(name: str) -> Path:
    """The folder of some packages."""
    return root() / "env" / name


def releases(robot: str) -> Path:
    """The folder of a robot's releases."""
    return root() / robot / "releases"


def current(robot: str) -> str | None:
    """The release that starts next; None if there is none."""
    try:
        name = (root() / robot / "current").readlink().name
    except OSError:
        return None
    return name if (releases(robot) / name).is_dir() else None


def whole_in(folder: Path) -> list[str]:
    """The names of what is whole in a folder."""
    if not folder.is_dir():
        return []
    return sorted(path.name for path in folder.iterdir() if path.is_dir() and not path.name.endswith(PART))


def sync_files(folder: Path) -> None:
    """Write a folder's content through to the disk, so that a power cut does not lose it."""
    for path in folder.iterdir():
        if path.is_file() and not path.is_symlink():
            _sync(path)
    sync_folder(folder)


def sync_folder(folder: Path) -> None:
    """See to it that the names in a folder are on the disk."""
    _sync(folder)


def _sync(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def write_whole(path: Path, text: str) -> None:
    """A file that is there with all of this text, or as it was before."""
    part = path.with_name(path.name + PART)
    with part.open("w", encoding="utf-8") as file:
        file.write(text)
        file.flush()
        os.fsync(file.fileno())
    part.replace(path)


class Incoming:
    """The next `size` bytes of a stream, and the digest of what was read of them."""

    def __init__(self, stream: BinaryIO, size: int) -> None:
        self._stream, self._left = stream, size
        self._digest = hashlib.sha256()

    def read(self, most: int = -1) -> bytes:
        """At most so many bytes, none at the end; Cut if the stream ends before."""
        wanted = self._left if most < 0 else min(most, self._left)
        if not wanted:
            return b""
        data = self._stream.read(wanted)
        if len(data) < wanted:
            raise Cut
        self._left -= len(data)
        self._digest.update(data)
        return data

    def drain(self) -> str:
        """Read what is left; the digest of all, in hexadecimal digits."""
        while self.read(BLOCK):
            pass
        return self._digest.hexdigest()


def part_of(folder: Path) -> Path:
    """Where a folder is made before it is whole."""
    return folder.with_name(folder.name + PART)


def unpack_whole(incoming: Incoming, sha256: str, folder: Path) -> Path:
    """The archive unpacked as `<folder>.part`, which is returned; nothing is left of one that failed."""
    part = part_of(folder)
    shutil.rmtree(part, ignore_errors=True)
    try:
        part.mkdir(parents=True)
        unpack(incoming, part, links=True)
        if incoming.drain() != sha256:
            raise Refusal("damaged", "what arrived is not what was sent")
    except OSError as error:
        shutil.rmtree(part, ignore_errors=True)
        incoming.drain()
        raise refusal_of(error) from None
    except NO_ARCHIVE:
        shutil.rmtree(part, ignore_errors=True)
        incoming.drain()
        raise Refusal("damaged", "what arrived is not what was sent") from None
    except BaseException:  # an exit, too: a half-made folder is left by nobody
        shutil.rmtree(part, ignore_errors=True)
        raise
    return part


def unpack(stream: Incoming | BinaryIO, into: Path, *, links: bool = False, most_bytes: int | None = None) -> None:
    """The files and folders of a compressed tar, none of them outside `into`; Refusal for any other.

    `links` are only for archives of our own: a file that is written through one may end up anywhere. Of archives that
    are not, what is packed in a few bytes may be a disk full: Refusal for more than `most_bytes` in all files.
    """
    left = most_bytes
    with tarfile.open(fileobj=cast("BinaryIO", stream), mode="r|gz", bufsize=BLOCK) as archive:
        for member in archive:
            path = into / member.name
            outside = Path(member.name).is_absolute() or ".." in Path(member.name).parts
            if outside or (member.issym() and not links):
                raise Refusal("damaged", f"expected files within the archive, got {member.name!r}")
            if left is not None and (left := left - tarfile.BLOCKSIZE - member.size) < 0:
                raise Refusal("damaged", f"expected {most_bytes} bytes at most, got more")
            if member.isdir():
                path.mkdir(parents=True, exist_ok=True)
            elif member.issym():
                path.symlink_to(member.linkname)
            elif (source := archive.extractfile(member)) is not None:
                path.parent.mkdir(parents=True, exist_ok=True)
                descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, member.mode & 0o777)
                with os.fdopen(descriptor, "wb") as file:
                    shutil.copyfileobj(source, file, BLOCK)
