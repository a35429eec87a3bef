"""The discs engine: one compiled call moves the round robots of all arenas through all steps of a tick.

The engine keeps a ROBOT_RECORD per row, where row = arena x robots + index. Rows of different arenas are never near
each other, and contacts are solved in a fixed order (see `neighbours`), so an arena moves bit for bit alike alone and
beside others, and distant robots change nothing.
"""

from typing import ClassVar

import numpy as np

from swarmwire.comms.base import math as portable
from swarmwire.comms.base.arrays import AnyArray, BoolArray, FloatArray, IntArray
from swarmwire.comms.base.geometry.obstacle_index import obstacles_within
from swarmwire.world.engines.discs.contacts import fill_contacts, split_by_contact
from swarmwire.world.engines.discs.neighbours import FixedIndex, fixed_near, pairs_near
from swarmwire.world.engines.discs.records import (
    CONTACT_RECORD,
    ROBOT_RECORD,
    DiscBodies,
    Fixed,
    MotionParams,
    NearBodies,
)
from swarmwire.world.engines.discs.step import advance, needed_margin_m
from swarmwire.world.engines.engine import EngineConfig

# Distance that robots may move until near bodies are listed again, in greatest radii; fast robots get a greater margin.
MARGIN = 0.3


def robots_of(config: EngineConfig, arenas: int) -> AnyArray:
    """Return records (arenas x robots,) of robots at rest."""
    motors, step_s = config.motors, config.tick_s / config.steps
    robots = np.zeros(len(config.radius_m), ROBOT_RECORD)
    robots["radius_m"], robots["bottom_m"] = config.radius_m, config.bottom_m
    robots["per_kg"], robots["per_kgm2"] = 1.0 / motors.mass_kg, 1.0 / motors.inertia_kgm2
    robots["max_step_mps"] = motors.max_force_n * step_s / motors.mass_kg
    robots["max_step_radps"] = motors.max_torque_nm * step_s / motors.inertia_kgm2
    robots["half_base_m"] = 0.5 * motors.wheel_base_m
    for column in ("per_kg", "per_kgm2", "max_step_mps", "max_step_radps"):  # nothing changes their speeds
        robots[column][config.followed] = 0.0
    robots["cos"] = 1.0  # `middle_rad` is 0
    return np.tile(robots, arenas)


