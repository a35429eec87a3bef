"""Where runners of this machine meet the world: a unix socket in a private, short-named directory."""

import os
import secrets
import socket
import tempfile
from collections.abc import Generator
from contextlib import contextmanager, suppress
from pathlib import Path

from swarmwire.comms.errors import BadInput
from swarmwire.comms.wire.sessions import PRIVATE, unix_endpoint

LONGEST_PATH = 107  # of a unix socket, in bytes (sun_path has 108 with its end mark)


def new_run_id() -> str:
    """A name for one execution, which nobody else has."""
    return secrets.token_hex(4)


@contextmanager
def local_endpoint(path: Path | None) -> Generator[str]:
    """An endpoint at `path`, or in a new directory that is gone afterwards; BadInput if the path will not do."""
    if path is not None:
        check_socket(path)
        yield unix_endpoint(str(path.absolute()))
        return
    base = tempfile.gettempdir()
    with tempfile.TemporaryDirectory(prefix=PRIVATE, dir=base if len(base) < 60 else "/tmp") as directory:
        yield unix_endpoint(f"{directory}/world")


def check_socket(path: Path) -> None:
    """Return if a unix socket can be made there; else BadInput. One that nobody listens at may be in its place."""
    path = path.absolute()
    if not path.parent.is_dir():
        raise BadInput("--socket", str(path), "expected a path in a directory that exists")
    if len(os.fsencode(path)) > LONGEST_PATH:
        raise BadInput("--socket", str(path), f"expected a path of at most {LONGEST_PATH} bytes")
    if not path.exists():
        return
    if not path.is_socket():
        raise BadInput("--socket", str(path), "expected a path that is free; something else is there")
    with (
        socket.socket(socket.AF_UNIX) as probe,
        suppress(ConnectionRefusedError),
    ):  # refused: nobody listens, it is stale
        probe.connect(str(path))
        raise BadInput("--socket", str(path), "expected a path that is free; the socket is in use")
