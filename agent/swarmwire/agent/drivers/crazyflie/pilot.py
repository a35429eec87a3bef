"""The pilot: a thread that repeats set-points, takes off and lands.

A Crazyflie levels out when set-points cease for half a second, and falls after two seconds: so they are sent 20 times a
second, also while the agent is late.
"""

from math import degrees
from threading import Lock, Thread

from swarmwire.agent.drivers.crazyflie.link import CrazyflieLink
from swarmwire.agent.drivers.driver import STOP, Command
from swarmwire.comms.clock import NS_PER_S, Clock, to_ns

RATE_HZ = 20
HOLD_S = 2.0  # it hovers so long without a command, then lands
CLEAR = 0.8  # of its height: below, it moves neither sideways nor round
TOUCHED_M, MAX_TOUCH_S = 0.05, 2.0  # the motors go off below this height, or so long after the set-point is down


class Pilot:
    """Flies one Crazyflie at one height, from its first command to its landing.

    A low battery lands it, and no command takes it off again.
    """

    def __init__(self, link: CrazyflieLink, height_m: float, climb_mps: float, from_m: float, clock: Clock) -> None:
        """`from_m` is the height at which it is now; above the floor it hovers, until `HOLD_S` is over."""
        self._link, self._clock = link, clock
        self._cruise_m, self._step_m, self._height_m = height_m, climb_mps / RATE_HZ, from_m
        self._command, self._held_ns = STOP, clock.now_ns()
        self._up, self._lands, self._ended = from_m > 0.0, False, False
        self._touching = 0  # steps with the set-point on the floor
        self._lock = Lock()
        self._thread = Thread(target=self._fly, name="crazyflie set-points", daemon=True)
        self._thread.start()

    def command(self, command: Command) -> None:
        """Fly like this from now on; take off first."""
        with self._lock:
            if not self._lands:
                self._command, self._held_ns, self._up = command, 0, True

    def hold(self) -> None:
        """Hover on the spot at once; land unless a command comes within `HOLD_S`."""
        with self._lock:
            self._command, self._held_ns = STOP, self._held_ns or self._clock.now_ns()
            if self._up and not self._ended:
                self._send()

    def cut(self) -> None:
        """Motors off for good."""
        with self._lock:
            self._ended = True
            self._link.emergency_stop()

    def end(self, *, lands: bool) -> None:
        """Send no more set-points; if it `lands`, return when the motors are off."""
        with self._lock:
            self._lands = True
            self._ended |= not lands
        self._thread.join()

    def _fly(self) -> None:
        next_ns = self._clock.now_ns()
        while True:
            next_ns = max(next_ns + NS_PER_S // RATE_HZ, self._clock.now_ns())
            self._clock.sleep_until(next_ns)
            with self._lock:
                self._lands = self._lands or self._link.is_low()
                if self._ended or (self._lands and not self._up):
                    return
                if self._up:
                    self._step()

    def _step(self) -> None:
        held = self._held_ns and self._clock.now_ns() - self._held_ns > to_ns(HOLD_S)
        target_m = 0.0 if self._lands or held else self._cruise_m
        change_m = target_m - self._height_m
        self._height_m = max(self._height_m + min(max(change_m, -self._step_m), self._step_m), 0.0)
        self._touching = self._touching + 1 if self._height_m <= 0.0 and target_m == 0.0 else 0
        touched = self._link.height_m() < TOUCHED_M or self._touching > MAX_TOUCH_S * RATE_HZ
        if self._touching and touched:
            self._up = False
            self._link.off()
        else:
            self._send()

    def _send(self) -> None:
        now = self._command if not self._lands and self._link.height_m() >= CLEAR * self._cruise_m else STOP
        self._link.hover(now.linear_mps, now.lateral_mps, degrees(now.angular_radps), self._height_m)
