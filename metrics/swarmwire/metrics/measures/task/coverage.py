"""Coverage: the share of the floor that robots have been near, and the time to reach a share."""

from dataclasses import dataclass
from math import ceil, hypot
from typing import Any, NamedTuple

import numpy as np

from swarmwire.comms.base.arrays import AnyArray, FloatArray, IntArray
from swarmwire.comms.base.clock import to_s
from swarmwire.comms.base.config import parameter
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.base.geometry.obstacles import obstacle_arrays
from swarmwire.comms.base.kernels import njit
from swarmwire.comms.observe.truth import Static
from swarmwire.metrics.measures.metric import Measure, Metric, TickView

MAX_CELLS = 2**27  # limit over all arenas: 128 MB
ROUNDING = 1e-9  # fraction of a cell
BLOCKED, FREE, COVERED = 0, 1, 2


@dataclass(frozen=True)
class CoverageMetric(Metric):
    """A metric of the cells that robots have covered."""

    sensing_m: float = parameter(0.5, help="a cell is covered by a robot whose centre is so near", unit="m", above=0.0)
    cell_m: float = parameter(0.1, help="most side of a cell: sides divide the arena's", unit="m", above=0.0)


@dataclass(frozen=True)
class CoverageRatio(CoverageMetric):
    """Free cells whose centre was within `sensing_m` of the centre of a robot alive at least once / free cells.

    The arena is divided into cells of sides of at most `cell_m`; a cell is free unless its centre lies in an obstacle
    that robots cannot push. Cells that no robot can reach count. A robot also covers cells behind an obstacle.
    Positions are those at the start of each tick. On a torus distances are the shortest. From 0 to 1, never falling;
    NaN if no cell is free.

    Closed form: N robots that go straight in random directions at v for t over an area A without walls cover
    1 - (1 - a / A)^N, where a = pi R^2 + 2 R v t and R is `sensing_m`; for many robots 1 - exp(-N a / A) (B. O.
    Koopman, The theory of search II, Operations Research 4 (5), 1956).
    """

    name = "coverage"
    help = "share of the free cells that a robot alive has been within sensing_m of at least once"
    bounds = (0.0, 1.0)

    def begin(self, static: Static) -> Measure:
        """Return a measure that keeps a byte for each cell."""
        cells = FloorCells(static, self.cell_m, self.sensing_m)

        def measure(view: TickView) -> FloatArray:
            cells.see(view)
            return cells.share

        return measure


@dataclass(frozen=True)
class CoverageTime(CoverageMetric):
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
        """Return a measure that keeps a byte for each cell."""
        cells = FloorCells(static, self.cell_m, self.sensing_m)
        time_s: FloatArray = np.full(static.arenas, np.nan)

        def measure(view: TickView) -> FloatArray:
            is_open = np.isnan(time_s)
            if is_open.any():
                cells.see(view)
                time_s[is_open & (cells.share >= self.share)] = to_s(view.truth.time_ns)
            return time_s

        return measure


class FloorCells:
    """The cells of each arena, with sides of at most `cell_m`.

    Attributes:
        free: (arenas,) number of cells whose centre is in no fixed obstacle.
        covered: (arenas,) number of free cells whose centre was within `sensing_m` of a robot alive.
        cells: (arenas, cells along y, cells along x) BLOCKED, FREE or COVERED.
    """

    def __init__(self, static: Static, cell_m: float, sensing_m: float) -> None:
        """Start with no cell covered; BadInput if there are more than 2^27 cells."""
        width_m, height_m = static.arena_size_m
        nx, ny = ceil(width_m / cell_m - ROUNDING), ceil(height_m / cell_m - ROUNDING)
        if nx * ny * static.arenas > MAX_CELLS:
            expected = f"expected at most {MAX_CELLS} cells in all arenas together, got {nx * ny * static.arenas}"
            raise BadInput("", "cell_m", expected)
        self.cells: AnyArray = np.full((static.arenas, ny, nx), FREE, np.uint8)
        self._floor = _Floor(width_m, height_m, static.boundary == "torus")
        # No point of a torus is farther than its diagonal, so a longer range adds only images of the same cells.
        self._sensing_m = min(sensing_m, hypot(width_m, height_m)) if static.boundary == "torus" else sensing_m
        obstacles = obstacle_arrays(tuple(map(static.fixed, range(static.arenas))))
        _block(self.cells, self._floor, obstacles)
        self.free: IntArray = np.count_nonzero(self.cells, axis=(1, 2))
        self.covered: IntArray = np.zeros(static.arenas, np.int64)

    def see(self, view: TickView) -> None:
        """Mark the cells near robots alive in a tick."""
        _cover(self.cells, self._floor, view.position_m, view.alive, self._sensing_m, self.covered)

    @property
    def share(self) -> FloatArray:
        """Covered cells / free cells, (arenas,); NaN if no cell is free."""
        return self.covered / np.where(self.free > 0, self.free, np.nan)


