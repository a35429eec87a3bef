"""The log of a robot: a new folder for each start of its agent, read by `swarmwire sim-to-real` and `radio fit`.

`robot.json` holds the configuration; `ticks.csv`, `received.csv` and `sent.csv` grow once a second, by whole lines;
`summary.json` is written at the end, so a log without it belongs to a process that was killed. Rows lost to a full disk
are counted, and do not stop the robot.
"""

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
from swarmwire.comms.base.atomic import write_text
from swarmwire.comms.base.clock import NS_PER_S
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.base.sentinels import BROADCAST
from swarmwire.comms.wire.radio_bridge import Pose

MAX_BUFFERED_BYTES = 1 << 20  # above this size, the buffered rows are flushed
TICKS = (
    "tick", "t_s", "late", "x_m", "y_m", "heading_rad", "drive", "linear_mps", "angular_radps", "state", "value",
    "charge",
)  # fmt: skip
RECEIVED = ("t_s", "tx", "rx", "seq", "to", "size_bytes", "tag", "latency_s", "distance_m", "given")
SENT = ("t_s", "tx", "seq", "to", "size_bytes", "tag", "fate")


class RowFile:
    """A CSV file that grows by whole lines; rows that cannot be written at a flush are dropped and counted.

    Attributes:
        lost_rows: rows dropped so far.
        fault: the error of the last flush, or None.
    """

    def __init__(self, path: Path, columns: tuple[str, ...]) -> None:
        self.lost_rows = 0
        self.fault: OSError | None = None
        self._file = path.open("wb", buffering=0)
        self._written_bytes = 0  # length of the file up to the end of its last whole line
        self._header = (",".join(columns) + "\n").encode()
        self._buffer = io.StringIO()
        self._buffered_rows = 0
        self._writer = csv.writer(self._buffer, lineterminator="\n")

    def write(self, row: tuple[object, ...]) -> None:
        """Add a row; None is an empty field."""
        self._writer.writerow(row)
        self._buffered_rows += 1
        if self._buffer.tell() > MAX_BUFFERED_BYTES:
            self.flush()

    def flush(self) -> None:
        """Write the buffered rows, whole lines only."""
        rows = self._buffer.getvalue().encode()
        try:
            self._append(rows if self._written_bytes else self._header + rows)
            self.fault = None
        except OSError as error:
            self.lost_rows += self._buffered_rows
            self.fault = error
        self._buffered_rows = 0
        self._buffer.seek(0)
        self._buffer.truncate()

    def _append(self, data: bytes) -> None:
        remaining = memoryview(data)
        try:
            while remaining:
                remaining = remaining[self._file.write(remaining) or 0 :]
        except OSError:
            with suppress(OSError):  # only a regular file can be truncated
                os.ftruncate(self._file.fileno(), self._written_bytes)
                self._file.seek(self._written_bytes)
            raise
        self._written_bytes += len(data)

    def close(self) -> None:
        """Flush and close; safe to call more than once."""
        if not self._file.closed:
            self.flush()
            self._file.close()


@dataclass(frozen=True, slots=True)
class TickRow:
    """A row of `ticks.csv`."""

    tick: int
    utc_ns: int
    late: bool
    pose: Pose | None  # the tracker's pose of the robot
    drive: bool  # True if the agent commanded a speed in this step
    command: Command  # the command to the driver
    state: str
    value: float | None
    charge: float | None


class RobotLog:
    """The log of one start of one robot's agent, a RadioLog."""

    def __init__(self, folder: Path, robots: tuple[str, ...], robot: str) -> None:
        self.folder = folder
        self._robots, self._robot = robots, robot
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
        """Log a step."""
        pose = row.pose or (None, None, None)
        speeds = row.command.linear_mps, row.command.angular_radps
        state = row.state, row.value, row.charge
        self._ticks.write((row.tick, seconds(row.utc_ns), int(row.late), *pose, int(row.drive), *speeds, *state))

    def received(self, packet: ReceivedPacket) -> None:
        """Log a packet that arrived."""
        link = self._robots[packet.sender], self._robot
        fields = packet.sequence, self._addressee(packet.to), packet.size_bytes, packet.tag
        latency_s = None if packet.latency_ns is None else seconds(packet.latency_ns)
        self._received.write(
            (seconds(packet.utc_ns), *link, *fields, latency_s, packet.distance_m, int(packet.delivered))
        )

    def sent(self, packet: SentPacket) -> None:
        """Log a packet that the agent sent."""
        fields = packet.sequence, self._addressee(packet.to), packet.size_bytes, packet.tag
        self._sent.write((seconds(packet.utc_ns), self._robot, *fields, packet.fate))

    def _addressee(self, to: int) -> str | int | None:
        """Return the name of the addressed robot; None for a broadcast; an index without a robot unchanged."""
        if to == BROADCAST:
            return None
        return self._robots[to] if 0 <= to < len(self._robots) else to

    def flush(self) -> None:
        """Write all buffered rows."""
        for table in self._tables:
            table.flush()

    @property
    def fault(self) -> OSError | None:
        """The error for which the last flush lost rows, or None."""
        return next((table.fault for table in self._tables if table.fault), None)

    def counts(self) -> dict[str, int]:
        """Return the numbers of lost rows and files, by name, without zeros."""
        losses = {"log_rows_lost": sum(table.lost_rows for table in self._tables), "log_files_lost": self._lost_files}
        return {name: count for name, count in losses.items() if count}

    def end(self, summary: Mapping[str, Any]) -> None:
        """Write `summary.json`, and close."""
        for table in self._tables:
            table.close()
        self._write("summary.json", summary)

    def _write(self, name: str, facts: Mapping[str, Any]) -> None:
        try:
            write_text(self.folder / name, json.dumps(facts, indent=2) + "\n")
        except OSError:
            self._lost_files += 1


def seconds(time_ns: int) -> str:
    """Format a time in ns as seconds with all digits, more than a float has.

    >>> seconds(1_795_300_000_123_456_789), seconds(-5)
    ('1795300000.123456789', '-0.000000005')
    """
    full_s, fraction_ns = divmod(abs(time_ns), NS_PER_S)
    return f"{'-' if time_ns < 0 else ''}{full_s}.{fraction_ns:09d}"


def new_log(parent: Path, robots: tuple[str, ...], robot: str, stamp: str, where: str) -> RobotLog:
    """Create a log in a new folder `{robot}-{stamp}` in `parent`; BadInput at `log` in `where` if that fails."""
    try:
        parent.mkdir(parents=True, exist_ok=True)
        return RobotLog(_new_folder(parent, f"{robot}-{stamp}"), robots, robot)
    except OSError as error:
        raise BadInput(where, "log", f"expected a folder to write to: {parent}: {error.strerror}") from None


def _new_folder(parent: Path, name: str) -> Path:
    """Create a folder under an unused name, so that no start overwrites the log of another."""
    attempt = 1
    while True:
        folder = parent / (name if attempt == 1 else f"{name}-{attempt}")
        try:
            folder.mkdir()
        except FileExistsError:
            attempt += 1
        else:
            return folder
