"""What was counted in the last while: sums over a window of ticks."""

from dataclasses import dataclass
from math import ceil

import numpy as np
from numpy.typing import ArrayLike

from swarmwire.comms.arrays import IntArray
from swarmwire.comms.config import parameter
from swarmwire.comms.truth import Static
from swarmwire.metrics.metric import Metric

ROUNDING = 1e-9  # of a tick


@dataclass(frozen=True)
class OfWindow(Metric):
    """A metric of what happened in the last while."""

    window_s: float = parameter(
        1.0, help="what counts is so old at most; rounded up to whole ticks", unit="s", above=0.0
    )


class Window:
    """Sums of whole numbers per arena over the last ticks: exact, however long the run."""

    def __init__(self, static: Static, window_s: float, numbers: int) -> None:
        """For so many `numbers` in each tick."""
        ticks = max(1, ceil(window_s * static.rate_hz - ROUNDING))
        self._ring: IntArray = np.zeros((ticks, numbers, static.arenas), np.int64)
        self._sum: IntArray = np.zeros((numbers, static.arenas), np.int64)
        self._at = 0

    def add(self, numbers: ArrayLike) -> IntArray:
        """Take a tick's numbers (numbers, arenas), and tell their sums over the window, which holds it (same shape)."""
        oldest = self._ring[self._at]
        self._sum -= oldest
        oldest[:] = numbers
        self._sum += oldest
        self._at = (self._at + 1) % len(self._ring)
        return self._sum
