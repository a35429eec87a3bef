"""Coverage: how much of the floor the swarm has been near, and when."""

from dataclasses import dataclass
from math import ceil, hypot
from typing import Any

import numpy as np

from swarmwire.comms.base.arrays import AnyArray, FloatArray, IntArray
from swarmwire.comms.base.clock import to_s
from swarmwire.comms.base.config import parameter
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.base.geometry.obstacles import obstacle_arrays
from swarmwire.comms.base.kernels import njit
from swarmwire.comms.observe.truth import Static
from swarmwire.metrics.measures.metric import Measure, Metric, TickView

MAX_CELLS = 2**27  # of all arenas: 128 MB
ROUNDING = 1e-9  # of a cell
TAKEN, FREE, SEEN = 0, 1, 2


@dataclass(frozen=True)
class OfCoverage(Metric):
    """A metric of what robots have covered."""

    sensing_m: float = parameter(0.5, help="a cell is covered by a robot whose centre is so near", unit="m", above=0.0)
    cell_m: float = parameter(0.1, help="most side of a cell: sides divide the arena's", unit="m", above=0.0)


@dataclass(frozen=True)
class CoverageRatio(OfCoverage):
    """Free cells whose centre was within `sensing_m` of the centre of a robot alive at least once / free cells.

    The arena is cut into cells of sides of at most `cell_m`; those whose centre lies in an obstacle are not free. A
    cell that no robot can get near to counts, and so does one under an obstacle that robots can push. Line of sight is
    not taken into account: a robot covers what stands behind an obstacle. Robots are looked at at the start of each
    tick, not on the way between two. On a torus distances are the shortest. From 0 to 1, and never less than before;
    NaN if no cell is free.

    Known value: N robots that go straight in random directions at v for t over an area A without walls cover
    1 - (1 - a / A)^N, where a = pi R^2 + 2 R v t and R is `sensing_m`; for many robots 1 - exp(-N a / A) (B. O.
    Koopman, The theory of search II, Operations Research 4 (5), 1956).
    """

    name = "coverage"
    help = "share of the free cells that a robot alive has been within sensing_m of at least once"
    bounds = (0.0, 1.0)

    def begin(self, static: Static) -> Measure:
        """A fresh measure, which keeps a byte for each cell."""
        cells = FloorCells(static, self.cell_m, self.sensing_m)

        def measure(view: TickView) -> FloatArray:
            cells.see(view)
            return cells.share

        return measure


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

        def measure(view: TickView) -> FloatArray:
            open_ = np.isnan(found_s)
            if open_.any():
                cells.see(view)
                found_s[open_ & (cells.share >= self.share)] = to_s(view.truth.time_ns)
            return found_s

        return measure


class FloorCells:
    """The cells of each arena, as many as it takes for sides of at most `cell_m`; a cell is where its centre is.

    Attributes:
        free: (arenas,) how many lie in no obstacle; those under obstacles that robots can push are free.
        seen: (arenas,) of these, that a robot alive has been within `sensing_m` of.
        cells: (arenas, cells along y, cells along x) TAKEN, FREE or SEEN.
    """

    def __init__(self, static: Static, cell_m: float, sensing_m: float) -> None:
        """All is unseen; BadInput if there are more cells than 2^27."""
        width_m, height_m = static.arena_size_m
        nx, ny = ceil(width_m / cell_m - ROUNDING), ceil(height_m / cell_m - ROUNDING)
        if nx * ny * static.arenas > MAX_CELLS:
            expected = f"expected at most {MAX_CELLS} cells in all arenas together, got {nx * ny * static.arenas}"
            raise BadInput("", "cell_m", expected)
        self.cells: AnyArray = np.full((static.arenas, ny, nx), FREE, np.uint8)
        self._floor = width_m, height_m, static.boundary == "torus"
        # Nothing on a torus is further away than its diagonal, so that no more images need be looked at.
        self._sensing_m = min(sensing_m, hypot(width_m, height_m)) if static.boundary == "torus" else sensing_m
        obstacles = obstacle_arrays(tuple(map(static.fixed, range(static.arenas))))
        _take(self.cells, *self._floor, obstacles)
        self.free: IntArray = np.count_nonzero(self.cells, axis=(1, 2))
        self.seen: IntArray = np.zeros(static.arenas, np.int64)

    def see(self, view: TickView) -> None:
        """Mark what robots alive are near to now."""
        _mark(self.cells, *self._floor, view.position_m, view.alive, self._sensing_m, self.seen)

    @property
    def share(self) -> FloatArray:
        """Cells seen / free cells, (arenas,); NaN where none is free."""
        return self.seen / np.where(self.free > 0, self.free, np.nan)


