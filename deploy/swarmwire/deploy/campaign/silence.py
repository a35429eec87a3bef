"""For how long a worker has said nothing: whoever is at a task says in every few seconds that its ticks go on.

An agent that waits for ever, or a process that was frozen, would otherwise hold up a campaign for good.
"""

from collections.abc import Callable

from swarmwire.comms.clock import Clock, WallClock, to_ns
from swarmwire.comms.interfaces import Observer
from swarmwire.comms.truth import Truth

SAY_S = 5.0  # between two words of a worker whose ticks go on
MAX_S = 300.0  # without one; no tick takes so long, nor does what comes before the first and after the last
STEP_S = (
    1.0  # that a look adds at most: who was frozen itself, with its machine or by Ctrl-Z, has received nothing, too
)


class Silence:
    """Adds up the time in which nothing was received.

    Attributes:
        most_s: after which it has lasted too long.
    """

    def __init__(self, clock: Clock | None = None, most_s: float = MAX_S) -> None:
        self.most_s, self._clock = most_s, clock or WallClock()
        self._silent_ns, self._looked_ns = 0, self._clock.now_ns()

    def broken(self) -> None:
        """Something was received."""
        self._silent_ns, self._looked_ns = 0, self._clock.now_ns()

    def too_long(self) -> bool:
        """Whether it has lasted too long; to be asked often."""
        now_ns = self._clock.now_ns()
        self._silent_ns += min(now_ns - self._looked_ns, to_ns(STEP_S))
        self._looked_ns = now_ns
        return self._silent_ns > to_ns(self.most_s)

    def __str__(self) -> str:
        return f"the worker stood still for {self.most_s:g} s"


class Alive(Observer):
    """Observer of a worker's runs that says so while its ticks go on."""

    def __init__(self, say: Callable[[], None], clock: Clock | None = None) -> None:
        self._say, self._clock = say, clock or WallClock()
        self._due_ns = self._clock.now_ns()

    def see(self, truth: Truth) -> None:
        """Say so, unless it was said a moment ago."""
        now_ns = self._clock.now_ns()
        if now_ns >= self._due_ns:
            self._due_ns = now_ns + to_ns(SAY_S)
            self._say()
