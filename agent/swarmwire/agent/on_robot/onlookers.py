"""Those who look on while an agent runs on a robot: log, status file, terminal and systemd. None can stop it."""

import threading
from collections.abc import Callable, Mapping
from typing import Any

from swarmwire.agent.on_robot import sd_notify
from swarmwire.agent.on_robot.control import STOPPED, Control
from swarmwire.agent.on_robot.robot_log import RobotLog, TickRow
from swarmwire.agent.on_robot.status_file import StatusFile
from swarmwire.agent.on_robot.terminal import Terminal
from swarmwire.comms.clock import DatedClock, to_ns, to_s

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
SILENT = "watchdog: nothing was heard of the agent for {:.2f} s; motors off until it goes on"
LOG_FULL = "the log cannot be written, and goes on without what is lost: {}"


class Onlookers:
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
            sd_notify.notify(sd_notify.ALIVE)
        if self._each_show.due():
            self._terminal.show(self._status())

    def say(self, line: str) -> None:
        """Something that the user should know."""
        self._terminal.say(line)

    def silent(self, silent_s: float) -> None:
        """The watchdog has stopped the motors, since nothing was heard of the loop for so long."""
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
            told |= {"state": STOPPED, "emergency_stop_at": self._stopped_at}
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
