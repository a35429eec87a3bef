"""Emergency stop, watchdog and stop signals of one robot: every path on which its motors are switched off.

An emergency stop latches. `Control.estop` sets the latch and then stops the motors; from then on `Motors.act` drops
every command and the loop no longer steps the agent. Only a new process can drive the robot again. Requests come

- over the robots' network: `radios/control.py` calls `Control.estop` in a separate thread, which an agent that hangs
  cannot delay;
- from another process of this machine (`swarmwire-agent stop-motors`): it finds the process that holds the robot's
  lock, sends it a signal and reads the confirmation from the lock (`robot_lock.py`).

A request at a robot that is out of reach raises DriverLost, so that the operator knows that it may still move. The
latch stays set, and the loop stops the motors as soon as the robot answers again (`reconnect` in `loop.py`).

Three mechanisms stop the motors without a request:

- `Watchdog`: the loop is late. The motors stay off until the loop continues.
- `Heartbeats`: the process died or froze. The guard (`guard.py`, a separate process) misses the heartbeats, kills the
  process and has the motors stopped over another connection. A heartbeat also carries the latch, so that the guard's
  exit code does not make a service manager restart an agent after an emergency stop.
- `StopFlag`: a signal arrived or the guard is gone. The loop ends after the current step, and `assembly.py` closes
  the robot, motors first.
"""

import os
import signal
import threading
from collections.abc import Callable, Generator, Mapping
from contextlib import contextmanager
from types import FrameType
from typing import Any

from swarmwire.agent.drivers.driver import Command, Driver, DriverLost
from swarmwire.agent.on_robot.guard import RUNS, STOPPED
from swarmwire.agent.on_robot.states import STOP_REQUESTED
from swarmwire.comms.base.clock import Clock, to_ns, to_s

OUT_OF_REACH = "the robot is out of reach and may keep executing its last command"
SIGNALS = signal.SIGINT, signal.SIGTERM, signal.SIGHUP
CHECKS_PER_TIMEOUT = 5  # checks of the watchdog
MIN_CHECK_INTERVAL_S = 0.01  # wall time, for robots that are emulated far faster than the wall clock


class Control:
    """The latching emergency stop and the robot's status; both may be called from any thread.

    Attributes:
        at_stop: called at the first emergency stop, after the motors were asked to stop.
    """

    def __init__(self, stop: Callable[[], None]) -> None:
        """Keep `stop`, which switches the motors off from any thread; DriverLost if the robot is out of reach."""
        self._stop = stop
        self._latched = threading.Event()
        self._status: Mapping[str, Any] = {}
        self._first_lock = threading.Lock()
        self.at_stop: Callable[[], None] = lambda: None

    @property
    def stopped(self) -> bool:
        """True once the emergency stop is latched."""
        return self._latched.is_set()

    def estop(self) -> None:
        """Switch the motors off permanently: at once, or after DriverLost as soon as the robot answers again."""
        with self._first_lock:
            is_first = not self._latched.is_set()
            self._latched.set()
        try:
            self._stop()
        finally:
            if is_first:
                self.at_stop()

    def status(self) -> Mapping[str, Any]:
        """Return the newest status, in plain values. The loop sets it, so it is old while an agent hangs."""
        return {**self._status, "state": STOP_REQUESTED} if self.stopped else self._status

    def set_status(self, status: Mapping[str, Any]) -> None:
        """Replace the status."""
        self._status = status


class Motors:
    """Passes commands to the driver until the emergency stop is latched; `stop` may be called from any thread.

    Attributes:
        control: the emergency stop of these motors.
        reachable: True if the robot answered the last call, or its motors are off permanently; set by the loop.
    """

    def __init__(self, driver: Driver) -> None:
        self._driver = driver
        self.control = Control(self._stop_or_raise)
        self.reachable = True

    def act(self, command: Command) -> None:
        """Pass a command to the robot; DriverLost if that fails. Do nothing after an emergency stop."""
        if self.control.stopped:
            return
        self._driver.act(command)
        if self.control.stopped:  # the stop came during the call, and the command may have overtaken it
            self._driver.emergency_stop()

    def stop(self) -> None:
        """Switch the motors off at once. The loop stops a robot that is out of reach as soon as it answers again."""
        try:
            self._driver.stop()
        except DriverLost:
            return

    def _stop_or_raise(self) -> None:
        """Switch the motors off at once; DriverLost if the robot is out of reach, since it may still move."""
        self._driver.emergency_stop()
        if not self.reachable:
            raise DriverLost(OUT_OF_REACH)


