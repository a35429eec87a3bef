"""The discs engine: one compiled call moves the round robots of all arenas through all steps of a tick.

The engine keeps a ROBOT record per row, where row = arena x robots + index. Rows of different arenas are never near
each other, and contacts are solved in a fixed order (see `neighbours`), so an arena moves bit for bit alike alone and
beside others, and distant robots change nothing.
"""

from typing import ClassVar

import numpy as np

from swarmwire.comms.base.arrays import AnyArray, BoolArray, FloatArray, IntArray
from swarmwire.comms.base.geometry.obstacle_index import obstacles_within
from swarmwire.world.engines.discs.contacts import CONTACT, contact_islands, contacts_of
from swarmwire.world.engines.discs.neighbours import fixed_near, pairs_near
from swarmwire.world.engines.discs.step import advance, needed_margin_m
from swarmwire.world.engines.engine import EngineConfig

# How far robots may move until near things are listed anew, in greatest radii; fast robots get a greater margin.
MARGIN = 0.3

ROBOT = np.dtype(
    [
        # constants
        ("radius_m", np.float64),
        ("bottom_m", np.float64),
        ("per_kg", np.float64),  # one over its mass
        ("per_kgm2", np.float64),  # one over its moment of inertia
        ("max_step_mps", np.float64),  # the greatest change of its velocity by its motors in one step
        ("max_step_radps", np.float64),  # and of its turn rate
        ("half_base_m", np.float64),  # from the middle to a wheel
        # motion
        ("driven", np.int64),  # DRIVEN: its target is not zero; less: driven robots push it; 0: neither
        ("unhindered_radps", np.float64),  # the turn rate that its motors gave it in the last step
        ("middle_rad", np.float64),  # its heading in the middle of the step, and of that
        ("cos", np.float64),
        ("sin", np.float64),
        ("shift_x_m", np.float64),  # by which it is moved out of overlaps
        ("shift_y_m", np.float64),
        ("listed_x_m", np.float64),  # its place when near things were listed
        ("listed_y_m", np.float64),
        ("against_fixed", np.int64),  # whether it touches anything fixed: bits as of a contact
    ]
)


def robots_of(config: EngineConfig, arenas: int) -> AnyArray:
    """Records (arenas x robots,) of robots at rest."""
    motors, step_s = config.motors, config.tick_s / config.steps
    robots = np.zeros(len(config.radius_m), ROBOT)
    robots["radius_m"], robots["bottom_m"] = config.radius_m, config.bottom_m
    robots["per_kg"], robots["per_kgm2"] = 1.0 / motors.mass_kg, 1.0 / motors.inertia_kgm2
    robots["max_step_mps"] = motors.max_force_n * step_s / motors.mass_kg
    robots["max_step_radps"] = motors.max_torque_nm * step_s / motors.inertia_kgm2
    robots["half_base_m"] = 0.5 * motors.wheel_base_m
    robots["cos"] = 1.0  # of the heading 0 in `middle_rad`
    return np.tile(robots, arenas)


class DiscsEngine:
    """An `Engine` for robots against robots, walls, and obstacles that stand still."""

    name: ClassVar[str] = "discs"

    def __init__(self, config: EngineConfig, pose: FloatArray) -> None:
        arenas, robots = pose.shape[:2]
        self._config = config
        self.state: FloatArray = np.zeros((arenas, robots, 6))
        self.state[:, :, :3] = pose
        self.travel_m: FloatArray = np.zeros((arenas, robots, 2))
        self.touched: FloatArray = np.zeros((arenas, robots))
        self.braked: BoolArray = np.zeros((arenas, robots), np.bool_)
        self._running: BoolArray = np.ones(arenas, np.bool_)
        self._robots = robots_of(config, arenas)
        self._max_radius_m = float(config.radius_m.max(initial=0.0))
        self._contacts = np.zeros(0, CONTACT)
        self._set_margin(MARGIN * self._max_radius_m)
        self._list_near(0.0)

    def tick(self, target: FloatArray) -> IntArray:
        """Move by one tick towards targets (arenas, robots, 3): see `Engine`."""
        arenas, per_arena = self.touched.shape
        onsets = np.zeros((arenas, 2), np.int64)
        config, rows, obstacles = self._config, arenas * per_arena, self._config.obstacles
        step_s, half_size_m = config.tick_s / config.steps, (0.5 * config.size_m[0], 0.5 * config.size_m[1])
        step = 0
        while True:
            step, fastest_mps = advance(
                step, config.steps, step_s, self._margin_m, self._max_radius_m, half_size_m, per_arena,
                self._robots, self.state.reshape(rows, 6), self.travel_m.reshape(rows, 2), self.touched.reshape(rows),
                self.braked.reshape(rows), target.reshape(rows, 3), self._contacts, self._met,
                self._contacting, self._isolated, obstacles.circle, obstacles.side_start, obstacles.side,
                onsets,
            )  # fmt: skip
            if step == config.steps:
                return onsets
            self._list_near(fastest_mps)

    def apply_impulse(self, by_mps: FloatArray) -> None:
        """Add to the velocities of robots at once, (arenas, robots, 2) in m/s."""
        self.state[:, :, 3:5] += by_mps

    def leave(self, over: BoolArray) -> None:
        """Nothing in these arenas (arenas,) moves or touches any more: nothing there is listed."""
        self._running &= ~over
        self._list_near(0.0)

    def _set_margin(self, margin_m: float) -> None:
        self._margin_m = margin_m
        # The cell of a robot's middle lists what its rim may reach.
        config, reach_m = self._config, self._max_radius_m + margin_m
        self._cells = obstacles_within(config.obstacles, config.size_m, reach_m, torus=False).cells

    def _list_near(self, fastest_mps: float) -> None:
        """List the things near each robot, with a margin that lasts for at least one tick."""
        config, (arenas, per_arena) = self._config, self.touched.shape
        step_s = config.tick_s / config.steps
        needed_m = needed_margin_m(fastest_mps, self._max_radius_m, step_s, config.steps)
        if needed_m > self._margin_m:
            self._set_margin(1.5 * needed_m)
        robots, state, margin_m = self._robots, self.state.reshape(arenas * per_arena, 6), self._margin_m
        pairs = pairs_near(robots, state, self._running, config.size_m, self._max_radius_m, margin_m)
        surroundings = config.size_m, config.boundary == "walls", config.obstacles
        things = fixed_near(robots, state, self._running, *surroundings, self._cells, margin_m)
        old, self._contacts = self._contacts, np.zeros(len(pairs) + len(things), CONTACT)
        contacts_of(self._contacts, robots, pairs, things, old)
        self._met = np.zeros(len(self._contacts), np.int64)
        self._contacting, self._isolated = contact_islands(np.repeat(self._running, per_arena), self._contacts)
        robots["listed_x_m"], robots["listed_y_m"] = state[:, 0], state[:, 1]
