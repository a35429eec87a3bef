"""Tells systemd how a service of `Type=notify` is: a datagram to the socket that it names, if there is one."""

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
from swarmwire.agent.on_robot.safety import STOP_REQUESTED, Control
from swarmwire.comms.clock import DatedClock, to_ns, to_s

READY, ALIVE, STOPPING = "READY=1", "WATCHDOG=1", "STOPPING=1"


def notify(state: str) -> None:
    """Send a state such as READY; without systemd nothing happens."""
    address = os.environ.get("NOTIFY_SOCKET")
    if not address:
        return
    with suppress(OSError), socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK) as out:
        out.sendto(state.encode(), f"\0{address[1:]}" if address.startswith("@") else address)


# --- How a robot is, in a file that is always whole: for `swarmwire robots status`, and whoever looks on the robot.


NAME = "status.json"  # in a folder of the robot's own


def status_path(log: str, robot: str) -> Path | None:
    """Where the status of a robot stands: in the folder of its logs, else in the user's folder for what runs."""
    if log:
        return Path(log) / f"{robot}-{NAME}"  # robots may share it
    runtime = os.environ.get("XDG_RUNTIME_DIR")
    return Path(runtime) / "swarmwire" / robot / NAME if runtime else None


class StatusFile:
    """Written anew each time, and put in place of the last one; a disk that is full keeps the last one.

    Attributes:
        lost: how many could not be written so far.
    """

    def __init__(self, path: Path | None) -> None:
        self._path = path
        self.lost = 0

    def write(self, status: Mapping[str, Any]) -> None:
        """Put a status, of plain values, in place of the last one."""
        if self._path is None:
            return
        written = self._path.with_name(f".{self._path.name}.{os.getpid()}")
        try:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            written.write_text(json.dumps(status) + "\n", encoding="utf-8")
            written.replace(self._path)
        except OSError:
            self.lost += 1


# --- What the agent of a robot tells whoever started it: a line at the start, now and then how it is, and a summary.


class Terminal:
    """Lines for people; how the robot is meanwhile only where somebody can watch.

    Nobody may be there to read them any more: that stops no robot.
    """

    def __init__(self, robot: str) -> None:
        self._robot = robot
        self._watched = sys.stdout.isatty()

    def say(self, line: str) -> None:
        """Something that the user should know, on standard error."""
        _write(sys.stderr, f"{self._robot}: {line}\n")

    def begin(self, what: str) -> None:
        """What runs."""
        self._line(what)

    def show(self, status: Mapping[str, Any]) -> None:
        """How the robot is, if somebody watches."""
        if self._watched:
            self._line(short(status))

    def end(self, summary: Mapping[str, Any], cause: str | None = None) -> None:
        """What it came to; with a cause, if only an empty one, it failed."""
        counts = ", ".join(f"{name} {count}" for name, count in summary["counts"].items())
        faults = counts or ("no faults" if cause is None else "")
        ended = f"ended ({summary['ended']}{f': {cause}' if cause else ''})"
        if "emergency_stop_at" in summary:
            ended += f", stopped by an emergency stop at step {summary['emergency_stop_at']},"
        late = f", {summary['late_ticks']} late" if summary["late_ticks"] else ""
        stops = f", {summary['watchdog_stops']} watchdog stops" if summary["watchdog_stops"] else ""
        self._line(f"{ended} after {summary['ticks']} steps{late}{stops}{faults and f'; {faults}'}")

    def _line(self, line: str) -> None:
        _write(sys.stdout, f"{self._robot}: {line}\n")


def _write(out: TextIO, line: str) -> None:
    try:
        out.write(line)
        out.flush()
    except (OSError, ValueError):  # a pipe that nobody reads, a full disk; a file that was closed
        with suppress(OSError, ValueError), Path(os.devnull).open("wb") as nowhere:
            os.dup2(nowhere.fileno(), out.fileno())  # also what waits, which Python would write at its end


