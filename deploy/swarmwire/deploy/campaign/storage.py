"""A disk that is full, or refuses: told in one line, with what can be done."""

from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

from swarmwire.comms.errors import SwarmwireError
from swarmwire.metrics.table_file import corruption_errors


class StorageFailed(SwarmwireError):
    """The folder of a campaign or of a tuning cannot be written any more."""


@contextmanager
def storing(folder: Path, command: str = "sweep") -> Generator[None]:
    """Turn what a disk refuses in the block into StorageFailed; `command` is what goes on with the folder."""
    try:
        yield
    except (OSError, *corruption_errors()) as error:
        why = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        text = f"{folder}: cannot be written: {why}; what is done stays: swarmwire {command} --resume {folder}"
        raise StorageFailed(text) from error
