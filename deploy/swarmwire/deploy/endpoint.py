"""Where runners of this machine meet the world: a unix socket in a private, short-named directory."""

import os
import secrets
import tempfile
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

from swarmwire.comms.errors import BadInput
from swarmwire.comms.wire.sessions import unix_endpoint

LONGEST_PATH = 107  # of a unix socket, in bytes (sun_path has 108 with its end mark)


def new_run_id() -> str:
    """A name for one execution, which nobody else has."""
    return secrets.token_hex(4)


@contextmanager
def local_endpoint(socket: Path | None) -> Generator[str]:
    """An endpoint at `socket`, or in a new directory that is gone afterwards; BadInput if the path will not do."""
    if socket is not None:
        path = str(socket.absolute())
        if not socket.absolute().parent.is_dir():
            raise BadInput("--socket", path, "expected a path in a directory that exists")
        if len(os.fsencode(path)) > LONGEST_PATH:
            raise BadInput("--socket", path, f"expected a path of at most {LONGEST_PATH} bytes")
        yield unix_endpoint(path)
        return
    base = tempfile.gettempdir()
    with tempfile.TemporaryDirectory(prefix="sw-", dir=base if len(base) < 60 else "/tmp") as directory:
        yield unix_endpoint(f"{directory}/world")
