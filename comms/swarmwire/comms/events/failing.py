"""Parts of robots that fail, at once or one after the other at a rate, and may be mended."""

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.arrays import BoolArray, IntArray, KeyArray
from swarmwire.comms.draws import purpose, uniform

BATTERY = "battery"  # the part without which a robot is dead
LIFETIME = purpose("time to failure")
NEVER_NS = np.iinfo(np.int64).max
HOUR_NS = 3600 * 10**9


class Failing:
    """A part of some robots that does not work.

    Attributes:
        failed: (rows,) written in place.
        next_ns: (rows,) when each robot's part fails or works again by itself; NEVER_NS: it stays as it is.
        lives: (rows,) how many times to failure were drawn.
    """

    def __init__(self, part: str, failed: BoolArray) -> None:
        self.part, self.failed = part, failed
        self.next_ns: IntArray = np.full(len(failed), NEVER_NS)
        self.lives: IntArray = np.zeros(len(failed), np.int64)

    def renew(self, rows: BoolArray, now_ns: int) -> None:
        """Let the part of these robots (rows,) work again; one that fails at a rate is due to be mended now."""
        down = rows & self.failed
        at_rate = self.lives > 0
        self.next_ns[down & at_rate] = now_ns
        self.failed[down & ~at_rate] = False


@dataclass(frozen=True, slots=True)
class Lifetimes:
    """Times to failure, exponential with a mean of an hour over `per_hour`; drawn for each robot and each of its lives.

    Keyed by robot, event and life, so that neither other arenas nor the length of a tick matter.
    """

    per_hour: float
    lasts_ns: int | None  # of each failure; None: for good
    keys: KeyArray  # (arenas,)
    serial: int  # the event's place in the scenario

    def begun(self, part: str, chosen: BoolArray, now_ns: int) -> Failing:
        """The robots chosen (rows,), all of them working."""
        failing = Failing(part, np.zeros(len(chosen), np.bool_))
        self._live(failing, chosen, np.full(len(chosen), now_ns))
        return failing

    def go_on(self, failing: Failing, now_ns: int) -> None:
        """Let fail and be mended whatever is due by now."""
        next_ns = failing.next_ns
        while (due := next_ns <= now_ns).any():
            at_ns = next_ns.copy()
            falls, mended = due & ~failing.failed, due & failing.failed
            failing.failed ^= due
            next_ns[falls] = NEVER_NS if self.lasts_ns is None else at_ns[falls] + self.lasts_ns
            self._live(failing, mended, at_ns)

    def _live(self, failing: Failing, rows: BoolArray, from_ns: IntArray) -> None:
        """Draw the next lifetime of these robots."""
        row = np.flatnonzero(rows)
        robots = len(rows) // len(self.keys)
        share = uniform(self.keys[row // robots], row % robots, self.serial, failing.lives[row], LIFETIME)
        life_ns = -np.log1p(-share) * (HOUR_NS / self.per_hour)
        failing.next_ns[row] = from_ns[row] + np.minimum(life_ns, NEVER_NS // 4).astype(np.int64)
        failing.lives[row] += 1