class _Floor(NamedTuple):
    width_m: float
    height_m: float
    is_torus: bool


@njit()
def _span(centre_m: float, reach_m: float, size_m: float, cells: int, is_torus: bool):
    """Return the first and last cell along an axis with a centre within reach; on a torus also beyond the edge."""
    per_m = cells / size_m
    first = int(np.ceil((centre_m - reach_m + 0.5 * size_m) * per_m - 0.5 - ROUNDING))
    last = int(np.floor((centre_m + reach_m + 0.5 * size_m) * per_m - 0.5 + ROUNDING))
    return (first, last) if is_torus else (max(first, 0), min(last, cells - 1))


@njit()
def _cover(cells: AnyArray, floor: Any, position_m: AnyArray, alive: AnyArray, sensing_m: float, covered: AnyArray):
    """Mark the free cells within `sensing_m` of robots alive, and add their number to `covered`."""
    arenas, ny, nx = cells.shape
    cell_x_m, cell_y_m = floor.width_m / nx, floor.height_m / ny
    for arena in range(arenas):
        for robot in range(position_m.shape[1]):
            if not alive[arena, robot]:
                continue
            x, y = position_m[arena, robot]
            first_i, last_i = _span(x, sensing_m, floor.width_m, nx, floor.is_torus)
            first_j, last_j = _span(y, sensing_m, floor.height_m, ny, floor.is_torus)
            for j in range(first_j, last_j + 1):
                dy, row, column = (j + 0.5) * cell_y_m - 0.5 * floor.height_m - y, cells[arena, j % ny], first_i % nx
                for i in range(first_i, last_i + 1):
                    if row[column] == FREE:
                        dx = (i + 0.5) * cell_x_m - 0.5 * floor.width_m - x
                        if dx * dx + dy * dy <= sensing_m * sensing_m:
                            row[column] = COVERED
                            covered[arena] += 1
                    column = column + 1 if column + 1 < nx else 0


@njit()
def _block(cells: AnyArray, floor: Any, obstacles: Any):
    """Mark the cells whose centres lie in an obstacle."""
    for arena in range(len(cells)):
        for k in range(obstacles.circle_start[arena], obstacles.circle_start[arena + 1]):
            _block_obstacle(cells[arena], floor, obstacles.circle[k], obstacles.side[:0])
        for k in range(obstacles.polygon_start[arena], obstacles.polygon_start[arena + 1]):
            sides = obstacles.side[obstacles.side_start[k] : obstacles.side_start[k + 1]]
            _block_obstacle(cells[arena], floor, obstacles.polygon[k], sides)


@njit()
def _block_obstacle(cells: AnyArray, floor: Any, circle: Any, sides: AnyArray):
    """Mark the cells of an arena in a circle; with `sides`, those on the inner side of each of them."""
    ny, nx = cells.shape
    x, y, radius_m = circle
    cell_x_m, cell_y_m = floor.width_m / nx, floor.height_m / ny
    first_i, last_i = _span(x, radius_m, floor.width_m, nx, floor.is_torus)
    first_j, last_j = _span(y, radius_m, floor.height_m, ny, floor.is_torus)
    for j in range(first_j, last_j + 1):
        for i in range(first_i, last_i + 1):
            cell_x, cell_y = (i + 0.5) * cell_x_m - 0.5 * floor.width_m, (j + 0.5) * cell_y_m - 0.5 * floor.height_m
            is_inside = len(sides) > 0 or (cell_x - x) ** 2 + (cell_y - y) ** 2 <= radius_m * radius_m
            for side in range(len(sides)):
                is_inside = is_inside and sides[side, 2] * cell_x + sides[side, 3] * cell_y <= sides[side, 4]
            if is_inside:
                cells[j % ny, i % nx] = BLOCKED
