"""Atomic writes: a file is written under another name beside its place, then renamed.

They hold against a killed process and a full disk; there is no sync to disk for a power cut. They also hold against
links in a folder from other people: the file is always a new one, and a link at its place is replaced, never
followed.
"""

import errno
import os
from collections.abc import Generator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from swarmwire.comms.base.errors import BadInput

NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
PRIVATE = 0o600  # mode of a file that its owner alone may read


@contextmanager
def atomic_write(to: Path, *, mode: int = 0o666, replace: bool = True) -> Generator[Path]:
    """A path to write to: its file becomes `to` when the block ends without error, else it is removed.

    The file has this mode, less the umask, from the start. OSError if nothing can be written there; without `replace`
    FileExistsError if there is a file.
    """
    aside = to.with_name(f".aside-{to.name}")  # the ending stays: writers go by it
    aside.unlink(missing_ok=True)  # of a process that was killed, or a link to a file of the user's
    os.close(os.open(aside, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC, mode))
    try:
        yield aside
        if replace:
            aside.replace(to)
        else:
            os.link(aside, to)  # unlike a rename it takes nobody's place
    finally:  # however the block ended: on a full disk the half of a file is in the way
        aside.unlink(missing_ok=True)


def write_bytes(path: Path, data: bytes | memoryview, *, mode: int = 0o666, replace: bool = True) -> None:
    """Write a file as a whole, as `atomic_write` does; OSError if the disk refuses."""
    with atomic_write(path, mode=mode, replace=replace) as aside:
        aside.write_bytes(data)


def write_text(path: Path, text: str) -> None:
    """Write a text file as a whole; OSError if the disk refuses."""
    write_bytes(path, text.encode())


def make_subfolder(path: Path) -> None:
    """Make a folder within one that may come from other people, unless it is there; OSError for a link, or if it fails.

    Through a link, files would land in another folder of the user's.
    """
    path.mkdir(exist_ok=True)
    refuse_link(path)


def refuse_link(path: Path) -> None:
    """OSError if the path is a symbolic link."""
    if path.is_symlink():
        raise OSError(errno.ELOOP, "a symbolic link, which may lead out of its folder", str(path))


@contextmanager
def output_file(to: Path) -> Generator[Path]:
    """As `atomic_write`, for a path that a person chose: BadInput if nothing can be written there, or not so much."""
    with ExitStack() as stack:
        try:
            aside = stack.enter_context(atomic_write(to))
        except OSError as error:
            raise _not_written(to, error) from None
        try:
            yield aside
        except OSError as error:
            if error.errno in NO_ROOM:
                raise _not_written(to, error) from None
            raise


def _not_written(to: Path, error: OSError) -> BadInput:
    return BadInput(str(to), "", f"expected a file that can be written: {error.strerror}")


def check_output_path(to: Path, suffixes: tuple[str, ...]) -> None:
    """Return if a person may have a file of one of these kinds there; else BadInput."""
    if to.suffix.lower() not in suffixes:
        raise BadInput(str(to), "", f"expected a file name that ends in {' or '.join(suffixes)}")
    if not to.parent.is_dir() or to.is_dir():
        raise BadInput(str(to), "", "expected a path in a folder that exists")
