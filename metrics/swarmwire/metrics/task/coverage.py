"""Coverage: how much of the floor the swarm has been near."""

from dataclasses import dataclass

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.config import parameter
from swarmwire.comms.truth import Static
from swarmwire.metrics.metric import Measure, Metric
from swarmwire.metrics.moment import Moment
from swarmwire.metrics.task.floor_cells import FloorCells


@dataclass(frozen=True)
class OfCoverage(Metric):
    """A metric of what robots have covered."""

    sensing_m: float = parameter(0.5, help="a cell is covered by a robot whose centre is so near", unit="m", above=0.0)
    cell_m: float = parameter(0.1, help="most side of a cell: sides divide the arena's", unit="m", above=0.0)


@dataclass(frozen=True)
class Coverage(OfCoverage):
    """Free cells whose centre was within `sensing_m` of the centre of a robot alive at least once / free cells.

    The arena is cut into cells of sides of at most `cell_m`; those whose centre lies in an obstacle are not free. A
    cell that no robot can get near to counts, and so does one under an obstacle that robots can push. Line of sight is
    not taken into account: a robot covers what stands behind an obstacle. Robots are looked at at the start of each
    tick, not on the way between two. On a torus distances are the shortest. From 0 to 1, and never less than before;
    NaN if no cell is free.

    Known value: of N robots that go straight in random directions at v for t over an area A, 1 - exp(-N (pi R^2 + 2 R v
    t) / A) is covered, R being `sensing_m` (B. O. Koopman, The theory of search II, Operations Research 4 (5), 1956).
    """

    name = "coverage"
    help = "share of the free cells that a robot alive has been within sensing_m of at least once"
    bounds = (0.0, 1.0)

    def begin(self, static: Static) -> Measure:
        """A fresh measure, which keeps a byte for each cell."""
        cells = FloorCells(static, self.cell_m, self.sensing_m)

        def measure(moment: Moment) -> FloatArray:
            cells.see(moment)
            return cells.share

        return measure
