"""Drives by bounded force in pymunk's bodies: what motors and the grip of wheels can do in one physics step. Compiled.

Velocities are never written: a motor pushes until its robot has the speed asked for or its force is spent, so contacts
keep the last word. Along and across the body the wheels share one grip (a friction circle of `max_force_n`, as ARGoS
bounds the length of its pivot's impulse), and turning has a bound of its own, `max_torque_nm`. A holonomic drive
differs only in that it may be asked for a speed across the body.
"""

# pyright: basic, reportUnknownMemberType=false

import numpy as np
from numba import njit

from swarmwire.comms.arrays import BoolArray, FloatArray
from swarmwire.world.engines.motors import Motors


@njit(cache=True)
def push(
    motors: Motors,
    target: FloatArray,
    state: FloatArray,
    dt_s: float,
    running: BoolArray,
    force: FloatArray,
    travel_m: FloatArray,
    unhindered: FloatArray,
) -> None:
    """Set the force on every robot for the physics step to come, and add what its wheels roll in that step.

    Pymunk moves a body by the velocity that it has before the step and then applies the force, so a force set now shows
    in the motion of the step after. There the body turns while it moves straight: the velocity to reach lies along the
    heading in the middle of that step, which makes the path a chord of the arc.

    What contacts took from the turn rate in the last step is made up for in this one: a robot that is pushed off its
    centre keeps its heading as long as its torque lasts, where the motors alone would answer each push a step too late.
    Nothing of the kind is done for the force: at the end of a contact it would throw the robot forward for a step.

    Args:
        motors: of each robot index.
        target: (arenas, robots, 3) forward m/s, left turn rad/s, to the left m/s.
        state: (arenas, robots, 6) x, y in m, heading in rad, velocity in m/s, m/s, rad/s, arena frame.
        dt_s: length of a physics step.
        running: (arenas,) rows of others stay as they are.
        force: (arenas, robots or more, 3) set: N, N, N m, arena frame; rows beyond the robots stay as they are.
        travel_m: (arenas, robots, 2) left and right wheel, added to.
        unhindered: (arenas, robots) turn rate that the last torque would have given without contacts, set.
    """
    arenas, robots = state.shape[:2]
    for arena in range(arenas):
        if not running[arena]:
            continue
        for i in range(robots):
            heading, vx, vy, turn = state[arena, i, 2], state[arena, i, 3], state[arena, i, 4], state[arena, i, 5]
            middle = heading + 0.5 * dt_s * turn
            rolled = dt_s * (vx * np.cos(middle) + vy * np.sin(middle))
            apart = 0.5 * dt_s * turn * motors.wheel_base_m[i]
            travel_m[arena, i, 0] += rolled - apart
            travel_m[arena, i, 1] += rolled + apart

            bound = motors.max_torque_nm[i]
            inertia = motors.inertia_kgm2[i]
            taken = unhindered[arena, i] - turn
            torque = min(max((target[arena, i, 1] - turn + taken) * inertia / dt_s, -bound), bound)
            unhindered[arena, i] = turn + torque * dt_s / inertia
            ahead = heading + dt_s * (turn + 0.5 * unhindered[arena, i])
            cos, sin, per_step = np.cos(ahead), np.sin(ahead), motors.mass_kg[i] / dt_s
            forward, left = target[arena, i, 0], target[arena, i, 2]
            fx, fy = (forward * cos - left * sin - vx) * per_step, (forward * sin + left * cos - vy) * per_step
            size = np.sqrt(fx * fx + fy * fy)
            share = motors.max_force_n[i] / size if size > motors.max_force_n[i] else 1.0
            force[arena, i, 0], force[arena, i, 1], force[arena, i, 2] = fx * share, fy * share, torque
