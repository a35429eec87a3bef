"""Rigid bodies of any shape, by pymunk: a space per arena, all of them stepped together. The reference."""

from typing import ClassVar

import numpy as np

from swarmwire.comms.arrays import BoolArray, FloatArray, IntArray
from swarmwire.world.engines.engine import Setting
from swarmwire.world.engines.movable import Movables
from swarmwire.world.engines.pymunk_drive import push
from swarmwire.world.engines.pymunk_space import ArenaSpace


class PymunkEngine:
    """The bodies of all arenas as pymunk's; see `Engine`."""

    name: ClassVar[str] = "pymunk"

    def __init__(self, setting: Setting, pose: FloatArray) -> None:
        """Bodies at rest at `pose` (arenas, n, 3)."""
        arenas, robots = pose.shape[:2]
        self._motors, self._steps, self._step_s = setting.motors, setting.steps, setting.tick_s / setting.steps
        self.state = np.zeros((arenas, robots, 6))
        self.travel_m = np.zeros((arenas, robots, 2))
        self.touched = np.zeros((arenas, robots))
        self.braked: BoolArray = np.zeros((arenas, robots), np.bool_)
        self._unhindered = np.zeros((arenas, robots))
        self._movables = Movables(setting.standing, setting.obstacles)
        self.movable = self._movables.pose  # (arenas, movable obstacles, 3) in place, as `Truth` has it
        loads = self.movable.shape[1]
        self._load_state = np.zeros((arenas, loads, 6))
        self._force = np.zeros((arenas, robots + loads + 1, 3))
        self._spaces = [
            ArenaSpace(setting, setting.standing[arena], self._movables.loads[arena], pose[arena], self._force[arena])
            for arena in range(arenas)
        ]
        self._running: BoolArray = np.ones(arenas, np.bool_)
        self._moving = list(range(arenas))  # the same as places
        self._read()

    def tick(self, target: FloatArray) -> IntArray:
        """Move by one tick towards targets (arenas, n, 3), and count the contacts that began, (arenas, 2)."""
        for _ in range(self._steps):
            # A turn that contacts gave to a robot that is braked is slowed down, but not made up for.
            np.copyto(self._unhindered, self.state[:, :, 5], where=self.braked)
            moved = self._force, self.travel_m, self._unhindered
            push(self._motors, target, self.state, self._step_s, self._running, *moved)
            for arena in self._moving:
                self._spaces[arena].step(self._step_s)
            self._read()
        if self.movable.size:
            self._movables.move(self._load_state)
        onsets = np.zeros((len(self._spaces), 2), np.int64)
        for arena in self._moving:
            self._spaces[arena].count_onsets(onsets[arena : arena + 1], self.touched[arena : arena + 1])
        return onsets

    def push(self, by_mps: FloatArray) -> None:
        """Add to the velocities of robots at once, (arenas, robots, 2) in m/s."""
        for arena in self._moving:
            self._spaces[arena].push(by_mps[arena])
        self._read()

    def leave(self, over: BoolArray) -> None:
        """The spaces of these arenas (arenas,) are not stepped any more."""
        self._running &= ~over
        self._moving = np.flatnonzero(self._running).tolist()

    def _read(self) -> None:
        for arena in self._moving:
            self._spaces[arena].read(self.state[arena], self._load_state[arena])
