"""What the LEDs of all robots show."""

from collections.abc import Sequence

import numpy as np

from swarmwire.comms.arrays import BoolArray, IntArray
from swarmwire.comms.tick_io import LedChanges
from swarmwire.comms.truth import Group


class ShownLeds:
    """The LEDs of all robots: dark at the start, and then as their agents switch them.

    Attributes:
        rgb: (arenas, robots, most LEDs of a robot) 0xRRGGBB, 0: dark or not there; written in place.
        told: (rows, most LEDs of a robot) the same for observers: replaced when something changes, never written to.
        not_there: (arenas,) changes of LEDs that their robots do not have.
    """

    def __init__(self, groups: Sequence[Group], arenas: int) -> None:
        self._count = np.repeat([group.body.led_count for group in groups], [of.stop - of.start for of in groups])
        self.rgb: IntArray = np.zeros((arenas, len(self._count), self._count.max(initial=0)), np.int64)
        self._row = self.rgb.reshape(arenas * len(self._count), self.rgb.shape[2])
        self.told = self._row.copy()
        self.not_there: IntArray = np.zeros(arenas, np.int64)

    def take(self, changes: LedChanges, alive: BoolArray) -> None:
        """Switch what agents of robots `alive` (rows,) switched in a tick."""
        if not len(changes):
            return
        there = changes.which < self._count[changes.rows % len(self._count)]
        np.add.at(self.not_there, changes.rows[~there] // len(self._count), 1)
        there &= alive[changes.rows]
        self._row[changes.rows[there], changes.which[there]] = changes.rgb[there]
        self.told = self._row.copy()

    def tell(self) -> None:
        """Tell observers what was written to `rgb`."""
        if not np.array_equal(self._row, self.told):
            self.told = self._row.copy()

    def darken(self, rows: BoolArray) -> None:
        """These robots (rows,) go dark."""
        if self._row[rows].any():
            self._row[rows] = 0
            self.told = self._row.copy()
