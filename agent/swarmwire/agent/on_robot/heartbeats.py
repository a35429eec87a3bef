"""What an agent's process tells its guard through a pipe: that it runs, and whether it was stopped for good."""

import os
from collections.abc import Callable

from swarmwire.agent.on_robot.guard import RUNS, STOPPED


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
