"""How motors change a robot's velocity in a step, and how it then moves. Compiled.

Velocity first, then place (semi-implicit Euler). What motors can do: see `engines.pymunk_drive`, a bounded change of
velocity towards the target. The target lies along the heading in the middle of the step to come, so that the path of a
turning robot is made of chords of its arc.
"""

# pyright: basic, reportUnknownMemberType=false

import numpy as np

from swarmwire.comms.kernels import borrowing
from swarmwire.world.engines.sine_cosine import sine_cosine


@borrowing()
def drive(robot, now, target, braked, dt_s):
    """Let the motors of a robot push its velocity towards its target for a step.

    What contacts took from the turn rate in the last step is made up for in this one, so that a robot pushed off its
    centre keeps its heading as long as its torque lasts; one that is braked slows a turn down but does not undo it.

    Args:
        robot: its ROBOT.
        now: (6,) its state.
        target: (3,) forward m/s, left turn rad/s, to the left m/s.
        braked: whether its motors only resist.
        dt_s: length of a step.
    """
    robot.driven = target[0] != 0.0 or target[1] != 0.0 or target[2] != 0.0
    turn = now[5]
    taken = 0.0 if braked else robot.unhindered_radps - turn
    turn += min(max(target[1] - turn + taken, -robot.most_radps), robot.most_radps)
    now[5] = robot.unhindered_radps = turn
    look_along(robot, now, dt_s)
    cos, sin = robot.cos, robot.sin
    dx, dy = target[0] * cos - target[2] * sin - now[3], target[0] * sin + target[2] * cos - now[4]
    size2 = dx * dx + dy * dy
    if size2 > robot.most_mps * robot.most_mps:
        share = robot.most_mps / np.sqrt(size2)
        dx, dy = dx * share, dy * share
    now[3] += dx
    now[4] += dy


@borrowing()
def look_along(robot, now, dt_s):
    """Set `cos` and `sin` of a robot to those of its heading in the middle of the step to come."""
    middle = now[2] + 0.5 * dt_s * now[5]
    if middle != robot.middle_rad:  # one that drives straight on is spared half of the cost of a step
        robot.middle_rad = middle
        robot.sin, robot.cos = sine_cosine(middle)


@borrowing()
def move(robot, now, travel_m, dt_s):
    """Move state (6,) by one step of its velocity and add to travel (2,) what its wheels roll."""
    if now[5] != robot.unhindered_radps:
        look_along(robot, now, dt_s)
    rolled = dt_s * (now[3] * robot.cos + now[4] * robot.sin)
    apart = dt_s * now[5] * robot.half_base_m
    travel_m[0] += rolled - apart
    travel_m[1] += rolled + apart
    now[0] += dt_s * now[3]
    now[1] += dt_s * now[4]
    now[2] += dt_s * now[5]


@borrowing()
def follow_targets(rows, steps, dt_s, robots, state, target, braked, travel_m):
    """Move robots that nothing is near by some steps, one robot after the other."""
    for row in rows:
        for _ in range(steps):
            drive(robots[row], state[row], target[row], braked[row], dt_s)
            move(robots[row], state[row], travel_m[row], dt_s)
