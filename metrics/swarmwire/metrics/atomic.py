"""Atomic writes: a file is written under another name beside its place, then renamed.

Against a killed process and a full disk; there is no sync to disk for a power cut.
"""

import errno
from collections.abc import Generator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from swarmwire.comms.errors import BadInput

NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


@contextmanager
def atomic_write(to: Path) -> Generator[Path]:
    """A path to write to: its file replaces `to` when the block ends without error, else it is removed.

    OSError if nothing can be written there.
    """
    aside = to.with_name(f".aside-{to.name}")  # the ending stays: writers go by it
    aside.touch()
    try:
        yield aside
        aside.replace(to)
    finally:  # however the block ended: on a full disk the half of a file is in the way
        aside.unlink(missing_ok=True)


def write_text(path: Path, text: str) -> None:
    """Write a text file as a whole; OSError if the disk refuses."""
    with atomic_write(path) as aside:
        aside.write_text(text, encoding="utf-8")


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
