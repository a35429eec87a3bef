"""The spatial index of obstacles: built once, so that the cost of a query does not grow with their number. Compiled.

A cell lists every obstacle within a fixed reach of it: a robot reads only the list of its cell. On a torus the index
also has images of the obstacles that reach into the arena over its edge.
"""

from typing import Any, NamedTuple

import numpy as np

from swarmwire.comms.base.arrays import AnyArray, FloatArray, IntArray
from swarmwire.comms.base.geometry.obstacles import Obstacles, ray_to_circle, ray_to_polygon
from swarmwire.comms.base.geometry.robot_index import Grid, column_of, grid_over, row_of
from swarmwire.comms.base.kernels import kernel, njit

CELLS_PER_OBSTACLE = 4
FEW = 8  # obstacles per arena up to which lines test all of them, which is faster than to go through cells
MARGIN_M = 1e-9  # added to the reach against rounding


class ObstacleIndex(NamedTuple):
    """The obstacles of all arenas; an obstacle with sides is a polygon, else a circle."""

    shape: FloatArray  # (obstacles, 4) x, y, radius of the bounding circle, height of its top in m
    side_start: IntArray  # (obstacles + 1,) obstacle k has the sides side_start[k] to side_start[k + 1] - 1
    side: FloatArray  # (sides, 5) of `obstacles.sides_of`
    extent: FloatArray  # (arenas, 4) left, bottom, right, top in m of all obstacles; inf, inf, -inf, -inf without any
    cells: Grid


def obstacles_within(
    obstacles: Obstacles, size_m: tuple[float, float], reach_m: float, torus: bool, images_m: float | None = None
) -> ObstacleIndex:
    """Return the index of the obstacles in arenas of this size, for queries within `reach_m`.

    On a torus it includes images within `images_m` of the arena, by default the reach.
    """
    arenas = len(obstacles.circle_start) - 1
    shape = np.concatenate(
        [
            np.column_stack([obstacles.circle, obstacles.circle_top_m]),
            np.column_stack([obstacles.polygon, obstacles.polygon_top_m]),
        ]
    )
    starts = obstacles.circle_start, obstacles.polygon_start
    arena = np.concatenate([np.repeat(np.arange(arenas), np.diff(start)) for start in starts])
    sides = np.concatenate([np.zeros(len(obstacles.circle), np.int64), np.diff(obstacles.side_start)])
    shape, arena, sides, side = _with_images(shape, arena, sides, obstacles.side, size_m, images_m or reach_m, torus)
    side_start = np.concatenate([[0], np.cumsum(sides)])
    per_obstacle_m = np.sqrt(size_m[0] * size_m[1] * arenas / (CELLS_PER_OBSTACLE * max(len(shape), 1)))
    many = len(shape) > (FEW * arenas if reach_m == 0.0 else 0)
    cell_m = max(0.5 * reach_m, float(per_obstacle_m)) if many else max(size_m)
    cells = grid_over(size_m, cell_m, arenas, 0)
    facts = shape, arena, side_start, side, cells, reach_m + MARGIN_M
    count = np.zeros(len(cells.start) - 1, np.int64)
    _list(count, np.empty(0, np.int64), *facts)
    start = np.concatenate([[0], np.cumsum(count)])
    item = np.empty(start[-1], np.int64)
    _list(start[:-1].copy(), item, *facts)
    extent = np.tile([np.inf, np.inf, -np.inf, -np.inf], (arenas, 1))
    around_m = shape[:, 2:3] + reach_m + MARGIN_M
    np.minimum.at(extent[:, :2], arena, shape[:, :2] - around_m)
    np.maximum.at(extent[:, 2:], arena, shape[:, :2] + around_m)
    return ObstacleIndex(shape, side_start, side, extent, cells._replace(start=start, item=item))


class ObstacleIndices:
    """The obstacle index of arenas: built at first use, and again after an obstacle was pushed."""

    def __init__(
        self,
        obstacles: Obstacles,
        size_m: tuple[float, float],
        reach_m: float,
        torus: bool = False,
        images_m: float | None = None,
        obstacles_move: bool = False,
    ) -> None:
        """Keep the arguments of `obstacles_within`; with `obstacles_move` the arrays may change in place."""
        self._obstacles, self._facts, self._move = obstacles, (size_m, reach_m, torus, images_m), obstacles_move
        self._index: ObstacleIndex | None = None
        self._indexed: tuple[FloatArray, ...] = ()  # the arrays from which the index was built

    @property
    def count(self) -> int:
        """Number of obstacles in all arenas."""
        return len(self._obstacles.circle) + len(self._obstacles.polygon)

    def now(self) -> ObstacleIndex:
        """Return the index for the current positions; the number of obstacles never changes."""
        if self._index is None or (self._move and not all(map(np.array_equal, self._indexed, self._current()))):
            self._index = obstacles_within(self._obstacles, *self._facts)
            self._indexed = tuple(array.copy() for array in self._current()) if self._move else ()
        return self._index

    def _current(self) -> tuple[FloatArray, ...]:
        return self._obstacles.circle, self._obstacles.polygon, self._obstacles.side


