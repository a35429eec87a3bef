"""What the agent of a robot tells whoever started it: a line at the start, now and then how it is, and a summary."""

import os
import sys
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, TextIO


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
