"""Control over a run that another process executes, behind `swarmwire ctl` and the page, and how runs here are found.

A run of this machine has a file, until it ends, in a private folder: `swarmwire` in XDG_RUNTIME_DIR, if
that is the user's, else one named after the user among the temporary files. The folder must be the user's own and
closed to others: who may write there could lead people to another run.
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
from swarmwire.deploy.runs.live_address import goes_on, read_live

ANY_PUBLISHED = ObserverKeys("*").published
ANSWER_S = 10.0  # a run answers in milliseconds, unless its machine is very busy


class Refused(SwarmwireError):
    """What the run does not do, in its own line: an unknown robot, an event that is over, a speed beyond bounds."""


class RemoteControl:
    """The commands to a live run. Each call returns once the run has accepted it; `status` shows when it is done.

    Each raises Refused with the run's line, and RunGone if no run answers.
    """

    def __init__(self, session: zenoh.Session, run: str) -> None:
        """Of the run of this id, on a session with its observers' endpoint."""
        self._session, self._keys = session, ObserverKeys(run)

    def status(self) -> dict[str, Any]:
        """How the run is doing: tick, state, robots alive, runners, metrics, the radio's numbers, events."""
        return self._get(self._keys.status)

    def pause(self) -> dict[str, Any]:
        """Let no tick begin from now on."""
        return self._ask("pause")

    def resume(self) -> dict[str, Any]:
        """Resume."""
        return self._ask("resume")

    def step(self, n: int = 1) -> dict[str, Any]:
        """Let exactly `n` ticks go, then pause."""
        return self._ask("step", n)

    def speed(self, factor: float | None) -> dict[str, Any]:
        """So many simulated seconds per second of wall time; None: as fast as possible."""
        return self._ask("speed", factor)

    def stop(self) -> dict[str, Any]:
        """End the run after the tick that is under way."""
        return self._ask("stop")

    def event(self, table: Mapping[str, Any]) -> int:
        """Have an event happen at the start of the next tick; its number. The table is a scenario's, without at_s."""
        return int(self._ask("event", dict(table))["event"])

    def end(self, number: int) -> dict[str, Any]:
        """Undo an event that lasts, at the start of the next tick."""
        return self._ask("end", number)

    def _ask(self, do: str, value: Any = None) -> dict[str, Any]:
        return self._get(self._keys.control, encode_request(ControlRequest(do, value)))

    def _get(self, key: str, payload: bytes | None = None) -> dict[str, Any]:
        try:
            for reply in self._session.get(key, payload=payload, timeout=ANSWER_S):
                if reply.ok is not None:
                    return decode_reply(reply.ok.payload.to_bytes())
                line = reply.err.payload.to_string() if reply.err else ""
                if line != "Timeout":
                    raise Refused(line)
        except zenoh.ZError as error:
            raise RunGone(f"the run cannot be asked any more: {str(error).split(' at ')[0]}") from error
        except BadFrame as error:
            raise Refused(f"the run answers in another way than this swarmwire expects: {error}") from error
        raise RunGone("no answer: the run has ended or hangs, or this client lacks the right")


@contextmanager
def controlling(endpoint: str, run: str, network: Network | None = None) -> Generator[RemoteControl]:
    """Control over the run of this id, by its observers' endpoint, until the end of the block; RunGone if it is gone.

    `network` brings the certificates that an endpoint beyond this machine asks for.
    """
    with _observing(endpoint, network) as session:
        yield RemoteControl(session, run)


def only_run_at(endpoint: str, network: Network | None = None) -> str:
    """The id of the run that is published at an endpoint; RunGone if there is none, or several."""
    with _observing(endpoint, network) as session:
        found = session.liveliness().get(ANY_PUBLISHED, timeout=ANSWER_S)
        runs = sorted({str(reply.ok.key_expr).split("/")[1] for reply in found if reply.ok is not None})
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


OF_OTHERS = 0o077  # bits of a folder's mode that let others than its owner at it


