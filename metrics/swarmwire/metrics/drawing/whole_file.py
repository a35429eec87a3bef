"""Files that are there whole or not at all: written under another name beside their place, then moved to it."""

from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

from swarmwire.comms.errors import BadInput


def check_path(to: Path, suffixes: tuple[str, ...]) -> None:
    """Return if a file of one of these kinds may be written there; else BadInput."""
    if to.suffix.lower() not in suffixes:
        raise BadInput(str(to), "", f"expected a file name that ends in {' or '.join(suffixes)}")
    if not to.parent.is_dir() or to.is_dir():
        raise BadInput(str(to), "", "expected a path in a folder that exists")


@contextmanager
def whole_file(to: Path) -> Generator[Path]:
    """A path to write to; when the block ends well that file takes its place, which it may replace, else it is gone.

    BadInput if nothing can be written there.
    """
    part = to.with_name(f".part-{to.name}")  # the ending stays: writers go by it
    try:
        part.touch()
    except OSError as error:
        raise BadInput(str(to), "", f"expected a file that can be written: {error.strerror}") from None
    try:
        yield part
        part.replace(to)
    finally:
        part.unlink(missing_ok=True)
