"""Files that are there whole or not at all: written under another name beside their place, then renamed.

Against a killed process and a full disk; there is no sync to disk for a power cut.
"""

from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def written_aside(to: Path) -> Generator[Path]:
    """A path to write to; when the block ends well that file takes its place, which it may replace, else it is gone.

    OSError if nothing can be written there.
    """
    aside = to.with_name(f".aside-{to.name}")  # the ending stays: writers go by it
    aside.touch()
    try:
        yield aside
        aside.replace(to)
    finally:  # however the block ended: on a full disk the half of a file is in the way
        aside.unlink(missing_ok=True)
