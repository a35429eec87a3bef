"""Reports of one robot: state notifications for systemd, a status file, lines for the terminal, and their schedule.

`RobotObservers` is the loop's observer: it writes the log at each step, log file and status once a second, and the
terminal every five seconds. No fault of an output stops the robot: a full disk or a closed terminal is counted or
ignored.
"""

import json
import os
import socket
import sys
import threading
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, TextIO

from swarmwire.agent.on_robot.log import RobotLog, TickRow
from swarmwire.agent.on_robot.safety import Control
from swarmwire.agent.on_robot.states import STOP_REQUESTED
from swarmwire.comms.base.atomic import write_text
from swarmwire.comms.base.clock import DatedClock, to_ns, to_s
from swarmwire.comms.base.printable import LINES, printable

READY, ALIVE, STOPPING = "READY=1", "WATCHDOG=1", "STOPPING=1"  # states of a systemd service of `Type=notify`
STATUS_FILE = "status.json"
NOT_STARTED: Mapping[str, Any] = {
    "state": "starting",
    "tick": -1,
    "late_ticks": 0,
    "watchdog_stops": 0,
    "charge": None,
    "agent_state": "",
    "counts": {},
}
CLOCK_SET = "the clock was set by {:+.3f} s: times in the log before and after do not compare"
CLOCK_SET_NS = to_ns(0.05)  # change between two checks above which the clock was set, not only synchronised
EMERGENCY = "emergency stop at step {}: motors stay off; stop the agent and start it again to continue"
SILENT = "watchdog: no heartbeat of the agent for {:.2f} s; motors off until the next one"
LOG_FULL = "the log cannot be written; the agent runs on without lost rows: {}"
STATUS_INTERVAL_S, TERMINAL_INTERVAL_S = 1.0, 5.0  # s of the robot's time


def notify(state: str) -> None:
    """Send systemd a state such as READY in a datagram to `NOTIFY_SOCKET`; do nothing without systemd."""
    address = os.environ.get("NOTIFY_SOCKET")
    if not address:
        return
    with suppress(OSError), socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK) as out:
        out.sendto(state.encode(), f"\0{address[1:]}" if address.startswith("@") else address)


def status_path(log: str, robot: str) -> Path | None:
    """Return the path of the status file: in the log folder, else in the user's runtime folder, else None."""
    if log:
        return Path(log) / f"{robot}-{STATUS_FILE}"  # robots may share a log folder
    runtime = os.environ.get("XDG_RUNTIME_DIR")
    return Path(runtime) / "swarmwire" / robot / STATUS_FILE if runtime else None


class StatusFile:
    """The status of a robot as JSON, replaced atomically, for `swarmwire robots status`; a full disk leaves the old.

    Attributes:
        lost: statuses that could not be written so far.
    """

    def __init__(self, path: Path | None) -> None:
        self._path = path
        self.lost = 0

    def write(self, status: Mapping[str, Any]) -> None:
        """Replace the status by another, of plain values."""
        if self._path is None:
            return
        try:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            write_text(self._path, json.dumps(status) + "\n")
        except OSError:
            self.lost += 1


class Terminal:
    """Prints the start, messages, the status every few seconds on a terminal, and a summary.

    A closed terminal or pipe does not stop the robot.
    """

    def __init__(self, robot: str) -> None:
        self._robot = robot
        self._is_terminal = sys.stdout.isatty()

    def report(self, line: str) -> None:
        """Print a message for the user, on standard error."""
        _write(sys.stderr, f"{self._robot}: {printable(line, keep=LINES)}\n")

    def begin(self, configuration: str) -> None:
        """Print the configuration of the robot."""
        self._line(configuration)

    def show(self, status: Mapping[str, Any]) -> None:
        """Print the status, if standard output is a terminal."""
        if self._is_terminal:
            self._line(short(status))

    def end(self, summary: Mapping[str, Any], cause: str | None = None) -> None:
        """Print the summary; any cause, even an empty one, means that the run failed."""
        counts = ", ".join(f"{name} {count}" for name, count in summary["counts"].items())
        faults = counts or ("no faults" if cause is None else "")
        ended = f"ended ({summary['ended']}{f': {cause}' if cause else ''})"
        if "emergency_stop_at" in summary:
            ended += f", stopped by an emergency stop at step {summary['emergency_stop_at']},"
        late = f", {summary['late_ticks']} late" if summary["late_ticks"] else ""
        stops = f", {summary['watchdog_stops']} watchdog stops" if summary["watchdog_stops"] else ""
        self._line(f"{ended} after {summary['ticks']} steps{late}{stops}{faults and f'; {faults}'}")

    def _line(self, line: str) -> None:
        _write(sys.stdout, f"{self._robot}: {printable(line, keep=LINES)}\n")


def _write(out: TextIO, line: str) -> None:
    try:
        out.write(line)
        out.flush()
    except (OSError, ValueError):  # OSError: no reader, or a full disk; ValueError: a closed file
        with suppress(OSError, ValueError), Path(os.devnull).open("wb") as devnull:
            os.dup2(devnull.fileno(), out.fileno())  # Python writes buffered text at exit, which must not fail


