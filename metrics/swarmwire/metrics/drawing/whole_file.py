"""Files at a path that a person chose, which are there whole or not at all."""

from collections.abc import Generator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from swarmwire.comms.errors import BadInput
from swarmwire.metrics.written_aside import written_aside


def check_path(to: Path, suffixes: tuple[str, ...]) -> None:
    """Return if a file of one of these kinds may be written there; else BadInput."""
    if to.suffix.lower() not in suffixes:
        raise BadInput(str(to), "", f"expected a file name that ends in {' or '.join(suffixes)}")
    if not to.parent.is_dir() or to.is_dir():
        raise BadInput(str(to), "", "expected a path in a folder that exists")


@contextmanager
def whole_file(to: Path) -> Generator[Path]:
    """A path to write to, as `written_aside` gives it; BadInput if nothing can be written there."""
    with ExitStack() as stack:
        try:
            aside = stack.enter_context(written_aside(to))
        except OSError as error:
            raise BadInput(str(to), "", f"expected a file that can be written: {error.strerror}") from None
        yield aside
