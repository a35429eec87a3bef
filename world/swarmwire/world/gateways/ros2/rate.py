"""When a sensor has a new reading."""

from math import floor

from swarmwire.comms.clock import NS_PER_S

NEAR = 1e-6  # a reading that is due but for rounding is due


class Rate:
    """Says of each tick whether a reading is due in it, as the sensors of the world themselves do."""

    def __init__(self, rate_hz: float) -> None:
        """0: in each tick."""
        self._rate_hz = rate_hz
        self._last = -1

    def is_due(self, time_ns: int) -> bool:
        """Whether a reading is due at this time since the start of the run, which may not go back."""
        if not self._rate_hz:
            return True
        now = floor(time_ns * self._rate_hz / NS_PER_S + NEAR)
        due, self._last = now > self._last, max(now, self._last)
        return due
