"""The numbers that agents tell: kept for observers, without any effect on the run."""

import numpy as np

from swarmwire.comms.arrays import BoolArray, FloatArray
from swarmwire.comms.tick_io import Values


class ToldValues:
    """The number that each robot told last. `value` is replaced when it changes, never written to.

    Attributes:
        value: (rows,) NaN: the robot has told none; None: no robot ever has.
    """

    def __init__(self) -> None:
        self.value: FloatArray | None = None

    def take(self, told: Values, alive: BoolArray) -> None:
        """Take down what robots told in a tick; only those `alive` (rows,) tell anything."""
        here = alive[told.rows]
        if here.any():
            self.value = np.full(len(alive), np.nan) if self.value is None else self.value.copy()
            self.value[told.rows[here]] = told.value[here]

    def forget(self, rows: BoolArray) -> None:
        """These robots (rows,) have told nothing."""
        if self.value is not None and rows.any():
            self.value = np.where(rows, np.nan, self.value)
