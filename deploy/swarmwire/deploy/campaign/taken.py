"""A folder kept for one process at a time."""

import fcntl
import os
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

from swarmwire.comms.errors import BadInput


@contextmanager
def taken(folder: Path, what: str) -> Generator[None]:
    """Keep the folder of `what` for this process while the block lasts; BadInput if another process has it."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)  # let go by the system, however we end
        yield
    except BlockingIOError:
        raise BadInput(str(folder), "", f"another process is at work on this {what}") from None
    finally:
        os.close(descriptor)
