"""The robots of all arenas, sorted into cells in each tick, so that a sensor looks at near ones only. Compiled."""

# pyright: basic, reportUnknownMemberType=false

from typing import NamedTuple

import numpy as np

from swarmwire.comms.arrays import BoolArray, FloatArray, IntArray
from swarmwire.comms.geometry.robot_index import Cells, cells_over, column_of, row_of
from swarmwire.comms.kernels import borrowing
from swarmwire.world.sensors.scene import Scene

CELLS_PER_ROBOT = 8  # so that few share one where they gather in a corner of a large arena


class Crowd(NamedTuple):
    """What kernels know of the robots; `cells` is filled by `cells.sort`."""

    state: FloatArray  # (arenas, robots, 6)
    running: BoolArray  # (arenas,) others are passed over
    radius_m: FloatArray  # (robots,)
    bottom_m: FloatArray  # (robots,)
    top_m: FloatArray  # (robots,)
    wrap_x: float  # extents of a torus in m, 0 if it is none
    wrap_y: float
    per_wrap_x: float  # 1 / wrap_x, or 0
    per_wrap_y: float
    cells: Cells
    found: IntArray  # (robots,) room for those that `near_robots` finds
    found_at: FloatArray  # (robots, 2) and for where they are


def crowd_of(scene: Scene, reach_m: float) -> Crowd:
    """The robots of a scene, for looking at whose centre is within `reach_m`."""
    arenas, robots = scene.state.shape[:2]
    per_cell_m = np.sqrt(scene.size_m[0] * scene.size_m[1] / (CELLS_PER_ROBOT * robots))
    torus = scene.boundary == "torus"
    wrap_x, wrap_y = scene.size_m if torus else (0.0, 0.0)
    per_wrap_x, per_wrap_y = (1.0 / wrap_x, 1.0 / wrap_y) if torus else (0.0, 0.0)
    return Crowd(
        scene.state,
        scene.running,
        scene.radius_m,
        scene.bottom_m,
        scene.top_m,
        wrap_x,
        wrap_y,
        per_wrap_x,
        per_wrap_y,
        cells_over(scene.size_m, max(reach_m, float(per_cell_m)), arenas, arenas * robots),
        np.empty(robots, np.int64),
        np.empty((robots, 2)),
    )


@borrowing()
def nearest(at, there, wrap, per_wrap):
    """Where a coordinate `there` is as seen from `at`: on a torus, its image at the least distance."""
    return there - wrap * np.rint((there - at) * per_wrap)


@borrowing()
def near_robots(crowd, arena, own, x, y, reach_m, low_m, high_m):
    """Write into `crowd.found` the robots but `own` whose rims are within reach of a place; how many.

    Only those that are somewhere between two heights above the floor.
    """
    cells, count = crowd.cells, 0
    row, column = row_of(cells, y), column_of(cells, x)
    for j in range(min(cells.ny, 3)):
        r = (row + j - 1) % cells.ny
        for i in range(min(cells.nx, 3)):
            c = (arena * cells.ny + r) * cells.nx + (column + i - 1) % cells.nx
            for k in range(cells.start[c], cells.start[c + 1]):
                other = cells.item[k]
                cx = nearest(x, crowd.state[arena, other, 0], crowd.wrap_x, crowd.per_wrap_x)
                cy = nearest(y, crowd.state[arena, other, 1], crowd.wrap_y, crowd.per_wrap_y)
                ox, oy, reach = cx - x, cy - y, reach_m + crowd.radius_m[other]
                if ox * ox + oy * oy >= reach * reach or other == own:
                    continue
                if crowd.bottom_m[other] < high_m and low_m < crowd.top_m[other]:
                    crowd.found[count] = other
                    crowd.found_at[count, 0], crowd.found_at[count, 1] = cx, cy
                    count += 1
    return count
