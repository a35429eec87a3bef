"""The step counters of the e-puck2 without their wrap."""

from swarmwire.comms.robots.epuck2.wheels import FASTEST

_WRAP = 1 << 16
_SLACK = 200  # steps: what a time that is measured here may be off by, and wheels that are pushed


class Odometer:
    """Steps of both wheels since the first reading.

    Readings must come before a counter has gone half its range, which takes half a minute at full speed.
    """

    def __init__(self) -> None:
        self.left, self.right = 0, 0
        self._before: tuple[int, int] | None = None

    def read(self, left: int, right: int) -> None:
        """Count on to what the counters show now."""
        more_left, more_right = self._since(left, right)
        self.left, self.right = self.left + more_left, self.right + more_right
        self._before = left, right

    def resume(self, left: int, right: int, elapsed_s: float) -> bool:
        """Count on after a connection was lost for so long; false if the counters began anew, and nothing is added.

        A robot that was switched off and on counts from 0 again: what it cannot have gone in that time it has not.
        """
        longest = FASTEST * elapsed_s + _SLACK
        known = longest < _WRAP // 2 and max(map(abs, self._since(left, right))) <= longest
        if not known:
            self._before = left, right
        self.read(left, right)
        return known

    def _since(self, left: int, right: int) -> tuple[int, int]:
        before = self._before or (left, right)
        return _signed(left - before[0]), _signed(right - before[1])


def _signed(steps: int) -> int:
    """Steps from one reading to the next, the shorter way round."""
    return (steps + _WRAP // 2) % _WRAP - _WRAP // 2
