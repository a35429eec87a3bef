"""The runs of this machine find each other: a file per run in a private folder of the user, for as long as it goes on.

The folder is `swarmwire` in XDG_RUNTIME_DIR, if that is the user's, else one named after the user among the temporary
files, which must be the user's own and closed to others: who may write there could lead people to another run.
"""

import json
import os
import tempfile
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from swarmwire.comms.config import did_you_mean, from_json
from swarmwire.comms.errors import BadInput
from swarmwire.comms.interfaces import Observer
from swarmwire.comms.truth import PacketCounts, Static
from swarmwire.deploy.live.following import goes_on, read_live
from swarmwire.metrics.atomic import write_text

OF_OTHERS = 0o077  # bits of a folder's mode that let others than its owner at it


@dataclass(frozen=True)
class FoundRun:
    """A run that goes on on this machine."""

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
        """Tell where it is."""
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
    """The runs of this user that go on on this machine, oldest first; files of runs that were killed are removed."""
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
            raise BadInput(named, "", "expected the folder of a run that goes on")
        return FoundRun(live.run, live.endpoint, live.pid, "", named)
    runs = found_runs()
    meant = [run for run in runs if run.run.startswith(named or "")]
    if len(meant) == 1:
        return meant[0]
    where = "RUN" if named is None else named
    if not runs:
        raise BadInput(
            "" if named is None else named, "", "expected a run that goes on: this machine has none of yours"
        )
    listed = [f"{run.run} ({run.scenario}, {run.folder})" for run in runs]
    if meant or named is None:
        raise BadInput("", where, f"several runs go on; expected one of {', '.join(listed)}")
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
