"""Controls of a live run: pause, step, speed and end; and the signals that end it.

They change when ticks begin, never the trajectory.
"""

import signal
import threading
from collections.abc import Callable
from types import FrameType, TracebackType

from swarmwire.comms.base.clock import Clock, tick_start_ns, to_ns
from swarmwire.comms.base.errors import BadInput
from swarmwire.world.backends.pacing import Pace

MIN_SPEED, MAX_SPEED = 0.001, 1e6
POLL_NS = to_ns(0.02)  # interval at which a waiting loop reads the requests


class Controls:
    """Pauses, steps, slows down and ends a run at the request of any thread.

    The loop calls `wait` before each tick, which costs nothing without a request.

    Attributes:
        paused: True: only the ticks of `step_by` begin.
        speed: simulated s per s of wall time: the pace's factor in real time, else a limit; None: as fast as possible.
        quit_requested: True if the run must end before the next tick.
        paused_ns: wall time spent in pauses so far.
        on_wait: called many times a second while the loop waits.
        on_pause: called many times a second during a pause; it must not raise.
    """

    def __init__(self, clock: Clock, rate_hz: int, pace: Pace | None = None, *, speed_fixed: bool = False) -> None:
        """Control a run, in real time if it has a `pace`; the speed is fixed if programs elsewhere rely on it."""
        self._speed_fixed = speed_fixed
        self._clock, self._rate_hz, self._pace = clock, rate_hz, pace
        self._lock = threading.Lock()
        self.paused = self.quit_requested = False
        self.speed = pace.factor if pace else None
        self.paused_ns = 0
        self.on_wait: Callable[[], None] = lambda: None
        self.on_pause: Callable[[], None] = lambda: None
        self._is_between_ticks = True  # True before the first tick, and while the loop waits in a pause
        self._has_requests = True  # `wait` must handle a request, or the first tick
        self._steps = 0  # ticks requested and not begun
        self._next_ns = 0  # earliest start of the next tick under a speed limit

    @property
    def real_time(self) -> bool:
        """True if the wall clock paces the run."""
        return self._pace is not None

    @property
    def stands_still(self) -> bool:
        """True if the run is paused, the latest tick is over, and no further tick is requested."""
        with self._lock:
            return self.paused and self._is_between_ticks and not self._steps

    @property
    def missed_ticks(self) -> int:
        """Number of ticks that came too late in real time; 0 in a run that is not in real time."""
        return self._pace.missed_ticks if self._pace else 0

    def pause(self) -> None:
        """Pause at the end of the present tick; requested ticks that have not begun are dropped."""
        with self._lock:
            self.paused, self._steps, self._has_requests = True, 0, True

    def resume(self) -> None:
        """End a pause."""
        with self._lock:
            self.paused, self._steps, self._has_requests = False, 0, True

    def step_by(self, ticks: int) -> None:
        """Run this number of ticks after those requested before, then pause."""
        with self._lock:
            self._steps += ticks
            self.paused = self._has_requests = True

    def set_speed(self, speed: float | None) -> None:
        """Change the speed from the next tick on; None: no limit. BadInput for a speed that the run cannot have."""
        if self._speed_fixed:
            raise BadInput("", "factor", "expected no other speed: programs elsewhere keep to that of the run")
        if speed is None and self._pace:
            raise BadInput(
                "", "factor", "expected a number: the run keeps to the wall clock, and has no unlimited speed"
            )
        if speed is not None and not MIN_SPEED <= speed <= MAX_SPEED:
            raise BadInput("", "factor", f"expected {MIN_SPEED:g} to {MAX_SPEED:g} times real time, got {speed!r}")
        with self._lock:
            self.speed, self._has_requests = speed, True
            self._next_ns = self._clock.now_ns()

    def quit(self) -> None:
        """End the run after the present tick."""
        self.quit_requested = True

    def wait(self, tick: int, stopped: Callable[[], bool]) -> None:
        """Return when the tick may begin, or when the run must end."""
        if self._has_requests:
            self._handle_requests(tick, stopped)

    def _handle_requests(self, tick: int, stopped: Callable[[], bool]) -> None:
        paused_ns = 0
        while not (self.quit_requested or stopped()):
            now_ns = self._clock.now_ns()
            paused, wait_ns = self._wait_ns(now_ns)
            if wait_ns <= 0:
                break
            self.on_wait()
            if paused:
                self.on_pause()
            self._clock.sleep_until(now_ns + min(wait_ns, POLL_NS))
            paused_ns += (self._clock.now_ns() - now_ns) if paused else 0
        self._begin(tick, paused_ns)

    def _wait_ns(self, now_ns: int) -> tuple[bool, int]:
        """Return True if the run is paused, and the time until the next tick may begin."""
        with self._lock:
            if self.paused:
                self._is_between_ticks = self._steps == 0
                if self._is_between_ticks:
                    return True, POLL_NS
                self._steps -= 1
                return False, 0
            self._is_between_ticks = False
            return False, 0 if self._pace or self.speed is None else self._next_ns - now_ns

    def _begin(self, tick: int, paused_ns: int) -> None:
        with self._lock:
            now_ns = self._clock.now_ns()
            self.paused_ns += paused_ns
            self._has_requests = self.paused
            if self._pace:
                if paused_ns or self.speed != self._pace.factor:
                    self._pace.restart(tick, self.speed or self._pace.factor, paused_ns)
            elif self.speed is not None:
                # The next wait makes up for a wait that was too long, up to one period; more would be a burst.
                period_ns = round(tick_start_ns(1, self._rate_hz) / self.speed)
                self._next_ns = max(self._next_ns, now_ns - period_ns) + period_ns
                self._has_requests = True


class Interrupt:
    """A context in which SIGINT, SIGTERM and SIGHUP request the end of the run after the present tick.

    A second SIGINT or SIGTERM ends the run at once; a second SIGHUP does not, since both shell and system may send it.
    It has an effect in the main thread only. A SIGHUP that is ignored (nohup) stays ignored.

    Attributes:
        requested: True if one of the signals came.
        hung_up: True if SIGHUP came: the output has no reader.
    """

    def __init__(self) -> None:
        self.requested = self.hung_up = False
        self._handlers: dict[signal.Signals, object] = {}  # handlers before the context

    def __enter__(self) -> "Interrupt":
        if threading.current_thread() is threading.main_thread():
            for number in (signal.SIGINT, signal.SIGTERM):
                self._handlers[number] = signal.signal(number, self._handle)
            if signal.getsignal(signal.SIGHUP) != signal.SIG_IGN:
                self._handlers[signal.SIGHUP] = signal.signal(signal.SIGHUP, self._hang_up)
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        for number, handler in self._handlers.items():
            signal.signal(number, handler)  # pyright: ignore[reportArgumentType] - signal() returned it

    def _handle(self, number: int, frame: FrameType | None) -> None:
        if self.requested:
            raise KeyboardInterrupt
        self.requested = True

    def _hang_up(self, number: int, frame: FrameType | None) -> None:
        self.requested = self.hung_up = True