def short(status: Mapping[str, Any]) -> str:
    """Format a status as one line.

    >>> short({"state": "running", "tick": 600, "charge": 0.5, "late_ticks": 2, "agent_state": ""})
    'running, tick 600, 2 late, battery 50 %'
    """
    words = [status["state"], f"tick {status['tick']}"]
    if status["agent_state"]:
        words.append(status["agent_state"])
    if status["late_ticks"]:
        words.append(f"{status['late_ticks']} late")
    if status["charge"] is not None:
        words.append(f"battery {status['charge']:.0%}".replace("%", " %"))
    return ", ".join(words)


class RobotObservers:
    """Log, status file, terminal and systemd; the intervals are in the robot's time.

    Attributes:
        steps: steps so far.
        check_network: called once a second.
    """

    def __init__(
        self,
        clock: DatedClock,
        pace: float,
        terminal: Terminal,
        status_file: StatusFile,
        control: Control,
        facts: Mapping[str, Any],
        log: RobotLog | None,
    ) -> None:
        """Keep the outputs; `facts` are part of each status: name, swarm and log folder of the robot."""
        self._clock, self._terminal, self._file, self._control = clock, terminal, status_file, control
        self._facts, self._log = facts, log
        self._status: Callable[[], Mapping[str, Any]] = lambda: NOT_STARTED
        self._status_interval = _Interval(clock, to_ns(STATUS_INTERVAL_S * pace))
        self._terminal_interval = _Interval(clock, to_ns(TERMINAL_INTERVAL_S * pace))
        self._is_log_reported = False
        self._offset_ns = self._utc_offset_ns()
        self._clock_changes = 0
        self._stop_step: int | None = None
        control.at_stop = self._on_stop
        self.steps = 0
        self.check_network: Callable[[], None] = lambda: None
        self._publish_status()  # an operator may ask while driver and network are opened

    def attach(self, status: Callable[[], Mapping[str, Any]]) -> None:
        """Read the status from this function from now on."""
        self._status = status
        self._publish_status()

    def step(self, row: TickRow) -> None:
        """Log a completed step."""
        self.steps += 1
        if self._log is not None:
            self._log.tick(row)
        self.wait()

    def wait(self) -> None:
        """Do the periodic work that is due."""
        if self._status_interval.due():
            self._flush()
            self._check_clock()
            self.check_network()
            self._publish_status()
            notify(ALIVE)
        if self._terminal_interval.due():
            self._terminal.show(self._status())

    def report(self, line: str) -> None:
        """Print a message for the user."""
        self._terminal.report(line)

    def report_silence(self, silent_s: float) -> None:
        """Report that the watchdog stopped the motors, since the loop has not fed it for this long."""
        self._report_in_thread(SILENT.format(silent_s))

    def _on_stop(self) -> None:
        self._stop_step = self.steps
        self._report_in_thread(EMERGENCY.format(self.steps))

    def _report_in_thread(self, line: str) -> None:
        """Print from another thread: a terminal that blocks must not delay the threads that stop the motors."""
        threading.Thread(target=self.report, args=(line,), daemon=True).start()

    def end(self, ended: str, cause: str | None = None) -> None:
        """Write the summary to log and terminal; any cause means that the run failed."""
        status = self._status()
        summary: dict[str, Any] = {
            "ended": ended,
            "ticks": self.steps,
            "late_ticks": status["late_ticks"],
            "watchdog_stops": status["watchdog_stops"],
            "counts": self._counts(status),
        }
        if self._stop_step is not None:
            summary["emergency_stop_at"] = self._stop_step
        if self._log is not None:
            self._log.end(summary)
        self._publish_status(ended)
        self._terminal.end(summary, cause)

    def _flush(self) -> None:
        if self._log is None:
            return
        self._log.flush()
        if self._log.fault and not self._is_log_reported:
            self._is_log_reported = True
            self.report(LOG_FULL.format(self._log.fault))

    def _utc_offset_ns(self) -> int:
        return self._clock.utc_ns() - self._clock.now_ns()

    def _check_clock(self) -> None:
        """Report a change of the date: a robot without a clock battery gets it from the network after its start."""
        offset_ns = self._utc_offset_ns()
        change_ns, self._offset_ns = offset_ns - self._offset_ns, offset_ns
        if abs(change_ns) > CLOCK_SET_NS:
            self._clock_changes += 1
            self.report(CLOCK_SET.format(to_s(change_ns)))

    def _publish_status(self, ended: str | None = None) -> None:
        status = self._status()
        published = {**self._facts, **status, "utc_ns": self._clock.utc_ns(), "counts": self._counts(status)}
        if self._stop_step is not None:
            published |= {"state": STOP_REQUESTED, "emergency_stop_at": self._stop_step}
        if ended is not None:
            published |= {"state": "ended", "ended": ended}
        self._control.set_status(published)
        self._file.write(published)

    def _counts(self, status: Mapping[str, Any]) -> dict[str, int]:
        counts = {**status["counts"], **(self._log.counts() if self._log else {})}
        if self._clock_changes:
            counts["clock_set"] = self._clock_changes
        if self._file.lost:
            counts["status_lost"] = self._file.lost
        return counts


class _Interval:
    """A period; `due` is true if it has passed since `due` was last true."""

    def __init__(self, clock: DatedClock, period_ns: int) -> None:
        self._clock, self._period_ns = clock, period_ns
        self._next_ns = clock.now_ns() + period_ns

    def due(self) -> bool:
        now_ns = self._clock.now_ns()
        if now_ns < self._next_ns:
            return False
        self._next_ns = now_ns + self._period_ns
        return True
