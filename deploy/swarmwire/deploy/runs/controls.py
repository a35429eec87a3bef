"""Controls of a live run: pause, step, speed and end; and the signals that end it.

The trajectory of the run stays the same.
"""

import signal
import threading
from collections.abc import Callable
from types import FrameType, TracebackType

from swarmwire.comms.base.clock import Clock, tick_start_ns, to_ns, to_s
from swarmwire.comms.base.errors import BadInput
from swarmwire.world.backends.pacing import Pace

SPEEDS = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1000.0)  # simulated s per s of wall time
SLOWEST, FASTEST = 0.001, 1e6  # that may be asked for
LOOK_NS = to_ns(0.02)  # how often a loop that is held looks up what people ask


class Controls:
    """Any thread may ask; the loop calls `hold` before each tick, which costs nothing without a request.

    Attributes:
        paused: no tick begins but those that `step` asks for.
        speed: simulated s per s of wall time: in real time the pace's factor, else a limit; None as fast as possible.
        quit_requested: the run is to end before the next tick.
        help_requested: people want to know what the keys do.
        paused_ns: wall time spent in pauses so far.
        on_wait: called while the loop is held, many times a second.
        on_pause: the same, while it is held by a pause; it must not raise.
    """

    def __init__(self, clock: Clock, rate_hz: int, pace: Pace | None = None, *, speed_fixed: bool = False) -> None:
        """With a `pace` the run is in real time; a fixed speed stays, as programs elsewhere keep to it."""
        self._speed_fixed = speed_fixed
        self._clock, self._rate_hz, self._pace = clock, rate_hz, pace
        self._lock = threading.Lock()
        self.paused = self.quit_requested = self.help_requested = False
        self.speed = pace.factor if pace else None
        self.paused_ns = 0
        self.on_wait: Callable[[], None] = lambda: None
        self.on_pause: Callable[[], None] = lambda: None
        self._held = True  # whether no tick is under way: before the first, or while the loop waits for a pause's end
        self._has_requests = False  # whether `hold` has anything to do
        self._steps = 0
        self._next_ns = 0  # under a limit no tick begins before
        self._free_speed = SPEEDS[-1]  # of the run without a limit, as far as is known
        self._tick = 0  # the newest to begin
        self._since: tuple[int, int] | None = None  # tick and wall time from which the free speed is measured

    @property
    def real_time(self) -> bool:
        """Whether the wall clock paces the run."""
        return self._pace is not None

    @property
    def stands_still(self) -> bool:
        """Whether the run is paused, the tick that was under way is over, and none is to come."""
        with self._lock:
            return self.paused and self._held and not self._steps

    @property
    def missed_ticks(self) -> int:
        """Ticks that real time did not wait for; 0 in a run that is not in real time."""
        return self._pace.missed_ticks if self._pace else 0

    def toggle_pause(self) -> None:
        """Pause or resume."""
        with self._lock:
            self.paused, self._steps, self._has_requests = not self.paused, 0, True

    def pause(self) -> None:
        """No tick begins from now on; ticks that were asked for and have not begun are not done."""
        with self._lock:
            self.paused, self._steps, self._has_requests = True, 0, True

    def resume(self) -> None:
        """Resume."""
        with self._lock:
            self.paused, self._steps, self._has_requests = False, 0, True

    def step_by(self, ticks: int) -> None:
        """So many ticks more, then pause, whether the run is paused or not; those asked for before come first."""
        with self._lock:
            self._steps += ticks
            self.paused = self._has_requests = True

    def step(self) -> None:
        """One tick, then pause again; a run that is not paused pauses."""
        with self._lock:
            self._steps += self.paused
            self.paused = self._has_requests = True

    def faster(self) -> None:
        """The next speed of `SPEEDS`; beyond what the run did without a limit there is none."""
        with self._lock:
            if self.speed is None:
                return
            above = next((speed for speed in SPEEDS if speed > self.speed), None)
            if self._pace:
                self._set_speed(above or self.speed)
            else:
                self._set_speed(above if above and above < self._free_speed else None)

    def slower(self) -> None:
        """The speed of `SPEEDS` below the present one; without a limit, below that at which the run goes."""
        with self._lock:
            if self.speed is None:
                self._free_speed = self._measured()
            present = self.speed or self._free_speed
            self._set_speed(max((speed for speed in SPEEDS if speed < present), default=min(present, SPEEDS[0])))

    def set_speed(self, speed: float | None) -> None:
        """This speed from the next tick on, None: without a limit; BadInput if the run cannot have it."""
        if self._speed_fixed:
            raise BadInput("", "factor", "expected no other speed: programs elsewhere keep to that of the run")
        if speed is None and self._pace:
            raise BadInput(
                "", "factor", "expected a number: the run keeps to the wall clock, and has no unlimited speed"
            )
        if speed is not None and not SLOWEST <= speed <= FASTEST:
            raise BadInput("", "factor", f"expected {SLOWEST:g} to {FASTEST:g} times real time, got {speed!r}")
        with self._lock:
            self._set_speed(speed)

    def quit(self) -> None:
        """End the run after the tick that is under way."""
        self.quit_requested = True

    def toggle_help(self) -> None:
        """Show what the keys do, or no longer."""
        self.help_requested = not self.help_requested

    def wait(self, tick: int, stopped: Callable[[], bool]) -> None:
        """Return when the tick may begin, or when the run is to end."""
        self._tick = tick
        if self._has_requests or self._since is None:
            self._attend(tick, stopped)

    def _attend(self, tick: int, stopped: Callable[[], bool]) -> None:
        paused_ns = 0
        while not (self.quit_requested or stopped()):
            now_ns = self._clock.now_ns()
            paused, wait_ns = self._wait(now_ns)
            if wait_ns <= 0:
                break
            self.on_wait()
            if paused:
                self.on_pause()
            self._clock.sleep_until(now_ns + min(wait_ns, LOOK_NS))
            paused_ns += (self._clock.now_ns() - now_ns) if paused else 0
        self._begin(tick, paused_ns)

    def _wait(self, now_ns: int) -> tuple[bool, int]:
        """Whether the run is paused, and how long the next tick is to wait, in ns."""
        with self._lock:
            if self.paused:
                self._held = not self._steps
                self._steps -= not self._held
                return self._held, LOOK_NS * self._held
            self._held = False
            return False, 0 if self._pace or self.speed is None else self._next_ns - now_ns

    def _begin(self, tick: int, paused_ns: int) -> None:
        with self._lock:
            now_ns = self._clock.now_ns()
            self.paused_ns += paused_ns
            if self._since is None or paused_ns:
                self._since = tick, now_ns
            self._has_requests = self.paused
            if self._pace:
                if paused_ns or self.speed != self._pace.factor:
                    self._pace.restart(tick, self.speed or self._pace.factor, paused_ns)
            elif self.speed is not None:
                # What one wait was too long may be made up for in the next; more would be a burst beyond the limit.
                period_ns = round(tick_start_ns(1, self._rate_hz) / self.speed)
                self._next_ns = max(self._next_ns, now_ns - period_ns) + period_ns
                self._has_requests = True

    def _measured(self) -> float:
        """Simulated s per s of wall time since the start or the last pause or change of speed."""
        if self._since is None or self._tick <= self._since[0]:
            return self._free_speed
        tick, at_ns = self._since
        wall_s = to_s(self._clock.now_ns() - at_ns)
        return (self._tick - tick) / self._rate_hz / wall_s if wall_s > 0 else self._free_speed

    def _set_speed(self, speed: float | None) -> None:
        if self._speed_fixed:
            return
        self.speed, self._has_requests = speed, True
        self._next_ns = self._clock.now_ns()
        self._since = None  # measured anew from the next tick on


class Interrupt:
    """While entered, SIGINT, SIGTERM and SIGHUP ask for the end of the run after the tick under way.

    A second SIGINT or SIGTERM ends it at once; SIGHUP asks only, since shell and system both may send it. In the main
    thread only. A SIGHUP that is ignored (nohup) stays so.

    Attributes:
        requested: whether one of them came.
        hung_up: whether SIGHUP did: the output has no reader.
    """

    def __init__(self) -> None:
        self.requested = self.hung_up = False
        self._before: dict[signal.Signals, object] = {}

    def __enter__(self) -> "Interrupt":
        if threading.current_thread() is threading.main_thread():
            for number in (signal.SIGINT, signal.SIGTERM):
                self._before[number] = signal.signal(number, self._handle)
            if signal.getsignal(signal.SIGHUP) != signal.SIG_IGN:
                self._before[signal.SIGHUP] = signal.signal(signal.SIGHUP, self._hang_up)
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)  # pyright: ignore[reportArgumentType] - what signal() gave back, it takes

    def _handle(self, number: int, frame: FrameType | None) -> None:
        if self.requested:
            raise KeyboardInterrupt
        self.requested = True

    def _hang_up(self, number: int, frame: FrameType | None) -> None:
        self.requested = self.hung_up = True
