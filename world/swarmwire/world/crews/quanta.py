"""A tick in quanta: the loop wakes many times in it, to take in what came and hand over what is due.

In every quantum `take_in` gives what agents sent since, with the time at which it came; these packets go on the air, it
advances to now, and `hand_over` takes what was heard. So once more at the tick's end, where commands are taken as ever.
"""

from collections.abc import Sequence
from typing import Protocol

from swarmwire.comms.clock import Clock, tick_start_ns, to_ns
from swarmwire.comms.interfaces import AirTime, Put
from swarmwire.comms.packets import Heard, Outcomes
from swarmwire.world.crews.pace import Pace

MEAN_OF = 16  # sleeps, about: that were late
SHARE_EARLY = 5  # of a quantum, at most, that a sleep is shorter: a machine that wakes later than that is busy


class Exchange(Protocol):
    """Whoever carries packets between agents and air."""

    def take_in(self) -> Sequence[Put]:
        """Packets that agents sent since the last call, `at_ns` in wall time."""
        ...

    def hand_over(self, tick: int, at_ns: int, heard: Heard, outcomes: Outcomes) -> None:
        """Hand this to those that it is for, now, at `at_ns` of simulated time."""
        ...


class Quanta:
    """The quanta of ticks, by the wall clock.

    Attributes:
        quantum_s: wall time.
    """

    def __init__(self, clock: Clock, pace: Pace, rate_hz: int, quantum_s: float) -> None:
        self.quantum_s = quantum_s
        self._clock, self._pace, self._rate_hz, self._quantum_ns = clock, pace, rate_hz, to_ns(quantum_s)
        self._last_ns = 0  # up to which the air has advanced
        self._wakes_late_ns = 0  # by how much sleeps ended late, of late

    def pass_tick(self, tick: int, air: AirTime, exchange: Exchange) -> None:
        """Return once the tick is over by the wall clock, and all that is due by then was handed over."""
        last_ns = self._pace.over_ns(tick) - self._quantum_ns  # later, there may not be the time before the tick's end
        wake_ns = self._clock.now_ns()
        while wake_ns <= last_ns:
            self._sleep_until(wake_ns)
            self.exchange(tick, air, exchange)
            # Whoever woke late goes on from there: quanta that were missed are not made up for.
            wake_ns = max(wake_ns + self._quantum_ns, self._clock.now_ns())
        self._pace.hold(tick)
        self.exchange(tick, air, exchange)

    def _sleep_until(self, at_ns: int) -> None:
        """Sleep, for less by what the machine takes to wake; a little early or late does not matter here."""
        early_ns = at_ns - min(self._wakes_late_ns, self._quantum_ns // SHARE_EARLY)
        if self._clock.now_ns() < early_ns:
            self._clock.sleep_until(early_ns)
            self._wakes_late_ns += (self._clock.now_ns() - early_ns - self._wakes_late_ns) // MEAN_OF

    def exchange(self, tick: int, air: AirTime, exchange: Exchange) -> None:
        """Take in what came, and hand over what is due."""
        pace, came = self._pace, exchange.take_in()
        start_ns, end_ns = (tick_start_ns(of, self._rate_hz) for of in (tick, tick + 1))
        now_ns = min(max(start_ns, pace.simulated_ns(self._clock.now_ns()), self._last_ns), end_ns)
        from_ns = max(start_ns, self._last_ns)
        for put in came:
            # The network's threads put in what came in nearly the order in which it did.
            from_ns = min(max(from_ns, pace.simulated_ns(put.at_ns)), now_ns)
            air.send(put._replace(at_ns=from_ns))
        self._last_ns = now_ns
        heard, outcomes = air.advance(now_ns)
        if len(heard) or len(outcomes):
            exchange.hand_over(tick, now_ns, heard, outcomes)
            pace.handed_over(heard.heard_at_ns)
