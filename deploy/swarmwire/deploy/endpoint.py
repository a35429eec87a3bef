"""Where runners of this machine meet the world: a unix socket in a private, short-named directory."""

import os
import secrets
import shutil
import socket
import tempfile
from collections.abc import Generator
from contextlib import contextmanager, suppress
from pathlib import Path

from swarmwire.comms.clock import WallClock, to_ns
from swarmwire.comms.errors import BadInput
from swarmwire.comms.wire.sessions import PRIVATE, unix_endpoint

STALE_S = 60.0  # of a socket at which nobody listens: one that was just made may be about to
ANSWER_S = 0.5  # of the system, for whoever listens
SOCKET = "world"  # in a private directory
MAX_PATH = 107  # of a unix socket, in bytes (sun_path has 108 with its end mark)


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
    base = base if len(base) < 60 else "/tmp"
    _remove_stale(Path(base))
    with tempfile.TemporaryDirectory(prefix=PRIVATE, dir=base) as directory:
        yield unix_endpoint(f"{directory}/{SOCKET}")


def _remove_stale(base: Path) -> None:
    """Take away the directories of this user's runs that were killed, and so could not do it themselves."""
    before_ns = WallClock().utc_ns() - to_ns(STALE_S)
    for path in base.glob(f"{PRIVATE}*/{SOCKET}"):
        with suppress(OSError):  # not this user's, or gone by now
            about = path.lstat()
            is_old = path.is_socket() and about.st_uid == os.getuid() and about.st_mtime_ns < before_ns
            if is_old and not _is_listened_at(path):
                shutil.rmtree(path.parent)


def _is_listened_at(path: Path) -> bool:
    with socket.socket(socket.AF_UNIX) as probe:
        probe.settimeout(ANSWER_S)
        try:
            probe.connect(str(path))
        except ConnectionRefusedError:
            return False
        except (TimeoutError, BlockingIOError):  # it is frozen, and many have called
            return True
        return True


def check_socket(path: Path) -> None:
    """Return if a unix socket can be made there; else BadInput. One that nobody listens at may be in its place."""
    path = path.absolute()
    if not path.parent.is_dir():
        raise BadInput("--socket", str(path), "expected a path in a directory that exists")
    if len(os.fsencode(path)) > MAX_PATH:
        raise BadInput("--socket", str(path), f"expected a path of at most {MAX_PATH} bytes")
    if not path.exists():
        return
    if not path.is_socket():
        raise BadInput("--socket", str(path), "expected a path that is free; something else is there")
    if _is_listened_at(path):  # else it is stale
        raise BadInput("--socket", str(path), "expected a path that is free; the socket is in use")
