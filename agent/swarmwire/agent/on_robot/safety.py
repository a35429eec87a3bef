"""The motors of a robot, behind the emergency stop and the loss of the driver."""

import os
import signal
import threading
from collections.abc import Callable, Generator, Mapping
from contextlib import contextmanager
from types import FrameType
from typing import Any

from swarmwire.agent.drivers.driver import Command, Driver, DriverLost
from swarmwire.agent.on_robot.guard import RUNS, STOPPED
from swarmwire.comms.clock import Clock, to_ns, to_s

OUT_OF_REACH = "the robot is out of reach, and may go on as it was told last"


class Motors:
    """Hands commands to the driver unless the emergency stop is latched; `stop` may be called from any thread.

    Attributes:
        reachable: whether the robot answered when it was last asked for something; the loop knows.
    """

    def __init__(self, driver: Driver) -> None:
        self._driver = driver
        self.control = Control(self._stop_or_tell)
        self.reachable = True

    def act(self, command: Command) -> None:
        """Hand a command to the robot; DriverLost if it cannot be. Nothing moves after an emergency stop."""
        if self.control.stopped:
            return
        self._driver.act(command)
        if self.control.stopped:  # it came while the command was on its way, and may have been overtaken
            self._driver.stop()

    def stop(self) -> None:
        """Motors off at once. A robot that cannot be reached is stopped first of all when it can be."""
        try:
            self._driver.stop()
        except DriverLost:
            return

    def _stop_or_tell(self) -> None:
        """Motors off at once; DriverLost if the robot cannot be reached, so that nobody believes that it stands."""
        self._driver.stop()
        if not self.reachable:
            raise DriverLost(OUT_OF_REACH)


# --- The watchdog of an agent on a robot: motors off when the loop has not fed it for too long.


LOOKS = 5  # in the time that it allows
MIN_LOOK_S = 0.01  # also of a robot that is emulated far faster than the wall clock


class Watchdog:
    """A thread of its own that stops the motors, once in a lapse; it rests until it is fed.

    Each time it looks it calls `beat`, so that the guard outside knows that this process runs.

    Attributes:
        stops: how often it stopped the motors so far.
    """

    def __init__(
        self,
        after_s: float,
        stop: Callable[[], None],
        clock: Clock,
        pace: float = 1.0,
        beat: Callable[[], None] = lambda: None,
        tell: Callable[[float], None] = lambda _: None,
    ) -> None:
        """`tell` is told for how many seconds nothing was received of the loop, once the motors were stopped for it."""
        self._after_ns, self._stop, self._clock = to_ns(after_s), stop, clock
        self._look_s = max(after_s / LOOKS / pace, MIN_LOOK_S)  # of wall time
        self._beat, self._tell = beat, tell
        self._fed_ns: int | None = None  # None: it rests
        self._lapsed_ns: int | None = None  # when it was fed last before it stopped the motors
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name="watchdog", daemon=True)
        self.stops = 0

    def start(self) -> None:
        """Begin to look, and beat at once: from now on motors may move."""
        self._beat()
        self._thread.start()

    def feed(self) -> None:
        """The loop is there: from now on it has its time again."""
        self._fed_ns = self._clock.now_ns()

    def rest(self) -> None:
        """Nothing is expected until it is fed again: the motors are at rest, or cannot be reached."""
        self._fed_ns = None

    def look(self) -> None:
        """Stop the motors if the loop has not been received of for too long."""
        fed_ns = self._fed_ns
        if fed_ns is None or fed_ns == self._lapsed_ns or (silent_ns := self._clock.now_ns() - fed_ns) < self._after_ns:
            return
        self._lapsed_ns = fed_ns
        self._stop()
        self.stops += 1
        self._tell(to_s(silent_ns))

    def end(self) -> None:
        """Look no more; safe to call more than once, and before `start`."""
        self._ended.set()
        if self._thread.is_alive():
            self._thread.join()

    def _run(self) -> None:
        while not self._ended.wait(self._look_s):
            self.look()
            self._beat()


# --- What whoever runs the swarm may ask of a robot while its agent runs: an emergency stop, and how it is.


STOP_REQUESTED = "estop"  # the state of a robot whose agent goes on no more


class Control:
    """The emergency stop, which latches, and the robot's status; both may be asked from any thread.

    An agent that was stopped so is not stepped any more: only a new process goes on.

    Attributes:
        at_stop: called at the first emergency stop, as soon as the motors were asked to stop.
    """

    def __init__(self, stop: Callable[[], None]) -> None:
        """`stop` takes the motors off at once, from any thread; DriverLost if the robot cannot be reached."""
        self._stop = stop
        self._latched = threading.Event()
        self._status: Mapping[str, Any] = {}
        self._first = threading.Lock()
        self.at_stop: Callable[[], None] = lambda: None

    @property
    def stopped(self) -> bool:
        """Whether the emergency stop is latched."""
        return self._latched.is_set()

    def estop(self) -> None:
        """Motors off, for good: at once, or, if DriverLost is raised, as soon as the robot can be reached."""
        with self._first:
            first = not self._latched.is_set()
            self._latched.set()
        try:
            self._stop()
        finally:
            if first:
                self.at_stop()

    def status(self) -> Mapping[str, Any]:
        """The newest status, of plain values, as the loop told it, which an agent that hangs holds up."""
        return {**self._status, "state": STOP_REQUESTED} if self.stopped else self._status

    def tell(self, status: Mapping[str, Any]) -> None:
        """Put a new status in place of the last one."""
        self._status = status


# --- What ends the agent of a robot from outside its loop: a signal, or the loss of the guard.


SIGNALS = signal.SIGINT, signal.SIGTERM, signal.SIGHUP


class StopFlag:
    """Whether the loop is to end, and why; set from any thread, once."""

    def __init__(self) -> None:
        self.reason: str | None = None

    def ask(self, reason: str) -> None:
        """End after the step that goes on; the first reason stays."""
        self.reason = self.reason or reason

    def __bool__(self) -> bool:
        return self.reason is not None


@contextmanager
def by_signals(end: StopFlag, patient: bool) -> Generator[None]:
    """While it holds, signals ask for the end.

    Unless it is `patient`, a second Ctrl-C does what it does to any program. With a guard, which ends what does not
    end in time, signals may come twice: from the guard, and from whoever sends them to all processes, as systemd does.
    """
    before = {number: signal.getsignal(number) for number in SIGNALS}

    def ask(number: int, _: FrameType | None) -> None:
        end.ask(signal.Signals(number).name)
        if not patient:
            signal.signal(signal.SIGINT, before[signal.SIGINT])

    for number in SIGNALS:
        signal.signal(number, ask)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


# --- What an agent's process tells its guard through a pipe: that it runs, and whether it was stopped for good.


class Heartbeats:
    """A byte at each call; without a pipe there is no guard, and nothing happens."""

    def __init__(self, pipe: int | None, stopped: Callable[[], bool], orphaned: Callable[[], None]) -> None:
        """`stopped` tells of an emergency stop; `orphaned` is called when nobody reads the pipe any more."""
        self._pipe, self._stopped, self._orphaned = pipe, stopped, orphaned

    def __call__(self) -> None:
        """Tell the guard."""
        if self._pipe is None:
            return
        try:
            os.write(self._pipe, STOPPED if self._stopped() else RUNS)
        except BlockingIOError:  # the guard is frozen, and has enough to read when it wakes
            return
        except OSError:
            self._orphaned()
