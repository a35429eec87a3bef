"""What the array engine knows of each robot, a record per row: row = arena x robots + index."""

import numpy as np

from swarmwire.comms.arrays import AnyArray, FloatArray
from swarmwire.world.drive import Motors

ROBOT = np.dtype(
    [
        ("radius_m", np.float64),
        ("bottom_m", np.float64),
        ("per_kg", np.float64),  # one over its mass
        ("per_kgm2", np.float64),  # one over its moment of inertia
        ("most_mps", np.float64),  # by so much its motors can change its velocity in one step
        ("most_radps", np.float64),  # and its turn rate
        ("half_base_m", np.float64),  # from the middle to a wheel
    ]
)


def robots_of(arenas: int, radius_m: FloatArray, bottom_m: FloatArray, motors: Motors, step_s: float) -> AnyArray:
    """Records (arenas x robots,) of robots that are alike in every arena, (robots,) each."""
    robots = np.zeros(len(radius_m), ROBOT)
    robots["radius_m"], robots["bottom_m"] = radius_m, bottom_m
    robots["per_kg"], robots["per_kgm2"] = 1.0 / motors.mass_kg, 1.0 / motors.inertia_kgm2
    robots["most_mps"] = motors.max_force_n * step_s / motors.mass_kg
    robots["most_radps"] = motors.max_torque_nm * step_s / motors.inertia_kgm2
    robots["half_base_m"] = 0.5 * motors.wheel_base_m
    return np.tile(robots, arenas)
