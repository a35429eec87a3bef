"""Atomic writes: a file is written under a temporary name in the same folder, then renamed.

A killed process or a full disk leaves the old file or the new one. There is no sync to disk for a power cut. In a
folder from other people, the file is always a new one: a link at its path is replaced, never followed.
"""

import errno
import fcntl
import os
from collections.abc import Generator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from swarmwire.comms.base.errors import BadInput

NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
PRIVATE = 0o600  # mode of a file that only its owner may read


@contextmanager
def atomic_write(to: Path, *, mode: int = 0o666, replace: bool = True) -> Generator[Path]:
    """Yield a path to write to: its file becomes `to` when the block ends without error, else it is removed.

    The file has this mode, less the umask, from the start. OSError if `to` cannot be written; without `replace`,
    FileExistsError if it exists.
    """
    aside = to.with_name(f".aside-{to.name}")  # has the suffix of `to`, from which writers choose a format
    aside.unlink(missing_ok=True)  # a remnant of a killed process, or a link to a file of the user
    os.close(os.open(aside, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC, mode))
    try:
        yield aside
        if replace:
            aside.replace(to)
        else:
            os.link(aside, to)  # unlike a rename it never replaces a file
    finally:  # on a full disk an incomplete file takes up space
        aside.unlink(missing_ok=True)


def write_bytes(path: Path, data: bytes | memoryview, *, mode: int = 0o666, replace: bool = True) -> None:
    """Write a file atomically; OSError if the disk refuses."""
    with atomic_write(path, mode=mode, replace=replace) as aside:
        aside.write_bytes(data)


def write_text(path: Path, text: str) -> None:
    """Write a text file atomically; OSError if the disk refuses."""
    write_bytes(path, text.encode())


def make_subfolder(path: Path) -> None:
    """Make a subfolder, unless it exists, of a folder that may come from other people; OSError for a link.

    Through a link, files would be written to another folder of the user.
    """
    path.mkdir(exist_ok=True)
    refuse_link(path)


def refuse_link(path: Path) -> None:
    """Raise OSError if the path is a symbolic link."""
    if path.is_symlink():
        raise OSError(errno.ELOOP, "a symbolic link, which may lead out of its folder", str(path))


@contextmanager
def output_file(to: Path) -> Generator[Path]:
    """Do `atomic_write` for a path that a user chose: BadInput if it cannot be written, or the disk is full."""
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
    """Raise BadInput unless the path has one of the suffixes and its folder exists."""
    if to.suffix.lower() not in suffixes:
        raise BadInput(str(to), "", f"expected a file name that ends in {' or '.join(suffixes)}")
    if not to.parent.is_dir() or to.is_dir():
        raise BadInput(str(to), "", "expected a path in a folder that exists")


@contextmanager
def folder_lock(folder: Path, activity: str) -> Generator[None]:
    """Hold a folder for this process until the block ends; BadInput naming the activity if another process holds it."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)  # the system releases it, however the process ends
        yield
    except BlockingIOError:
        raise BadInput(str(folder), "", f"another process is at work on this {activity}") from None
    finally:
        os.close(descriptor)
