"""How late things came that were due at a time: percentiles of any number of them, in bounded memory."""

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.arrays import IntArray
from swarmwire.comms.clock import to_s

NS_PER_US = 1000
PER_FOLD = 200  # classes in which 1 us and more are counted, for each factor of e: 0.5 % apart
CLASSES = 5200  # up to days


@dataclass(frozen=True)
class Delays:
    """By how much things came later than they were due, wall time; percentiles within 0.5 %."""

    count: int
    p50_s: float
    p99_s: float
    worst_s: float


class Lateness:
    """Counts delays in classes 0.5 % apart, of 5 ns below 1 us."""

    def __init__(self) -> None:
        self._counted = np.zeros(CLASSES, np.int64)
        self._worst_ns = 0

    def add(self, late_ns: IntArray) -> None:
        """Count these, (k,); what came early was on time."""
        if not len(late_ns):
            return
        late_ns = np.maximum(late_ns, 0)
        self._worst_ns = max(self._worst_ns, int(late_ns.max()))
        place = (np.log1p(late_ns / NS_PER_US) * PER_FOLD).astype(np.int64)
        self._counted += np.bincount(np.minimum(place, CLASSES - 1), minlength=CLASSES)

    def delays(self) -> Delays | None:
        """What was counted; None: nothing."""
        count = int(self._counted.sum())
        if not count:
            return None
        return Delays(count, self._percentile_s(0.5), self._percentile_s(0.99), to_s(self._worst_ns))

    def _percentile_s(self, share: float) -> float:
        """So that this share is no later: the upper end of its class, but never above the worst."""
        below: IntArray = np.cumsum(self._counted)
        place = int(np.searchsorted(below, share * int(below[-1])))
        upper_ns = float(np.expm1((place + 1) / PER_FOLD)) * NS_PER_US
        return to_s(min(round(upper_ns), self._worst_ns))
