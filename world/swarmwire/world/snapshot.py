"""What the world shows of its bodies once they have moved. Compiled."""

# pyright: basic, reportUnknownMemberType=false

import numpy as np
from numba import njit

from swarmwire.comms.arrays import FloatArray

LOWEST = np.nextafter(-np.pi, 0.0)


@njit(cache=True)
def snapshot(state: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Poses and velocities, (rows, 3) each, of a state (arenas, robots, 6); headings as `angles.wrapped` has them."""
    arenas, robots = state.shape[:2]
    pose, velocity = np.empty((arenas * robots, 3)), np.empty((arenas * robots, 3))
    for arena in range(arenas):
        for i in range(robots):
            row, heading = arena * robots + i, state[arena, i, 2]
            if not -np.pi < heading <= np.pi:
                heading -= 2.0 * np.pi * np.ceil((heading - np.pi) / (2.0 * np.pi))
                heading = min(max(heading, LOWEST), np.pi)
            pose[row, 0], pose[row, 1], pose[row, 2] = state[arena, i, 0], state[arena, i, 1], heading
            for column in range(3):
                velocity[row, column] = state[arena, i, 3 + column]
    return pose, velocity
