"""How motors change a robot's velocity in a step, and how it then moves. Compiled.

Velocity first, then place (semi-implicit Euler). What motors can do is said in `world.drive`: a bounded change of
velocity towards the target. The target lies along the heading in the middle of the step to come, so that the path of a
turning robot is made of chords of its arc.
"""

# pyright: basic, reportUnknownMemberType=false

import numpy as np
from numba import njit


@njit(cache=True)
def driven(robot, target, braked, dt_s, now, unhindered_radps):
    """Velocity of a robot after its motors pushed.

    What contacts took from the turn rate in the last step is made up for in this one, so that a robot pushed off its
    centre keeps its heading as long as its torque lasts; one that is braked slows a turn down but does not undo it.

    Args:
        robot: its ROBOT.
        target: (3,) forward m/s, left turn rad/s, to the left m/s.
        braked: whether its motors only resist.
        dt_s: length of a step.
        now: (6,) its state.
        unhindered_radps: the turn rate that its motors gave it in the step before.

    Returns:
        m/s, m/s, rad/s, and the cosine and sine of the heading in the middle of the step.
    """
    turn = now[5]
    taken = 0.0 if braked else unhindered_radps - turn
    turn += min(max(target[1] - turn + taken, -robot.most_radps), robot.most_radps)
    middle = now[2] + 0.5 * dt_s * turn
    cos, sin = np.cos(middle), np.sin(middle)
    vx, vy = now[3], now[4]
    dx, dy = target[0] * cos - target[2] * sin - vx, target[0] * sin + target[2] * cos - vy
    size2 = dx * dx + dy * dy
    if size2 > robot.most_mps * robot.most_mps:
        share = robot.most_mps / np.sqrt(size2)
        dx, dy = dx * share, dy * share
    return vx + dx, vy + dy, turn, cos, sin


@njit(cache=True)
def move(robot, dt_s, now, travel_m, cos, sin):
    """Move state (6,) by one step of its velocity and add to travel (2,) what its wheels roll.

    `cos` and `sin` are of the heading in the middle of the step.
    """
    rolled = dt_s * (now[3] * cos + now[4] * sin)
    apart = dt_s * now[5] * robot.half_base_m
    travel_m[0] += rolled - apart
    travel_m[1] += rolled + apart
    now[0] += dt_s * now[3]
    now[1] += dt_s * now[4]
    now[2] += dt_s * now[5]


@njit(cache=True)
def follow_targets(rows, steps, dt_s, robots, target, braked, state, travel_m, unhindered):
    """Move robots that nothing is near by some steps, one after the other."""
    for row in rows:
        robot, now = robots[row], state[row]
        for _ in range(steps):
            vx, vy, turn, cos, sin = driven(robot, target[row], braked[row], dt_s, now, unhindered[row])
            now[3], now[4], now[5], unhindered[row] = vx, vy, turn, turn
            move(robot, dt_s, now, travel_m[row], cos, sin)
