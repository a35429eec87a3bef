"""What holds discs back in the arenas: their walls, and the obstacles by cell."""

import numpy as np

from swarmwire.comms.geometry.obstacle_index import things_within
from swarmwire.comms.geometry.robot_index import Cells
from swarmwire.world.engines.engine import Setting
from swarmwire.world.engines.held_back import Hindrance

SPARE = 1.25  # of a reach that has grown, so that robots that gather speed do not have the obstacles sorted each tick


class Hindrances:
    """The hindrances of a setting: obstacles are sorted once, or in each tick where some of them can be pushed."""

    def __init__(self, setting: Setting) -> None:
        """Nothing is sorted yet for any reach."""
        self._obstacles, self._size_m = setting.obstacles, setting.size_m
        self._move = any(obstacle.movable for standing in setting.standing for obstacle in standing)
        self._reach_m = 0.0
        width, height = setting.size_m
        walled, wraps = setting.boundary == "walls", setting.boundary == "torus"
        self._now = Hindrance(0.5 * width, 0.5 * height, walled, wraps, setting.obstacles, self._cells())

    def within(self, reach_m: float) -> Hindrance:
        """As they stand now, for looking at least `reach_m` far."""
        grown = reach_m > self._reach_m
        if grown:
            self._reach_m = SPARE * reach_m
        if grown or self._move:
            self._now = self._now._replace(cells=self._cells())
        return self._now

    def _cells(self) -> Cells:
        # Without their sides polygons are listed by the circles around them, which is what discs ask for first. Cells
        # are rolled up: on a torus, too, each obstacle is listed across the border without an image of it.
        bare = self._obstacles._replace(
            side_start=np.zeros_like(self._obstacles.side_start), side=np.empty((0, 5), np.float64)
        )
        reach_m = min(self._reach_m, sum(self._size_m))  # farther is in all cells
        return things_within(bare, self._size_m, reach_m, torus=False).cells
