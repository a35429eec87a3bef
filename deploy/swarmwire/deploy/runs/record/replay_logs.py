"""Logs from which a run is repeated and compared: its live events, and a digest of each tick.

`live_events.jsonl` has a line for each begin and end of a live event. The line is written, in one write, before the
event takes effect, so that a killed run can be repeated with all its events. A line that is cut off at the end of the
file is ignored.

    {"tick": 120, "number": 2, "event": {"do": "kill", "robots": {"count": 3}}}
    {"tick": 180, "number": 2, "end": true}

`trajectory.digests` has 8 bytes for each tick, the start of a SHA-256 over the trajectory hashes of all arenas so far.
They show the first tick in which two runs differ, also for a killed run.
"""

import hashlib
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO, cast

from swarmwire.comms.base.config import from_json
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.observe.interfaces import Observer
from swarmwire.comms.observe.truth import Static, Truth
from swarmwire.comms.radio.records import PacketCounts
from swarmwire.metrics.records.run_folder.layout import DIGEST_BYTES, DIGESTS, LIVE_EVENTS
from swarmwire.world.live_events import LiveEvent


@dataclass(frozen=True)
class LiveEventsRecord:
    """The recorded live events of a run."""

    path: str  #: path within the run folder
    sha256: str  #: hash of the file
    lines: int


class LiveEventsLog:
    """Appends live events to the file in a run folder."""

    def __init__(self, folder: Path) -> None:
        self._path = folder / LIVE_EVENTS
        self._sha256, self._lines, self._is_damaged = hashlib.sha256(), 0, False

    def keep(self, live_event: LiveEvent) -> None:
        """Write the line of an event; OSError if that fails, and for later events, since half a line may be written."""
        if self._is_damaged:
            raise OSError(f"{self._path} could not be written before")
        table = live_event.table
        change = {"end": True} if table is None else {"event": table}
        line = json.dumps({"tick": live_event.tick, "number": live_event.number, **change}).encode() + b"\n"
        self._is_damaged = True
        with self._path.open("ab", buffering=0) as file:
            if file.write(line) != len(line):
                raise OSError(f"{self._path} could not be written completely")
        self._is_damaged = False
        self._lines += 1
        self._sha256.update(line)

    def record(self) -> LiveEventsRecord | None:
        """Return the record; None without live events."""
        return LiveEventsRecord(LIVE_EVENTS, self._sha256.hexdigest(), self._lines) if self._lines else None


def read_live_events(folder: Path) -> tuple[tuple[LiveEvent, ...], str | None]:
    """Read the live events of the run of this folder, and the hash of their lines, None without live events.

    BadInput names an invalid line.
    """
    path = folder / LIVE_EVENTS
    try:
        data = path.read_bytes()
    except FileNotFoundError:
        return (), None
    except OSError as error:
        raise BadInput(str(path), "", f"expected a readable file: {error.strerror}") from None
    data = data[: data.rfind(b"\n") + 1]
    events = tuple(_parse_line(line, f"line {number}", path) for number, line in enumerate(data.splitlines(), 1))
    return events, hashlib.sha256(data).hexdigest() if events else None


def _parse_line(line: bytes, key: str, path: Path) -> LiveEvent:
    try:
        entry: Any = from_json(line)
        tick, number = entry["tick"], entry["number"]
        table = None if entry.get("end") is True else entry["event"]
    except (ValueError, KeyError, TypeError, AttributeError):
        tick = number = table = None
    if type(tick) is int and type(number) is int and (table is None or isinstance(table, dict)):
        return LiveEvent(tick, number, cast("Mapping[str, Any] | None", table))
    raise BadInput(str(path), key, "expected tick, number, and event or end, as a run writes them")


Hashes = Callable[[], list[str]]  # returns the trajectory hash of each arena up to the last tick


class TrajectoryLog(Observer):
    """Observer that writes the digest of each tick into the run folder, unbuffered."""

    def __init__(self, folder: Path, hashes: Hashes) -> None:
        self._path, self._hashes = folder / DIGESTS, hashes
        self._file: BinaryIO | None = None

    def begin(self, static: Static) -> None:
        """Open the file."""
        self._file = self._path.open("wb", buffering=0)

    def see(self, truth: Truth) -> None:
        """Write the digest of this tick."""
        if self._file is not None:
            self._file.write(_digest(self._hashes))

    def end(self, last: PacketCounts | None) -> dict[str, Any]:
        """Close the file."""
        if self._file is not None:
            self._file.close()
        return {}


class TrajectoryCheck(Observer):
    """Observer that compares each tick with the same tick of another run, as far as its log reaches.

    Attributes:
        compared: the number of compared ticks.
        first_difference: the first tick that differs; None: no tick differs.
    """

    def __init__(self, folder: Path, hashes: Hashes) -> None:
        self._expected, self._hashes = _read_digests(folder), hashes
        self.compared = 0
        self.first_difference: int | None = None

    def see(self, truth: Truth) -> None:
        """Compare this tick."""
        start = truth.tick * DIGEST_BYTES
        expected = self._expected[start : start + DIGEST_BYTES]
        if len(expected) < DIGEST_BYTES:
            return
        self.compared += 1
        if self.first_difference is None and _digest(self._hashes) != expected:
            self.first_difference = truth.tick


def _digest(hashes: Hashes) -> bytes:
    return hashlib.sha256("".join(hashes()).encode()).digest()[:DIGEST_BYTES]


def ticks_logged(folder: Path) -> int:
    """Return the number of ticks in the log of this folder."""
    return len(_read_digests(folder)) // DIGEST_BYTES


def _read_digests(folder: Path) -> bytes:
    try:
        return (folder / DIGESTS).read_bytes()
    except FileNotFoundError:
        return b""
    except OSError as error:
        raise BadInput(str(folder / DIGESTS), "", f"expected a readable file: {error.strerror}") from None
