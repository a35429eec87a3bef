"""Logs by which a run is repeated and compared: what people did to it, and how it went, tick by tick.

`live_events.jsonl` has a line for each event given and each one ended. The line is there before the event takes effect,
and goes to the system in one write: a run that is killed can be repeated with all that was done to it. A line that is
cut off at the end of the file is passed over.

    {"tick": 120, "number": 2, "event": {"do": "kill", "robots": {"count": 3}}}
    {"tick": 180, "number": 2, "end": true}

`trajectory.digests` has 8 bytes for each tick, the start of a SHA-256 over the trajectory hashes of all arenas so far.
They show at which tick two runs differ first, also for a run that was killed.
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


Hashes = Callable[[], list[str]]  # the trajectory hash of each arena so far


class TrajectoryLog(Observer):
    """Observer that writes the digest of each tick into the run folder, at once."""

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
    """Observer that compares each tick with that of another run, as far as that logged it.

    Attributes:
        compared: ticks that were compared.
        first_difference: the first tick that came out differently; None: so far none.
    """

    def __init__(self, folder: Path, hashes: Hashes) -> None:
        self._expected, self._hashes = _logged(folder), hashes
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
    """How many ticks the run of this folder logged."""
    return len(_logged(folder)) // DIGEST_BYTES


def _logged(folder: Path) -> bytes:
    try:
        return (folder / DIGESTS).read_bytes()
    except FileNotFoundError:
        return b""
    except OSError as error:
        raise BadInput(str(folder / DIGESTS), "", f"expected a readable file: {error.strerror}") from None