def short(status: Mapping[str, Any]) -> str:
    """A status in a line.

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


# --- Those who look on while an agent runs on a robot: log, status file, terminal and systemd. None can stop it.


NOT_YET: Mapping[str, Any] = {
    "state": "starting",
    "tick": -1,
    "late_ticks": 0,
    "watchdog_stops": 0,
    "charge": None,
    "agent_state": "",
    "counts": {},
}
CLOCK_SET = "the clock was set by {:+.3f} s: times in the log before and after do not compare"
SET_NS = to_ns(0.05)  # a clock that is only kept in step is moved by less in a second
EMERGENCY = "emergency stop at step {}: motors off for good; end the agent, and start it anew, to go on"
SILENT = "watchdog: nothing was received of the agent for {:.2f} s; motors off until it goes on"
LOG_FULL = "the log cannot be written, and goes on without what is lost: {}"


class RobotObservers:
    """Told of each step; once a second they write, every five the terminal shows how the robot is.

    Attributes:
        steps: how many there were.
        look: called once a second: whoever looks on with them.
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
        """`facts` stand in each status: who and where the robot is."""
        self._clock, self._terminal, self._file, self._control = clock, terminal, status_file, control
        self._facts, self._log = facts, log
        self._status: Callable[[], Mapping[str, Any]] = lambda: NOT_YET
        self._each_second = _Every(clock, to_ns(pace))
        self._each_show = _Every(clock, to_ns(5.0 * pace))
        self._told_of_log = False
        self._ahead_ns = self._date_ahead_ns()
        self._clock_set = 0
        self._stopped_at: int | None = None
        control.at_stop = self._stopped
        self.steps = 0
        self.look: Callable[[], None] = lambda: None

    def attach(self, status: Callable[[], Mapping[str, Any]]) -> None:
        """Whom to ask how the robot is, from now on."""
        self._status = status
        self._report()

    def step(self, row: TickRow) -> None:
        """A step is done."""
        self.steps += 1
        if self._log is not None:
            self._log.tick(row)
        self.wait()

    def wait(self) -> None:
        """No step is due."""
        if self._each_second.due():
            self._flush()
            self._notice_clock()
            self.look()
            self._report()
            notify(ALIVE)
        if self._each_show.due():
            self._terminal.show(self._status())

    def say(self, line: str) -> None:
        """Something that the user should know."""
        self._terminal.say(line)

    def silent(self, silent_s: float) -> None:
        """The watchdog has stopped the motors, since nothing was received of the loop for so long."""
        self._call(SILENT.format(silent_s))

    def _stopped(self) -> None:
        self._stopped_at = self.steps
        self._call(EMERGENCY.format(self.steps))

    def _call(self, line: str) -> None:
        """Say it from a thread that whoever looks after the motors does not wait for: a terminal may take nothing."""
        threading.Thread(target=self.say, args=(line,), daemon=True).start()

    def end(self, ended: str, cause: str | None = None) -> None:
        """The last words: the summary, in the log, too; with a cause, it failed."""
        status = self._status()
        summary: dict[str, Any] = {
            "ended": ended,
            "ticks": self.steps,
            "late_ticks": status["late_ticks"],
            "watchdog_stops": status["watchdog_stops"],
            "counts": self._counts(status),
        }
        if self._stopped_at is not None:
            summary["emergency_stop_at"] = self._stopped_at
        if self._log is not None:
            self._log.end(summary)
        self._report(ended)
        self._terminal.end(summary, cause)

    def _flush(self) -> None:
        if self._log is None:
            return
        self._log.flush()
        if self._log.fault and not self._told_of_log:
            self._told_of_log = True
            self.say(LOG_FULL.format(self._log.fault))

    def _date_ahead_ns(self) -> int:
        return self._clock.utc_ns() - self._clock.now_ns()

    def _notice_clock(self) -> None:
        """A robot without a battery for its clock learns the date from the network, some time after it was started."""
        ahead_ns = self._date_ahead_ns()
        moved_ns, self._ahead_ns = ahead_ns - self._ahead_ns, ahead_ns
        if abs(moved_ns) > SET_NS:
            self._clock_set += 1
            self.say(CLOCK_SET.format(to_s(moved_ns)))

    def _report(self, ended: str | None = None) -> None:
        status = self._status()
        told = {**self._facts, **status, "utc_ns": self._clock.utc_ns(), "counts": self._counts(status)}
        if self._stopped_at is not None:
            told |= {"state": STOP_REQUESTED, "emergency_stop_at": self._stopped_at}
        if ended is not None:
            told |= {"state": "ended", "ended": ended}
        self._control.tell(told)
        self._file.write(told)

    def _counts(self, status: Mapping[str, Any]) -> dict[str, int]:
        own = self._log.counts() if self._log else {}
        if self._clock_set:
            own["clock_set"] = self._clock_set
        if self._file.lost:
            own["status_lost"] = self._file.lost
        return {**status["counts"], **own}


class _Every:
    """Whether a period has gone by since it was the last time."""

    def __init__(self, clock: DatedClock, period_ns: int) -> None:
        self._clock, self._period_ns = clock, period_ns
        self._next_ns = clock.now_ns() + period_ns

    def due(self) -> bool:
        now_ns = self._clock.now_ns()
        if now_ns < self._next_ns:
            return False
        self._next_ns = now_ns + self._period_ns
        return True