class DiscsEngine:
    """An `Engine` for robots against robots, walls, and obstacles that stand still."""

    name: ClassVar[str] = "discs"

    def __init__(self, config: EngineConfig, pose: FloatArray) -> None:
        arenas, robots = pose.shape[:2]
        rows, obstacles = arenas * robots, config.obstacles
        self.state: FloatArray = np.zeros((arenas, robots, 6))
        self.state[:, :, :3] = pose
        self.travel_m: FloatArray = np.zeros((arenas, robots, 2))
        self.touched: FloatArray = np.zeros((arenas, robots))
        self.braked: BoolArray = np.zeros((arenas, robots), np.bool_)
        self._config = config
        self._running: BoolArray = np.ones(arenas, np.bool_)
        self._params = MotionParams(
            config.tick_s / config.steps, config.steps, float(config.radius_m.max(initial=0.0)), robots
        )
        self._bodies = DiscBodies(
            robots_of(config, arenas),
            self.state.reshape(rows, 6),
            self.travel_m.reshape(rows, 2),
            self.touched.reshape(rows),
            self.braked.reshape(rows),
        )
        half_size_m = 0.5 * config.size_m[0], 0.5 * config.size_m[1]
        self._fixed = Fixed(half_size_m, obstacles.circle, obstacles.side_start, obstacles.side)
        self._near = NearBodies(0.0, np.zeros(0, CONTACT_RECORD), *(np.zeros(0, np.int64) for _ in range(3)))
        self._set_margin(MARGIN * self._params.max_radius_m)
        self._followed: IntArray = np.flatnonzero(config.followed)
        self._end: FloatArray | None = None  # states of the followed robots at the end of the tick
        self._list_near(0.0)

    def tick(self, target: FloatArray) -> IntArray:
        """Move by one tick towards targets (arenas, robots, 3): see `Engine`."""
        onsets = np.zeros((len(target), 2), np.int64)
        targets, end, step = target.reshape(len(self._bodies.state), 3), self._end, 0
        if end is not None:
            targets = self._start_followed(end, target).reshape(targets.shape)
        while True:
            step, fastest_mps = advance(step, self._params, self._bodies, targets, self._near, self._fixed, onsets)
            if step == self._params.steps:
                if end is not None:
                    self.state[self._of_running] = end[self._running]
                return onsets
            self._list_near(fastest_mps)

    def follow(self, end: FloatArray) -> None:
        """Set the states of the followed robots at the end of the next tick, (arenas, k, 6)."""
        self._end = end

    def set_states(self, states: FloatArray) -> None:
        """Set the states of the followed robots at once, (arenas, k, 6)."""
        self.state[:, self._followed] = states
        self._list_near(0.0)

    @property
    def _of_running(self) -> tuple[AnyArray, ...]:
        """The index of the followed robots of running arenas in `state`."""
        return np.ix_(np.flatnonzero(self._running), self._followed)

    def _start_followed(self, end: FloatArray, target: FloatArray) -> FloatArray:
        """Give the followed robots their velocities, and return the targets (arenas, robots, 3) with their speeds."""
        target, velocity = target.copy(), end[self._running][:, :, 3:]
        self.state[:, :, 3:][self._of_running] = velocity
        robots = self._bodies.robots.reshape(self.touched.shape)
        robots["unhindered_radps"][self._of_running] = velocity[:, :, 2]
        target[:, :, 0][self._of_running] = portable.hypot(velocity[:, :, 0], velocity[:, :, 1])
        return target

    def apply_impulse(self, by_mps: FloatArray) -> None:
        """Add to the velocities of robots at once, (arenas, robots, 2) in m/s."""
        self.state[:, :, 3:5] += by_mps

    def leave(self, over: BoolArray) -> None:
        """Stop the arenas `over` (arenas,): nothing in them is listed, so nothing moves or touches."""
        self._running &= ~over
        self._list_near(0.0)

    def _set_margin(self, margin_m: float) -> None:
        self._margin_m = margin_m
        # The cell of a robot's centre lists the obstacles that its rim may reach.
        config, reach_m = self._config, self._params.max_radius_m + margin_m
        cells = obstacles_within(config.obstacles, config.size_m, reach_m, torus=False).cells
        tops_m = config.obstacles.circle_top_m, config.obstacles.polygon_top_m
        self._index = FixedIndex(self._fixed, config.boundary == "walls", *tops_m, cells)

    def _list_near(self, fastest_mps: float) -> None:
        """List the bodies near each robot, with a margin that lasts for at least one tick."""
        max_radius_m = self._params.max_radius_m
        needed_m = needed_margin_m(fastest_mps, max_radius_m, self._params.dt_s, self._params.steps)
        if needed_m > self._margin_m:
            self._set_margin(1.5 * needed_m)
        robots, state, margin_m = self._bodies.robots, self._bodies.state, self._margin_m
        pairs = pairs_near(robots, state, self._running, self._config.size_m, max_radius_m, margin_m)
        fixed_pairs = fixed_near(robots, state, self._running, self._index, margin_m)
        if len(self._followed):  # contacts need a robot that gives way
            moves = robots["per_kg"] > 0.0
            pairs, fixed_pairs = pairs[moves[pairs].any(axis=1)], fixed_pairs[moves[fixed_pairs[:, 0]]]
        contacts = np.zeros(len(pairs) + len(fixed_pairs), CONTACT_RECORD)
        fill_contacts(contacts, robots, pairs, fixed_pairs, self._near.contacts)
        moving = np.repeat(self._running, self._params.per_arena)
        self._near = NearBodies(
            margin_m, contacts, np.zeros(len(contacts), np.int64), *split_by_contact(moving, contacts)
        )
        robots["listed_x_m"], robots["listed_y_m"] = state[:, 0], state[:, 1]
