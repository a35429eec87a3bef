"""Where a run that goes on can be looked at: `live.json` in its folder, there for as long as the run is."""

import json
import os
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from swarmwire.comms.config import from_json
from swarmwire.comms.errors import BadInput
from swarmwire.metrics.atomic import write_text

LIVE = "live.json"


@dataclass(frozen=True)
class Live:
    """A run that can be looked at."""

    endpoint: str  # of observers
    run: str  # its id
    pid: int  # of the world's process

    def write(self, folder: Path) -> None:
        """Tell of it in the run folder; whoever reads the file finds all of it or none."""
        write_text(folder / LIVE, json.dumps(asdict(self)))


def read_live(folder: Path) -> Live | None:
    """The run that goes on in this folder, None if there is none; BadInput if its file says something else."""
    path = folder / LIVE
    try:
        told: Any = from_json(path.read_bytes())
        live = Live(str(told["endpoint"]), str(told["run"]), int(told["pid"]))
    except FileNotFoundError:
        return None
    except (ValueError, KeyError, TypeError) as error:
        raise BadInput(str(path), "", "expected endpoint, run and pid, as a run writes them") from error
    return live if goes_on(live.pid) else None


def forget_live(folder: Path) -> None:
    """The run in this folder is over."""
    with suppress(FileNotFoundError):
        (folder / LIVE).unlink()


def goes_on(pid: int) -> bool:
    """Whether there is such a process: a run that was killed leaves its file behind."""
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return True