class Watchdog:
    """A thread that stops the motors, once per lapse, if `feed` is not called in time; suspended until the first call.

    Each check also calls `beat`, by which the guard knows that this process runs.

    Attributes:
        stops: stops of the motors so far.
    """

    def __init__(
        self,
        timeout_s: float,
        stop: Callable[[], None],
        clock: Clock,
        pace: float = 1.0,
        beat: Callable[[], None] = lambda: None,
        report: Callable[[float], None] = lambda _: None,
    ) -> None:
        """Keep the callbacks; after each stop, `report` gets the seconds since the last `feed`."""
        self._timeout_ns, self._stop, self._clock = to_ns(timeout_s), stop, clock
        self._check_interval_s = max(timeout_s / CHECKS_PER_TIMEOUT / pace, MIN_CHECK_INTERVAL_S)  # wall time
        self._beat, self._report = beat, report
        self._fed_ns: int | None = None  # None: suspended
        self._lapsed_ns: int | None = None  # `_fed_ns` of the lapse that was handled last
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name="watchdog", daemon=True)
        self.stops = 0

    def start(self) -> None:
        """Send the first heartbeat, and start the thread: from now on motors may move."""
        self._beat()
        self._thread.start()

    def feed(self) -> None:
        """Restart the timeout; called by the running loop."""
        self._fed_ns = self._clock.now_ns()

    def suspend(self) -> None:
        """Suspend the timeout until the next `feed`: the motors are at rest, or out of reach."""
        self._fed_ns = None

    def check(self) -> None:
        """Stop the motors if the timeout has passed."""
        fed_ns = self._fed_ns
        if fed_ns is None or fed_ns == self._lapsed_ns:
            return
        silent_ns = self._clock.now_ns() - fed_ns
        if silent_ns < self._timeout_ns:
            return
        self._lapsed_ns = fed_ns
        self._stop()
        self.stops += 1
        self._report(to_s(silent_ns))

    def end(self) -> None:
        """Stop the thread; safe to call more than once, and before `start`."""
        self._ended.set()
        if self._thread.is_alive():
            self._thread.join()

    def _run(self) -> None:
        while not self._ended.wait(self._check_interval_s):
            self.check()
            self._beat()


class Heartbeats:
    """Sends the guard one byte per call: the process runs, without or with a latched emergency stop.

    Without a pipe, that is without a guard, a call does nothing.
    """

    def __init__(self, pipe: int | None, stopped: Callable[[], bool], orphaned: Callable[[], None]) -> None:
        """Keep the callbacks: `stopped` returns True if the stop is latched, `orphaned` is called without a guard."""
        self._pipe, self._stopped, self._orphaned = pipe, stopped, orphaned

    def __call__(self) -> None:
        """Send a heartbeat."""
        if self._pipe is None:
            return
        try:
            os.write(self._pipe, STOPPED if self._stopped() else RUNS)
        except BlockingIOError:  # the guard is frozen, and has enough heartbeats to read when it continues
            return
        except OSError:
            self._orphaned()


class StopFlag:
    """The reason why the loop must end, None until then; requested from any thread, once."""

    def __init__(self) -> None:
        self.reason: str | None = None

    def request(self, reason: str) -> None:
        """End after the current step; the first reason stays."""
        self.reason = self.reason or reason

    def __bool__(self) -> bool:
        return self.reason is not None


@contextmanager
def by_signals(end: StopFlag, patient: bool) -> Generator[None]:
    """Set the stop flag at each termination signal within this context.

    Unless `patient`, a second Ctrl-C interrupts as in any program. With a guard, which kills a process that does not
    end in time, a signal may come twice: from the guard, and from a sender that signals all processes, such as systemd.
    """
    before = {number: signal.getsignal(number) for number in SIGNALS}

    def handle(number: int, _: FrameType | None) -> None:
        end.request(signal.Signals(number).name)
        if not patient:
            signal.signal(signal.SIGINT, before[signal.SIGINT])

    for number in SIGNALS:
        signal.signal(number, handle)
    try:
        yield
    finally:
        for number, previous in before.items():
            signal.signal(number, previous)
