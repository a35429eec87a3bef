"""A CSV file that only ever grows by whole lines, and whose disk may be full."""

import csv
import io
import json
import os
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from swarmwire.agent.drivers.driver import Command
from swarmwire.agent.radios.radio import ReceivedPacket, SentPacket
from swarmwire.comms.clock import NS_PER_S
from swarmwire.comms.errors import BadInput
from swarmwire.comms.packets import BROADCAST
from swarmwire.comms.wire.radio_bridge import Pose

MAX_WAITING = 1 << 20  # bytes that may wait for a flush


class RowFile:
    """Rows are kept until `flush`; what cannot be written then is dropped and counted.

    Attributes:
        lost_rows: how many rows were dropped.
        fault: why the last flush failed, or None.
    """

    def __init__(self, path: Path, columns: tuple[str, ...]) -> None:
        self.lost_rows = 0
        self.fault: OSError | None = None
        self._file = path.open("wb", buffering=0)
        self._whole_bytes = 0  # up to the last line that is whole
        self._header = (",".join(columns) + "\n").encode()
        self._waiting = io.StringIO()
        self._rows = 0  # that wait
        self._writer = csv.writer(self._waiting, lineterminator="\n")

    def write(self, row: tuple[object, ...]) -> None:
        """Add a row; None is an empty field."""
        self._writer.writerow(row)
        self._rows += 1
        if self._waiting.tell() > MAX_WAITING:
            self.flush()

    def flush(self) -> None:
        """Hand the rows to the disk, whole lines only."""
        rows = self._waiting.getvalue().encode()
        try:
            self._append(rows if self._whole_bytes else self._header + rows)
            self.fault = None
        except OSError as error:
            self.lost_rows += self._rows
            self.fault = error
        self._rows = 0
        self._waiting.seek(0)
        self._waiting.truncate()

    def _append(self, data: bytes) -> None:
        left = memoryview(data)
        try:
            while left:
                left = left[self._file.write(left) or 0 :]
        except OSError:
            with suppress(OSError):  # what is no regular file has no end to cut off
                os.ftruncate(self._file.fileno(), self._whole_bytes)
                self._file.seek(self._whole_bytes)
            raise
        self._whole_bytes += len(data)

    def close(self) -> None:
        """Flush and close; safe to call more than once."""
        if not self._file.closed:
            self.flush()
            self._file.close()


# --- The log of a robot: a new folder for each start of its agent, which `swarmwire sim-to-real` and `radio fit` read.
#
# `robot.json` says what runs; `ticks.csv`, `received.csv` and `sent.csv` grow once a second; `summary.json` is written
# at the end, so a log without one is that of a process that was killed. What a full disk loses is counted, and stops
# nobody.


TICKS = (
    "tick", "t_s", "late", "x_m", "y_m", "heading_rad", "drive", "linear_mps", "angular_radps", "state", "value",
    "charge",
)  # fmt: skip
RECEIVED = ("t_s", "tx", "rx", "seq", "to", "size_bytes", "tag", "latency_s", "distance_m", "given")
SENT = ("t_s", "tx", "seq", "to", "size_bytes", "tag", "fate")


@dataclass(frozen=True, slots=True)
class TickRow:
    """What is kept of one step."""

    tick: int
    utc_ns: int
    late: bool
    pose: Pose | None  # that a tracker tells
    drive: bool  # whether the agent gave a command in this step
    command: Command  # as handed to the driver
    state: str
    value: float | None
    charge: float | None


class RobotLog:
    """The log of one start of one robot's agent; a RadioLog."""

    def __init__(self, folder: Path, robots: tuple[str, ...], own: str) -> None:
        self.folder = folder
        self._robots, self._own = robots, own
        self._lost_files = 0
        self._ticks = RowFile(folder / "ticks.csv", TICKS)
        self._received = RowFile(folder / "received.csv", RECEIVED)
        self._sent = RowFile(folder / "sent.csv", SENT)

    @property
    def _tables(self) -> tuple[RowFile, ...]:
        return self._ticks, self._received, self._sent

    def begin(self, facts: Mapping[str, Any]) -> None:
        """Write `robot.json`."""
        self._write("robot.json", facts)

    def tick(self, row: TickRow) -> None:
        """Keep a step."""
        where = row.pose or (None, None, None)
        speeds = row.command.linear_mps, row.command.angular_radps
        told = row.state, row.value, row.charge
        self._ticks.write((row.tick, seconds(row.utc_ns), int(row.late), *where, int(row.drive), *speeds, *told))

    def received(self, packet: ReceivedPacket) -> None:
        """As `RadioLog.received`."""
        link = self._robots[packet.sender], self._own
        what = packet.sequence, self._to(packet.to), packet.size_bytes, packet.tag
        latency_s = None if packet.latency_ns is None else seconds(packet.latency_ns)
        self._received.write((seconds(packet.utc_ns), *link, *what, latency_s, packet.distance_m, int(packet.given)))

    def sent(self, packet: SentPacket) -> None:
        """As `RadioLog.sent`."""
        what = packet.sequence, self._to(packet.to), packet.size_bytes, packet.tag
        self._sent.write((seconds(packet.utc_ns), self._own, *what, packet.fate))

    def _to(self, to: int) -> str | int | None:
        """The name of the robot that a packet is for; None: all; a number that is no robot's stays."""
        if to == BROADCAST:
            return None
        return self._robots[to] if 0 <= to < len(self._robots) else to

    def flush(self) -> None:
        """Hand to the disk what waits."""
        for table in self._tables:
            table.flush()

    @property
    def fault(self) -> OSError | None:
        """Why the last flush lost rows, or None."""
        return next((table.fault for table in self._tables if table.fault), None)

    def counts(self) -> dict[str, int]:
        """What of the log was lost, by name."""
        lost = {"log_rows_lost": sum(table.lost_rows for table in self._tables), "log_files_lost": self._lost_files}
        return {name: count for name, count in lost.items() if count}

    def end(self, summary: Mapping[str, Any]) -> None:
        """Write `summary.json`, and close."""
        for table in self._tables:
            table.close()
        self._write("summary.json", summary)

    def _write(self, name: str, facts: Mapping[str, Any]) -> None:
        try:
            (self.folder / name).write_text(json.dumps(facts, indent=2) + "\n", encoding="utf-8")
        except OSError:
            self._lost_files += 1


def seconds(time_ns: int) -> str:
    """A time in ns as seconds with all digits, which a float has not room for.

    >>> seconds(1_795_300_000_123_456_789), seconds(-5)
    ('1795300000.123456789', '-0.000000005')
    """
    whole, rest = divmod(abs(time_ns), NS_PER_S)
    return f"{'-' if time_ns < 0 else ''}{whole}.{rest:09d}"


def new_log(parent: Path, robots: tuple[str, ...], own: str, stamp: str, where: str) -> RobotLog:
    """A log in a new folder in `parent`, `{own}-{stamp}`; BadInput at `log` in `where` if there cannot be one."""
    try:
        parent.mkdir(parents=True, exist_ok=True)
        return RobotLog(_new_folder(parent, f"{own}-{stamp}"), robots, own)
    except OSError as error:
        raise BadInput(where, "log", f"expected a folder to write to: {parent}: {error.strerror}") from None


def _new_folder(parent: Path, name: str) -> Path:
    """A folder that was not there, so that no start writes over another's log."""
    tried = 1
    while True:
        folder = parent / (name if tried == 1 else f"{name}-{tried}")
        try:
            folder.mkdir()
        except FileExistsError:
            tried += 1
        else:
            return folder