@dataclass(frozen=True)
class FoundRun:
    """A live run on this machine."""

    run: str  # its id
    endpoint: str  # of observers
    pid: int  # of the world's process
    scenario: str  # its name
    folder: str  # the run folder


class Announced(Observer):
    """Observer that makes a run one that `swarmwire ctl` finds; it must be published in its folder before it begins."""

    before_agents = True  # it begins before the run's agents are there

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._path: Path | None = None

    def begin(self, static: Static) -> None:
        """Write its address."""
        live = read_live(self._folder)
        if live is None:
            return
        found = FoundRun(live.run, live.endpoint, live.pid, static.name, str(self._folder.absolute()))
        self._path = runs_folder() / f"{live.run}.json"
        write_text(self._path, json.dumps(asdict(found)))

    def end(self, last: PacketCounts | None) -> dict[str, Any]:
        """It is over."""
        if self._path is not None:
            self._path.unlink(missing_ok=True)
        return {}


def runs_folder() -> Path:
    """The user's folder of runs, made if need be; BadInput if it is not the user's alone."""
    base = os.environ.get("XDG_RUNTIME_DIR")
    if base and _is_own(Path(base)):
        folder = Path(base, "swarmwire")
    else:
        folder = Path(tempfile.gettempdir(), f"swarmwire-{os.getuid()}")
    try:
        folder.mkdir(mode=0o700, exist_ok=True)
        about = folder.lstat()
    except OSError as error:
        raise BadInput(str(folder), "", f"expected a folder for the user's runs: {error.strerror}") from None
    if about.st_uid != os.getuid() or about.st_mode & OF_OTHERS or not folder.is_dir() or folder.is_symlink():
        raise BadInput(str(folder), "", "expected a folder that is the user's and closed to others: chmod 700")
    return folder


def found_runs() -> list[FoundRun]:
    """The live runs of this user on this machine, oldest first; files of runs that were killed are removed."""
    found: list[tuple[float, FoundRun]] = []
    for path in runs_folder().glob("[!.]*.json"):
        with suppress(OSError):  # it has ended by now
            run, at_s = _read(path), path.stat().st_mtime
            if run is not None and goes_on(run.pid):
                found.append((at_s, run))
            else:
                path.unlink(missing_ok=True)
    return [run for _, run in sorted(found, key=lambda item: (item[0], item[1].run))]


def find_run(named: str | None) -> FoundRun:
    """The run of this id (or the start of one) or in this folder, or, with None, the only one there is.

    BadInput lists those that there are.
    """
    if named is not None and Path(named).is_dir():
        live = read_live(Path(named))
        if live is None:
            raise BadInput(named, "", "expected the folder of a live run")
        return FoundRun(live.run, live.endpoint, live.pid, "", named)
    runs = found_runs()
    meant = [run for run in runs if run.run.startswith(named or "")]
    if len(meant) == 1:
        return meant[0]
    where = "RUN" if named is None else named
    if not runs:
        raise BadInput("" if named is None else named, "", "expected a live run: this machine has none of yours")
    listed = [f"{run.run} ({run.scenario}, {run.folder})" for run in runs]
    if meant or named is None:
        raise BadInput("", where, f"several runs are live; expected one of {', '.join(listed)}")
    raise BadInput("", where, f"expected {did_you_mean([run.run for run in runs], named)}, or a run's folder")


def _is_own(folder: Path) -> bool:
    """Whether it is a folder of this user's: `su` and `sudo` may leave the variable as another's."""
    try:
        return folder.is_dir() and folder.stat().st_uid == os.getuid()
    except OSError:  # in a folder that is not open to this user
        return False


def _read(path: Path) -> FoundRun | None:
    """The run of a file; None if it says something else."""
    try:
        told: Any = from_json(path.read_bytes())
        run, endpoint, scenario, folder = (str(told[name]) for name in ("run", "endpoint", "scenario", "folder"))
        return FoundRun(run, endpoint, int(told["pid"]), scenario, folder)
    except (ValueError, KeyError, TypeError):
        return None
