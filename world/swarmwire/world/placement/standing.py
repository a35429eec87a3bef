"""The obstacles that stand in an arena so far, for whatever is to find a place among them."""

from collections.abc import Sequence

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.geometry.obstacles import obstacle_arrays
from swarmwire.comms.geometry.robot_index import MOST_CELLS_PER_SIDE
from swarmwire.comms.truth import Group, Light, Obstacle
from swarmwire.world.placement.layout import Layout
from swarmwire.world.placement.obstacles import obstacle_at
from swarmwire.world.placement.taken import Taken
from swarmwire.world.scenario.arena_tables import ArenaTable, CylinderTable, ObstacleTable


class Standing:
    """The obstacles of one arena as arrays with room for all that will stand there; those of the map are the first."""

    def __init__(self, arena: ArenaTable, layout: Layout) -> None:
        self._size_m, self._wraps = layout.size_m, arena.boundary == "torus"
        boxes = obstacle_arrays((layout.boxes,))
        count = sum(table.count for table in arena.obstacles)
        sides = sum(_sides(table) * table.count for table in arena.obstacles)
        self._circle = np.empty((count, 4))
        self._around = np.concatenate([_with_top(boxes.polygon, boxes.polygon_top_m), np.empty((count, 4))])
        self._side = np.concatenate([boxes.side, np.empty((sides, 5))])
        self._side_start = np.concatenate([boxes.side_start, np.zeros(count, np.int64)])
        self._circles, self._polygons = 0, len(boxes.polygon)

    def add(self, obstacle: Obstacle) -> Obstacle:
        """Note an obstacle."""
        shape = obstacle_arrays(((obstacle,),))
        if len(shape.circle):
            self._circle[self._circles] = _with_top(shape.circle, shape.circle_top_m)[0]
            self._circles += 1
        else:
            first = self._side_start[self._polygons]
            self._side[first : first + len(shape.side)] = shape.side
            self._around[self._polygons] = _with_top(shape.polygon, shape.polygon_top_m)[0]
            self._polygons += 1
            self._side_start[self._polygons] = first + len(shape.side)
        return obstacle

    def taken(self, groups: Sequence[Group] = (), gap_m: float = 0.0, lights: Sequence[Light] = ()) -> Taken:
        """What kernels look at, with room to note the robots of these groups, which keep at most `gap_m` apart.

        `lights` are points to keep away from, too.
        """
        width, height = self._size_m
        widest = max((group.body.radius_m for group in groups), default=max(width, height))
        cell_m = max(2.0 * widest + gap_m, max(width, height) / MOST_CELLS_PER_SIDE)
        robots = groups[-1].stop if groups else 0
        circle, side_start = self._circle[: self._circles], self._side_start[: self._polygons + 1]
        if lights:
            points = np.array([(light.x_m, light.y_m, 0.0, np.inf) for light in lights])
            circle = np.concatenate([circle, points])
        return Taken(
            half_x_m=0.5 * width,
            half_y_m=0.5 * height,
            wraps=self._wraps,
            circle=circle,
            around=self._around[: self._polygons],
            side_start=side_start,
            side=self._side[: side_start[-1]],
            cell_m=cell_m,
            head=np.full((int(np.ceil(height / cell_m)), int(np.ceil(width / cell_m))), -1, np.int64),
            follow=np.full(robots, -1, np.int64),
            robot=np.zeros((robots, 5)),
        )


def _with_top(shape: FloatArray, top_m: FloatArray) -> FloatArray:
    return np.concatenate([shape, top_m[:, None]], axis=1)


def _sides(table: ObstacleTable) -> int:
    return 0 if isinstance(table, CylinderTable) else len(obstacle_at(table, 0.0, 0.0, 0.0).corners_m)
