"""Addresses of live runs: the socket of a run, `live.json` in its folder, and the list of this machine's runs.

The list is a private folder with a file for each run: `swarmwire` in XDG_RUNTIME_DIR, if that belongs to the user, else
a folder named after the user among the temporary files. The folder must belong to the user and be closed to others,
who could otherwise lead users to another run.
"""

import json
import os
import secrets
import shutil
import socket
import tempfile
from collections.abc import Generator
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from swarmwire.comms.base.atomic import write_text
from swarmwire.comms.base.clock import WallClock, to_ns
from swarmwire.comms.base.config import did_you_mean, from_json
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.observe.interfaces import Observer
from swarmwire.comms.observe.truth import Static
from swarmwire.comms.radio.records import PacketCounts
from swarmwire.comms.wire.sessions import PRIVATE, unix_endpoint

SOCKET = "world"  # name of the socket in its private directory
STALE_S = 60.0  # age of a socket without a listener; the run of a younger one may be about to listen
ANSWER_TIMEOUT_S = 0.5  # limit for a listener to accept a connection
LIVE = "live.json"
OTHERS_MODE = 0o077  # bits of a folder's mode that give access to other users


def new_run_id() -> str:
    """Return a unique name for one execution."""
    return secrets.token_hex(4)


@contextmanager
def local_endpoint() -> Generator[str]:
    """Return an endpoint in a new private directory, which is removed after the context."""
    base = tempfile.gettempdir()
    base = base if len(base) < 60 else "/tmp"
    _remove_stale(Path(base))
    with tempfile.TemporaryDirectory(prefix=PRIVATE, dir=base) as directory:
        yield unix_endpoint(f"{directory}/{SOCKET}")


def _remove_stale(base: Path) -> None:
    """Remove the directories of this user's runs that were killed."""
    before_ns = WallClock().utc_ns() - to_ns(STALE_S)
    for path in base.glob(f"{PRIVATE}*/{SOCKET}"):
        with suppress(OSError):  # another user's, or removed by now
            status = path.lstat()
            is_old = path.is_socket() and status.st_uid == os.getuid() and status.st_mtime_ns < before_ns
            if is_old and not _has_listener(path):
                shutil.rmtree(path.parent)


def _has_listener(path: Path) -> bool:
    with socket.socket(socket.AF_UNIX) as probe:
        probe.settimeout(ANSWER_TIMEOUT_S)
        try:
            probe.connect(str(path))
        except ConnectionRefusedError:
            return False
        except (TimeoutError, BlockingIOError):  # the listener is frozen, and its queue is full
            return True
        return True


@dataclass(frozen=True)
class Live:
    """The address of a run that observers can join."""

    endpoint: str  #: endpoint for observers
    run: str  #: id of the run
    pid: int  #: process of the world


def write_live(live: Live, folder: Path) -> None:
    """Write the address to the run folder; a reader finds the complete file or none."""
    write_text(folder / LIVE, json.dumps(asdict(live)))


def read_live(folder: Path) -> Live | None:
    """Return the address of the live run of this folder, None without one; BadInput for an invalid file."""
    path = folder / LIVE
    try:
        content: Any = from_json(path.read_bytes())
        live = Live(str(content["endpoint"]), str(content["run"]), int(content["pid"]))
    except FileNotFoundError:
        return None
    except (ValueError, KeyError, TypeError) as error:
        raise BadInput(str(path), "", "expected endpoint, run and pid, as a run writes them") from error
    return live if process_exists(live.pid) else None


def remove_live(folder: Path) -> None:
    """Remove the address of a run that has ended."""
    with suppress(FileNotFoundError):
        (folder / LIVE).unlink()


def process_exists(pid: int) -> bool:
    """Return True if the process exists; the file of a killed run stays."""
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return True


@dataclass(frozen=True)
class LiveRun(Live):
    """A live run in the list of this machine's runs."""

    scenario: str  #: name of the scenario
    folder: str  #: run folder


class Announcement(Observer):
    """Observer that adds a run to the list of this machine's runs; `Published` must have begun before."""

    before_agents = True  # begins before the agents have joined

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._path: Path | None = None

    def begin(self, static: Static) -> None:
        """Write the file with the run's address."""
        live = read_live(self._folder)
        if live is None:
            return
        run = LiveRun(live.endpoint, live.run, live.pid, static.name, str(self._folder.absolute()))
        self._path = runs_folder() / f"{live.run}.json"
        write_text(self._path, json.dumps(asdict(run)))

    def end(self, last: PacketCounts | None) -> dict[str, Any]:
        """Remove the file."""
        if self._path is not None:
            self._path.unlink(missing_ok=True)
        return {}


def runs_folder() -> Path:
    """Return the user's folder of runs, created if missing; BadInput if others have access to it."""
    base = os.environ.get("XDG_RUNTIME_DIR")
    if base and _belongs_to_user(Path(base)):
        folder = Path(base, "swarmwire")
    else:
        folder = Path(tempfile.gettempdir(), f"swarmwire-{os.getuid()}")
    try:
        folder.mkdir(mode=0o700, exist_ok=True)
        about = folder.lstat()
    except OSError as error:
        raise BadInput(str(folder), "", f"expected a folder for the user's runs: {error.strerror}") from None
    if about.st_uid != os.getuid() or about.st_mode & OTHERS_MODE or not folder.is_dir() or folder.is_symlink():
        raise BadInput(str(folder), "", "expected a folder that is the user's and closed to others: chmod 700")
    return folder


def live_runs() -> list[LiveRun]:
    """Return the live runs of this user on this machine, oldest first; remove files of runs that were killed."""
    runs: list[tuple[float, LiveRun]] = []
    for path in runs_folder().glob("[!.]*.json"):
        with suppress(OSError):  # the run ended meanwhile
            run, started_s = _read(path), path.stat().st_mtime
            if run is not None and process_exists(run.pid):
                runs.append((started_s, run))
            else:
                path.unlink(missing_ok=True)
    return [run for _, run in sorted(runs, key=lambda item: (item[0], item[1].run))]


def find_run(name: str | None) -> LiveRun:
    """Return the run of this id (or the beginning of an id) or in this folder; None: the only live run.

    BadInput lists the live runs.
    """
    if name is not None and Path(name).is_dir():
        live = read_live(Path(name))
        if live is None:
            raise BadInput(name, "", "expected the folder of a live run")
        return LiveRun(live.endpoint, live.run, live.pid, "", name)
    runs = live_runs()
    matching = [run for run in runs if run.run.startswith(name or "")]
    if len(matching) == 1:
        return matching[0]
    where = "RUN" if name is None else name
    if not runs:
        raise BadInput("" if name is None else name, "", "expected a live run: this machine has none of yours")
    listed = [f"{run.run} ({run.scenario}, {run.folder})" for run in runs]
    if matching or name is None:
        raise BadInput("", where, f"several runs are live; expected one of {', '.join(listed)}")
    raise BadInput("", where, f"expected {did_you_mean([run.run for run in runs], name)}, or a run's folder")


def _belongs_to_user(folder: Path) -> bool:
    """Return True if this user owns the folder: after `su` or `sudo`, the variable may name another user's."""
    try:
        return folder.is_dir() and folder.stat().st_uid == os.getuid()
    except OSError:  # no access
        return False


def _read(path: Path) -> LiveRun | None:
    """Return the run of a file; None for invalid content."""
    try:
        table: Any = from_json(path.read_bytes())
        texts = {name: str(table[name]) for name in ("run", "endpoint", "scenario", "folder")}
        return LiveRun(pid=int(table["pid"]), **texts)
    except (ValueError, KeyError, TypeError):
        return None
