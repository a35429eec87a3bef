"""Control of a run in another process, for `swarmwire ctl` and the page, and the list of this machine's runs.

Until it ends, a run has a file in a private folder: `swarmwire` in XDG_RUNTIME_DIR, if that belongs to the user, else
a folder named after the user among the temporary files. The folder must belong to the user and be closed to others,
who could otherwise lead users to another run.
"""

import json
import os
import tempfile
from collections.abc import Generator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import zenoh

from swarmwire.comms.base.atomic import write_text
from swarmwire.comms.base.config import did_you_mean, from_json
from swarmwire.comms.base.errors import BadFrame, BadInput, SwarmwireError
from swarmwire.comms.observe.interfaces import Observer
from swarmwire.comms.observe.truth import Static
from swarmwire.comms.radio.records import PacketCounts
from swarmwire.comms.wire.control_frames import ControlRequest, decode_reply, encode_request
from swarmwire.comms.wire.keys import ObserverKeys
from swarmwire.comms.wire.network import Network
from swarmwire.comms.wire.sessions import closed_after, open_observer
from swarmwire.deploy.live.following import RunGone
from swarmwire.deploy.runs.live_address import process_exists, read_live

ANY_PUBLISHED = ObserverKeys("*").published
ANSWER_TIMEOUT_S = 10.0  # a run answers in milliseconds, unless its machine is very busy


class Refused(SwarmwireError):
    """The run refuses a command: an unknown robot, an event that is over, a speed out of bounds."""


class RemoteControl:
    """Commands to a live run. Each call returns once the run has accepted it; `status` shows its effect.

    Calls raise Refused with the run's reason, and RunGone if no run answers.
    """

    def __init__(self, session: zenoh.Session, run: str) -> None:
        """Control the run of this id, on a session with its observers' endpoint."""
        self._session, self._keys = session, ObserverKeys(run)

    def status(self) -> dict[str, Any]:
        """Return the status: tick, state, robots alive, runners, metrics, the radio's numbers, events."""
        return self._get(self._keys.status)

    def pause(self) -> dict[str, Any]:
        """Pause the run at the end of the current tick."""
        return self._command("pause")

    def resume(self) -> dict[str, Any]:
        """Resume."""
        return self._command("resume")

    def step(self, n: int = 1) -> dict[str, Any]:
        """Run exactly `n` ticks, then pause."""
        return self._command("step", n)

    def speed(self, factor: float | None) -> dict[str, Any]:
        """Set the speed in simulated seconds per second of wall time; None: as fast as possible."""
        return self._command("speed", factor)

    def stop(self) -> dict[str, Any]:
        """End the run after the current tick."""
        return self._command("stop")

    def event(self, table: Mapping[str, Any]) -> int:
        """Submit an event (a scenario's table without at_s) for the start of the next tick; return its number."""
        return int(self._command("event", dict(table))["event"])

    def end(self, number: int) -> dict[str, Any]:
        """End a lasting event at the start of the next tick."""
        return self._command("end", number)

    def _command(self, do: str, value: Any = None) -> dict[str, Any]:
        return self._get(self._keys.control, encode_request(ControlRequest(do, value)))

    def _get(self, key: str, payload: bytes | None = None) -> dict[str, Any]:
        try:
            for reply in self._session.get(key, payload=payload, timeout=ANSWER_TIMEOUT_S):
                if reply.ok is not None:
                    return decode_reply(reply.ok.payload.to_bytes())
                line = reply.err.payload.to_string() if reply.err else ""
                if line != "Timeout":
                    raise Refused(line)
        except zenoh.ZError as error:
            raise RunGone(f"the run cannot be reached any more: {str(error).split(' at ')[0]}") from error
        except BadFrame as error:
            raise Refused(f"the run's answer is not that of this version of swarmwire: {error}") from error
        raise RunGone("no answer: the run has ended or hangs, or this client lacks the right")


@contextmanager
def controlling(endpoint: str, run: str, network: Network | None = None) -> Generator[RemoteControl]:
    """Yield control of the run of this id, by its observers' endpoint; RunGone if it is gone.

    `network` has the certificates for an endpoint on another machine.
    """
    with _observing(endpoint, network) as session:
        yield RemoteControl(session, run)


def only_run_at(endpoint: str, network: Network | None = None) -> str:
    """Return the id of the run that is published at an endpoint; RunGone if there is none, or several."""
    with _observing(endpoint, network) as session:
        replies = session.liveliness().get(ANY_PUBLISHED, timeout=ANSWER_TIMEOUT_S)
        runs = sorted({str(reply.ok.key_expr).split("/")[1] for reply in replies if reply.ok is not None})
    if len(runs) != 1:
        raise RunGone(f"expected a run at {endpoint}, found {', '.join(runs) or 'none'}; RUN names one")
    return runs[0]


@contextmanager
def _observing(endpoint: str, network: Network | None) -> Generator[zenoh.Session]:
    try:
        session = open_observer(endpoint, network)
    except zenoh.ZError as error:
        refused = ", or one certificate or the other is not accepted" if network and network.proves else ""
        reason = str(error).split(" at ")[0]
        raise RunGone(f"the run at {endpoint} cannot be reached{refused}: {reason}") from error
    with closed_after(session):
        yield session


OTHERS_MODE = 0o077  # bits of a folder's mode that give access to other users


@dataclass(frozen=True)
class FoundRun:
    """A live run on this machine."""

    run: str  # id
    endpoint: str  # endpoint of observers
    pid: int  # process of the world
    scenario: str  # name of the scenario
    folder: str  # run folder


class Announced(Observer):
    """Observer that registers a run for `swarmwire ctl`; the run must be published in its folder before it begins."""

    before_agents = True  # begins before the agents have joined

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._path: Path | None = None

    def begin(self, static: Static) -> None:
        """Write the file with the run's address."""
        live = read_live(self._folder)
        if live is None:
            return
        run = FoundRun(live.run, live.endpoint, live.pid, static.name, str(self._folder.absolute()))
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


def found_runs() -> list[FoundRun]:
    """Return the live runs of this user on this machine, oldest first; remove files of runs that were killed."""
    runs: list[tuple[float, FoundRun]] = []
    for path in runs_folder().glob("[!.]*.json"):
        with suppress(OSError):  # the run ended meanwhile
            run, started_s = _read(path), path.stat().st_mtime
            if run is not None and process_exists(run.pid):
                runs.append((started_s, run))
            else:
                path.unlink(missing_ok=True)
    return [run for _, run in sorted(runs, key=lambda item: (item[0], item[1].run))]


def find_run(name: str | None) -> FoundRun:
    """Return the run of this id (or the beginning of an id) or in this folder; None: the only live run.

    BadInput lists the live runs.
    """
    if name is not None and Path(name).is_dir():
        live = read_live(Path(name))
        if live is None:
            raise BadInput(name, "", "expected the folder of a live run")
        return FoundRun(live.run, live.endpoint, live.pid, "", name)
    runs = found_runs()
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


def _read(path: Path) -> FoundRun | None:
    """Return the run of a file; None for invalid content."""
    try:
        table: Any = from_json(path.read_bytes())
        texts = {name: str(table[name]) for name in ("run", "endpoint", "scenario", "folder")}
        return FoundRun(pid=int(table["pid"]), **texts)
    except (ValueError, KeyError, TypeError):
        return None
