"""Tallies as of one tick each, out of tallies over several: plots count in ticks."""

import numpy as np

from swarmwire.comms.arrays import FloatArray, IntArray
from swarmwire.comms.truth import PacketCounts


class Evened:
    """Mean tallies per tick in whole numbers: what rounding leaves over comes with a later one."""

    def __init__(self) -> None:
        self._owed: FloatArray | None = None

    def per_tick(self, tally: PacketCounts, ticks: int) -> PacketCounts:
        """The tally of one of these ticks."""
        counts: IntArray = np.vstack([tally.sent, tally.intended, tally.in_range, tally.fates.T])
        owed = counts / ticks + (0.0 if self._owed is None else self._owed)
        whole = np.floor(owed + 1e-9).astype(np.int64)  # thirds add up to a little less than one
        self._owed = owed - whole
        return PacketCounts(whole[0], whole[1], whole[2], whole[3:].T)
