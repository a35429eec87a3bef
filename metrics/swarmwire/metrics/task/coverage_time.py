"""Coverage time: how long the swarm takes to have been nearly everywhere."""

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.clock import to_s
from swarmwire.comms.config import parameter
from swarmwire.comms.truth import Static
from swarmwire.metrics.metric import Measure
from swarmwire.metrics.moment import Moment
from swarmwire.metrics.task.coverage import OfCoverage
from swarmwire.metrics.task.floor_cells import FloorCells


@dataclass(frozen=True)
class CoverageTime(OfCoverage):
    """First time in s at which `coverage`, with the same `sensing_m` and `cell_m`, is at least `share`.

    NaN until then, and if no cell is free.
    """

    name = "coverage_time_s"
    help = "first time that coverage is at least share, in s"
    unit = "s"
    kind = "time"
    bounds = (0.0, None)

    share: float = parameter(0.9, help="of the free cells that is to be covered", above=0.0, at_most=1.0)

    def begin(self, static: Static) -> Measure:
        """A fresh measure, which keeps a byte for each cell."""
        cells = FloorCells(static, self.cell_m, self.sensing_m)
        found_s: FloatArray = np.full(static.arenas, np.nan)

        def measure(moment: Moment) -> FloatArray:
            open_ = np.isnan(found_s)
            if open_.any():
                cells.see(moment)
                found_s[open_ & (cells.share >= self.share)] = to_s(moment.truth.time_ns)
            return found_s

        return measure
