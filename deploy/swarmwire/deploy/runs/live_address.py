"""The address of a live run, `live.json` in its folder."""

import json
import os
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from swarmwire.comms.base.atomic import write_text
from swarmwire.comms.base.config import from_json
from swarmwire.comms.base.errors import BadInput

LIVE = "live.json"


@dataclass(frozen=True)
class Live:
    """The address of a run that observers can join."""

    endpoint: str  # endpoint for observers
    run: str  # id of the run
    pid: int  # process of the world

    def write(self, folder: Path) -> None:
        """Write the address to the run folder; a reader finds the complete file or none."""
        write_text(folder / LIVE, json.dumps(asdict(self)))


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


def remove_live_address(folder: Path) -> None:
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
