"""What the array engine keeps of each robot, a record per row: row = arena x robots + index."""

import numpy as np

from swarmwire.comms.arrays import AnyArray
from swarmwire.world.engines.engine import Setting

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


def robots_of(setting: Setting, arenas: int) -> AnyArray:
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
