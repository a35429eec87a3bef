"""What people did to a run while it went on: `live_events.jsonl`, a line for each event given and each one ended.

Each line is there before the event takes effect, and goes to the system in one write: a run that is killed can be
repeated with all that was done to it. A line that is cut off at the end of the file is passed over.

    {"tick": 120, "number": 2, "event": {"do": "kill", "robots": {"count": 3}}}
    {"tick": 180, "number": 2, "end": true}
"""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

from swarmwire.comms.config import from_json
from swarmwire.comms.errors import BadInput
from swarmwire.metrics.run_folder.layout import LIVE_EVENTS
from swarmwire.world.live_events import LiveEvent


@dataclass(frozen=True)
class LiveEventsRecord:
    """The recorded live_events of a run."""

    path: str  # within the run folder
    sha256: str  # of the file
    lines: int


class LiveEventsLog:
    """Appends live_events to the file in a run folder."""

    def __init__(self, folder: Path) -> None:
        self._path = folder / LIVE_EVENTS
        self._sha256, self._lines, self._broken = hashlib.sha256(), 0, False

    def keep(self, live_event: LiveEvent) -> None:
        """Write its line; OSError if that fails, and from then on: half a line may be there, which ends the record."""
        if self._broken:
            raise OSError(f"{self._path} could not be written before")
        table = live_event.table
        what = {"end": True} if table is None else {"event": table}
        line = json.dumps({"tick": live_event.tick, "number": live_event.number, **what}).encode() + b"\n"
        self._broken = True
        with self._path.open("ab", buffering=0) as file:
            if file.write(line) != len(line):
                raise OSError(f"{self._path} could not be written whole")
        self._broken = False
        self._lines += 1
        self._sha256.update(line)

    def record(self) -> LiveEventsRecord | None:
        """What was recorded; None if nothing was done to the run."""
        return LiveEventsRecord(LIVE_EVENTS, self._sha256.hexdigest(), self._lines) if self._lines else None


def read_live_events(folder: Path) -> tuple[tuple[LiveEvent, ...], str | None]:
    """What was done to the run of this folder, and the sha256 of its lines, None if there are none.

    BadInput names the line that is none of ours.
    """
    path = folder / LIVE_EVENTS
    try:
        data = path.read_bytes()
    except FileNotFoundError:
        return (), None
    except OSError as error:
        raise BadInput(str(path), "", f"expected a readable file: {error.strerror}") from None
    data = data[: data.rfind(b"\n") + 1]
    found = tuple(_of_line(line, f"line {number}", path) for number, line in enumerate(data.splitlines(), 1))
    return found, hashlib.sha256(data).hexdigest() if found else None


def _of_line(line: bytes, key: str, path: Path) -> LiveEvent:
    try:
        said: Any = from_json(line)
        tick, number = said["tick"], said["number"]
        table = None if said.get("end") is True else said["event"]
    except (ValueError, KeyError, TypeError, AttributeError):
        tick = number = table = None
    if type(tick) is int and type(number) is int and (table is None or isinstance(table, dict)):
        return LiveEvent(tick, number, cast("Mapping[str, Any] | None", table))
    raise BadInput(str(path), key, "expected tick, number, and event or end, as a run writes them")
