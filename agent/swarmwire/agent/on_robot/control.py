"""What whoever runs the swarm may ask of a robot while its agent runs: an emergency stop, and how it is."""

import threading
from collections.abc import Callable, Mapping
from typing import Any

STOPPED = "estop"  # the state of a robot whose agent goes on no more


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
        return {**self._status, "state": STOPPED} if self.stopped else self._status

    def tell(self, status: Mapping[str, Any]) -> None:
        """Put a new status in place of the last one."""
        self._status = status
