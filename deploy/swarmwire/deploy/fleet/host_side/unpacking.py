"""Archives that arrive: unpacked beside their place, and moved there when every byte is as it was sent."""

import hashlib
import os
import shutil
import tarfile
from pathlib import Path
from typing import BinaryIO, cast

from swarmwire.deploy.fleet.host_side.folders import PART
from swarmwire.deploy.fleet.host_side.refusal import Cut, Refusal, refusal_of

BLOCK = 1 << 18
NO_ARCHIVE = (tarfile.TarError, EOFError)  # what `unpack` raises for what is none


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
