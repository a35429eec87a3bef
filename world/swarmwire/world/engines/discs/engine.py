"""What the array engine keeps of each robot, a record per row: row = arena x robots + index."""

from typing import ClassVar

import numpy as np

from swarmwire.comms.arrays import AnyArray, BoolArray, FloatArray, IntArray
from swarmwire.world.engines.discs.contacts import CONTACT, contact_islands, contacts_of
from swarmwire.world.engines.discs.neighbours import fixed_near, obstacle_cells, pairs_near
from swarmwire.world.engines.discs.step import advance, needed_margin_m
from swarmwire.world.engines.engine import EngineConfig

ROBOT = np.dtype(
    [
        # what it is
        ("radius_m", np.float64),
        ("bottom_m", np.float64),
        ("per_kg", np.float64),  # one over its mass
        ("per_kgm2", np.float64),  # one over its moment of inertia
        ("most_mps", np.float64),  # by so much its motors can change its velocity in one step
        ("most_radps", np.float64),  # and its turn rate
        ("half_base_m", np.float64),  # from the middle to a wheel
        # how it moves
        ("driven", np.int64),  # 1: it is asked to move, 0: to stand still
        ("unhindered_radps", np.float64),  # the turn rate that its motors gave it in the last step
        ("middle_rad", np.float64),  # its heading in the middle of the step, and of that
        ("cos", np.float64),
        ("sin", np.float64),
        ("shift_x_m", np.float64),  # by which it gives way to what overlaps it
        ("shift_y_m", np.float64),
        ("listed_x_m", np.float64),  # where it was when near things were listed
        ("listed_y_m", np.float64),
        ("against_fixed", np.int64),  # whether it touches anything fixed: bits as of a contact
    ]
)


def robots_of(setting: EngineConfig, arenas: int) -> AnyArray:
    """Records (arenas x robots,) of robots at rest."""
    motors, step_s = setting.motors, setting.tick_s / setting.steps
    robots = np.zeros(len(setting.radius_m), ROBOT)
    robots["radius_m"], robots["bottom_m"] = setting.radius_m, setting.bottom_m
    robots["per_kg"], robots["per_kgm2"] = 1.0 / motors.mass_kg, 1.0 / motors.inertia_kgm2
    robots["most_mps"] = motors.max_force_n * step_s / motors.mass_kg
    robots["most_radps"] = motors.max_torque_nm * step_s / motors.inertia_kgm2
    robots["half_base_m"] = 0.5 * motors.wheel_base_m
    robots["cos"] = 1.0  # of the heading 0 in `middle_rad`
    return np.tile(robots, arenas)


# --- An array engine for round robots: one compiled call moves those of all arenas through all steps of a tick.
#
# Rows of different arenas are never near each other, and contacts are solved in an order of their own (see `near`), so
# an arena moves bit for bit alike alone and beside others, and what is far away changes nothing.


# How far robots may move until near things are listed anew, of the widest radius; their speed may ask for more.
MARGIN = 0.3


class DiscsEngine:
    """An `Engine` for robots against robots, walls, and obstacles that stand still."""

    name: ClassVar[str] = "discs"

    def __init__(self, setting: EngineConfig, pose: FloatArray) -> None:
        arenas, robots = pose.shape[:2]
        self._setting = setting
        self.state: FloatArray = np.zeros((arenas, robots, 6))
        self.state[:, :, :3] = pose
        self.travel_m: FloatArray = np.zeros((arenas, robots, 2))
        self.touched: FloatArray = np.zeros((arenas, robots))
        self.braked: BoolArray = np.zeros((arenas, robots), np.bool_)
        self._running: BoolArray = np.ones(arenas, np.bool_)
        self._robots = robots_of(setting, arenas)
        self._widest_m = float(setting.radius_m.max(initial=0.0))
        self._contacts = np.zeros(0, CONTACT)
        self._set_margin(MARGIN * self._widest_m)
        self._list_near(0.0)

    def tick(self, target: FloatArray) -> IntArray:
        """Move by one tick towards targets (arenas, robots, 3): see `Engine`."""
        arenas, per_arena = self.touched.shape
        onsets = np.zeros((arenas, 2), np.int64)
        setting, rows, obstacles = self._setting, arenas * per_arena, self._setting.obstacles
        step_s, half_size_m = setting.tick_s / setting.steps, (0.5 * setting.size_m[0], 0.5 * setting.size_m[1])
        step = 0
        while True:
            step, fastest_mps = advance(
                step, setting.steps, step_s, self._margin_m, self._widest_m, half_size_m, per_arena,
                self._robots, self.state.reshape(rows, 6), self.travel_m.reshape(rows, 2), self.touched.reshape(rows),
                self.braked.reshape(rows), target.reshape(rows, 3), self._contacts, self._met,
                self._crowd, self._loners, obstacles.circle, obstacles.side_start, obstacles.side,
                onsets,
            )  # fmt: skip
            if step == setting.steps:
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
        self._cells = obstacle_cells(self._setting.obstacles, self._setting.size_m, self._widest_m + margin_m)

    def _list_near(self, fastest_mps: float) -> None:
        """List what is near each robot, with a margin that lasts for a tick at least."""
        setting, (arenas, per_arena) = self._setting, self.touched.shape
        step_s = setting.tick_s / setting.steps
        needed_m = needed_margin_m(fastest_mps, self._widest_m, step_s, setting.steps)
        if needed_m > self._margin_m:
            self._set_margin(1.5 * needed_m)
        robots, state, margin_m = self._robots, self.state.reshape(arenas * per_arena, 6), self._margin_m
        pairs = pairs_near(robots, state, self._running, setting.size_m, self._widest_m, margin_m)
        around = setting.size_m, setting.boundary == "walls", setting.obstacles
        things = fixed_near(robots, state, self._running, *around, self._cells, margin_m)
        old, self._contacts = self._contacts, np.zeros(len(pairs) + len(things), CONTACT)
        contacts_of(self._contacts, robots, pairs, things, old)
        self._met = np.zeros(len(self._contacts), np.int64)
        self._crowd, self._loners = contact_islands(np.repeat(self._running, per_arena), self._contacts)
        robots["listed_x_m"], robots["listed_y_m"] = state[:, 0], state[:, 1]