def _with_images(
    shape: AnyArray,
    arena: AnyArray,
    sides: AnyArray,
    side: AnyArray,
    size_m: tuple[float, float],
    reach_m: float,
    torus: bool,
):
    """Return the same arrays with the images within reach of the arena beyond an edge."""
    owner = np.repeat(np.arange(len(shape)), sides)
    parts = [(shape, arena, sides, side)]
    offsets = (-1, 0, 1) if torus else (0,)
    for i, j in ((i, j) for i in offsets for j in offsets if i or j):
        shift_x, shift_y = i * size_m[0], j * size_m[1]
        moved = shape + np.array([shift_x, shift_y, 0.0, 0.0])
        beyond = np.abs(moved[:, :2]) - moved[:, 2:3] - 0.5 * np.array(size_m)
        near: Any = (beyond < reach_m + MARGIN_M).all(axis=1)
        moved_side = side + np.array([shift_x, shift_y, 0.0, 0.0, 0.0])
        moved_side[:, 4] += side[:, 2] * shift_x + side[:, 3] * shift_y
        parts.append((moved[near], arena[near], sides[near], moved_side[near[owner]]))
    return tuple(np.concatenate(column) for column in zip(*parts, strict=True))


@njit()
def _list(
    start: AnyArray,
    item: AnyArray,
    shape: AnyArray,
    arena: AnyArray,
    side_start: AnyArray,
    side: AnyArray,
    cells: Grid,
    reach_m: float,
):
    """Add the number of obstacles within reach of each cell to start[c]; with `item`, write them from start[c] on."""
    wide, high = 1.0 / cells.per_x, 1.0 / cells.per_y
    for k in range(len(shape)):
        x, y, radius = shape[k, 0], shape[k, 1], shape[k, 2] + reach_m
        left, below = np.floor((x - radius) / wide + 0.5 * cells.nx), np.floor((y - radius) / high + 0.5 * cells.ny)
        columns = int(np.floor((x + radius) / wide + 0.5 * cells.nx) - left) + 1
        rows = int(np.floor((y + radius) / high + 0.5 * cells.ny) - below) + 1
        in_all = columns > cells.nx or rows > cells.ny  # wraps onto itself: listed once in all of these cells
        for j in range(min(rows, cells.ny)):
            for i in range(min(columns, cells.nx)):
                at_x, at_y = (left + i + 0.5 - 0.5 * cells.nx) * wide, (below + j + 0.5 - 0.5 * cells.ny) * high
                if in_all or _is_near(at_x, at_y, 0.5 * wide, 0.5 * high, shape[k], side_start, side, k, reach_m):
                    c = (arena[k] * cells.ny + int(below + j) % cells.ny) * cells.nx + int(left + i) % cells.nx
                    if len(item):
                        item[start[c]] = k
                    start[c] += 1


@njit()
def _is_near(
    x: float,
    y: float,
    half_x: float,
    half_y: float,
    shape: AnyArray,
    side_start: AnyArray,
    side: AnyArray,
    k: int,
    reach_m: float,
):
    """Return False only if an obstacle is not within reach of the cell with centre x, y."""
    if side_start[k] == side_start[k + 1]:
        apart_x, apart_y = max(abs(shape[0] - x) - half_x, 0.0), max(abs(shape[1] - y) - half_y, 0.0)
        return apart_x * apart_x + apart_y * apart_y <= (shape[2] + reach_m) ** 2
    for i in range(side_start[k], side_start[k + 1]):
        nx, ny = side[i, 2], side[i, 3]
        if nx * x + ny * y - side[i, 4] - half_x * abs(nx) - half_y * abs(ny) > reach_m:
            return False
    return True


@kernel(from_python=True)
def obstacles_near(
    near: AnyArray, obstacles: ObstacleIndex, arena: int, x: float, y: float, reach_m: float, bottom_m: float
):
    """Write the obstacles higher than `bottom_m` with a circle within reach of x, y to `near`; return their number."""
    count = 0
    cells = obstacles.cells
    c = (arena * cells.ny + row_of(cells, y)) * cells.nx + column_of(cells, x)
    for at in range(cells.start[c], cells.start[c + 1]):
        k = cells.item[at]
        ox, oy, reach = obstacles.shape[k, 0] - x, obstacles.shape[k, 1] - y, reach_m + obstacles.shape[k, 2]
        if obstacles.shape[k, 3] > bottom_m and ox * ox + oy * oy < reach * reach:
            near[count] = k
            count += 1
    return count


@kernel(from_python=True)
def ray_to_obstacle(px: float, py: float, dx: float, dy: float, obstacles: ObstacleIndex, k: int):
    """Return the distance along the unit ray (dx, dy) from (px, py) to an obstacle; 0 from inside, inf if it misses."""
    if obstacles.side_start[k] == obstacles.side_start[k + 1]:
        x, y, radius_m = obstacles.shape[k, 0], obstacles.shape[k, 1], obstacles.shape[k, 2]
        return ray_to_circle(px, py, dx, dy, x, y, radius_m)
    return ray_to_polygon(px, py, dx, dy, obstacles, k)