@njit()
def _span(at_m: float, reach_m: float, size_m: float, cells: int, torus: bool):
    """The first and last cell along an axis whose centre may be within reach; on a torus also beyond the edge."""
    per_m = cells / size_m
    first = int(np.ceil((at_m - reach_m + 0.5 * size_m) * per_m - 0.5 - ROUNDING))
    last = int(np.floor((at_m + reach_m + 0.5 * size_m) * per_m - 0.5 + ROUNDING))
    return (first, last) if torus else (max(first, 0), min(last, cells - 1))


@njit()
def _mark(
    cells: AnyArray,
    width_m: float,
    height_m: float,
    torus: Any,
    position_m: AnyArray,
    alive: AnyArray,
    sensing_m: float,
    seen: AnyArray,
):
    arenas, ny, nx = cells.shape
    wide_m, high_m = width_m / nx, height_m / ny
    for arena in range(arenas):
        for robot in range(position_m.shape[1]):
            if not alive[arena, robot]:
                continue
            x, y = position_m[arena, robot]
            left, right = _span(x, sensing_m, width_m, nx, torus)
            below, above = _span(y, sensing_m, height_m, ny, torus)
            for j in range(below, above + 1):
                up, row, column = (j + 0.5) * high_m - 0.5 * height_m - y, cells[arena, j % ny], left % nx
                for i in range(left, right + 1):
                    if row[column] == FREE:
                        along = (i + 0.5) * wide_m - 0.5 * width_m - x
                        if along * along + up * up <= sensing_m * sensing_m:
                            row[column] = SEEN
                            seen[arena] += 1
                    column = column + 1 if column + 1 < nx else 0


@njit()
def _take(cells: AnyArray, width_m: float, height_m: float, torus: Any, obstacles: Any):
    """Mark the cells whose centres lie in an obstacle."""
    for arena in range(len(cells)):
        for k in range(obstacles.circle_start[arena], obstacles.circle_start[arena + 1]):
            _take_one(cells[arena], width_m, height_m, torus, obstacles.circle[k], obstacles.side[:0])
        for k in range(obstacles.polygon_start[arena], obstacles.polygon_start[arena + 1]):
            sides = obstacles.side[obstacles.side_start[k] : obstacles.side_start[k + 1]]
            _take_one(cells[arena], width_m, height_m, torus, obstacles.polygon[k], sides)


@njit()
def _take_one(cells: AnyArray, width_m: float, height_m: float, torus: Any, circle: Any, sides: AnyArray):
    """Mark the cells of an arena that lie in a circle, and on the inner side of each of these sides, if any."""
    ny, nx = cells.shape
    x, y, radius_m = circle
    left, right = _span(x, radius_m, width_m, nx, torus)
    below, above = _span(y, radius_m, height_m, ny, torus)
    for j in range(below, above + 1):
        for i in range(left, right + 1):
            at_x, at_y = (i + 0.5) * (width_m / nx) - 0.5 * width_m, (j + 0.5) * (height_m / ny) - 0.5 * height_m
            inside = len(sides) > 0 or (at_x - x) ** 2 + (at_y - y) ** 2 <= radius_m * radius_m
            for side in range(len(sides)):
                inside = inside and sides[side, 2] * at_x + sides[side, 3] * at_y <= sides[side, 4]
            if inside:
                cells[j % ny, i % nx] = TAKEN
