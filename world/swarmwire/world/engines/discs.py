"""An array engine for round robots: one compiled call moves those of all arenas through all steps of a tick.

Rows of different arenas are never near each other, and contacts are solved in an order of their own (see `discs_near`),
so an arena moves bit for bit alike alone and beside others, and what is far away changes nothing.
"""

from typing import ClassVar

import numpy as np

from swarmwire.comms.arrays import BoolArray, FloatArray, IntArray
from swarmwire.comms.grid import build
from swarmwire.world.engines.discs_contacts import CONTACT
from swarmwire.world.engines.discs_near import list_fixed, list_pairs, split
from swarmwire.world.engines.discs_obstacle_cells import obstacle_cells
from swarmwire.world.engines.discs_robots import robots_of
from swarmwire.world.engines.discs_tick import advance, needed_margin_m
from swarmwire.world.engines.engine import Setting

MARGIN = (
    0.3  # of the widest radius: how far robots may move until near things are listed anew, unless speed asks for more
)


class Discs:
    """An `Engine` for robots against robots, walls and obstacles that stand still."""

    name: ClassVar[str] = "discs"

    def __init__(self, setting: Setting, pose: FloatArray) -> None:
        arenas, robots = pose.shape[:2]
        rows = arenas * robots
        self._setting, self._per_arena, self._step_s = setting, robots, setting.tick_s / setting.steps
        self.state: FloatArray = np.zeros((arenas, robots, 6))
        self.state[:, :, :3] = pose
        self.travel_m: FloatArray = np.zeros((arenas, robots, 2))
        self.touched: FloatArray = np.zeros((arenas, robots))
        self.braked: BoolArray = np.zeros((arenas, robots), np.bool_)
        self._robots = robots_of(arenas, setting.radius_m, setting.bottom_m, setting.motors, self._step_s)
        self._state, self._travel_m = self.state.reshape(rows, 6), self.travel_m.reshape(rows, 2)
        self._touched = self.touched.reshape(rows)
        self._unhindered, self._middle, self._shift_m = np.zeros(rows), np.zeros((rows, 2)), np.zeros((rows, 2))
        self._against_fixed = np.zeros(rows, np.int64)
        self._spread = np.zeros(2)
        self._widest_m = float(setting.radius_m.max(initial=0.0))
        self._pairs: IntArray = np.empty((0, 3), np.int64)
        self._set_margin(MARGIN * self._widest_m)
        self._list_near()

    def tick(self, target: FloatArray) -> IntArray:
        """Move by one tick towards targets (arenas, robots, 3): see `Engine`."""
        onsets = np.zeros((len(self.state), 2), np.int64)
        half_size_m = 0.5 * self._setting.size_m[0], 0.5 * self._setting.size_m[1]
        steps, obstacles, rows = self._setting.steps, self._setting.obstacles, len(self._state)
        step = 0
        while True:
            step = advance(
                step, steps, self._step_s, self._margin_m, self._widest_m, half_size_m, self._per_arena,
                self._robots, self._state, self._travel_m, self._touched, self.braked.reshape(rows),
                target.reshape(rows, 3), self._unhindered, self._middle, self._shift_m, self._against_fixed, onsets,
                self._listed_at, self._spread, self._pairs, self._things, self._crowd, self._loners, self._contacts,
                obstacles.circle, obstacles.side_start, obstacles.side,
            )  # fmt: skip
            if step == steps:
                return onsets
            self._list_near()

    def _set_margin(self, margin_m: float) -> None:
        self._margin_m = margin_m
        # A robot's cell lists what its rim may reach.
        self._cells = obstacle_cells(self._setting.obstacles, self._setting.size_m, self._widest_m + margin_m)

    def _list_near(self) -> None:
        """List what is near each robot, with a margin that lasts for a tick at least."""
        needed_m = needed_margin_m(self._spread[1], self._widest_m, self._step_s, self._setting.steps)
        if needed_m > self._margin_m:
            self._set_margin(1.5 * needed_m)
        setting, state, arenas = self._setting, self._state, len(self.state)
        # About a robot in each cell, if they are spread evenly.
        spacing_m = float(np.sqrt(setting.size_m[0] * setting.size_m[1] / max(self._per_arena, 1)))
        reach_m = max(2.0 * (self._widest_m + self._margin_m), spacing_m)
        grid = build(state[:, 0], state[:, 1], arenas, setting.size_m, reach_m)
        self._pairs = list_pairs(self._robots, state, grid, arenas, self._margin_m, self._pairs)
        walled = setting.boundary == "walls"
        self._things = list_fixed(
            self._robots, state, setting.size_m, walled, setting.obstacles, self._cells, self._margin_m
        )
        self._crowd, self._loners = split(len(state), self._pairs, self._things)
        self._contacts = np.zeros(len(self._pairs) + len(self._things), CONTACT)
        self._listed_at = state[:, :2].copy()
        self._spread[0] = 0.0
