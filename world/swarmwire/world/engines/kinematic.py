"""The kinematic engine: no forces, and no contacts between robots. All arenas in one compiled call.

A robot has its target's speed from the start of a tick on and runs the exact arc; masses and forces play no part. It
slides along walls and along obstacles that reach above its lower side, and flies over lower obstacles. Robots pass
through one another; two robots that begin to overlap at the end of a tick count as a contact that began. On a torus
positions wrap and velocities continue.
"""

# pyright: basic, reportUnknownMemberType=false

from typing import ClassVar, NamedTuple

import numpy as np

from swarmwire.comms.base import math as portable
from swarmwire.comms.base.arrays import BoolArray, FloatArray, IntArray
from swarmwire.comms.base.geometry.robot_index import grid_over
from swarmwire.comms.base.kernels import kernel
from swarmwire.comms.base.math import compiled as math_compiled
from swarmwire.world.engines.contacts import count_began, mark
from swarmwire.world.engines.engine import EngineConfig
from swarmwire.world.engines.position_correction import (
    Discs,
    PositionCorrections,
    any_near,
    overlaps,
    push_out,
    shortest,
)

CELLS_PER_ROBOT = 4
SUBSTEP_RADII = 0.25  # the greatest move at once near obstacles, in radii: robots do not jump over them


class KinematicBodies(NamedTuple):
    """The robots of all arenas, written in place."""

    discs: Discs
    wheel_base_m: FloatArray  # (n,)
    running: BoolArray  # (arenas,)
    state: FloatArray  # (arenas, n, 6)
    travel_m: FloatArray  # (arenas, n, 2)
    pushed: BoolArray  # (arenas, n) True for robots that something fixed pushed in the tick


class KinematicEngine:
    """The bodies of all arenas; see `Engine`."""

    name: ClassVar[str] = "kinematic"

    def __init__(self, config: EngineConfig, pose: FloatArray) -> None:
        """Make bodies at rest at `pose` (arenas, n, 3)."""
        arenas, n = pose.shape[:2]
        self.state = np.zeros((arenas, n, 6))
        self.state[:, :, :3] = pose
        self.travel_m = np.zeros((arenas, n, 2))
        self.touched = np.zeros((arenas, n))
        self.braked: BoolArray = np.zeros((arenas, n), np.bool_)
        self._tick_s = config.tick_s
        self._corrections = PositionCorrections(config)
        per_robot_m = float(np.sqrt(config.size_m[0] * config.size_m[1] / (CELLS_PER_ROBOT * n)))
        cell_m = max(2.0 * float(config.radius_m.max()), per_robot_m)
        self._cells = grid_over(config.size_m, cell_m, arenas, arenas * n)
        self._bodies = KinematicBodies(
            Discs(config.radius_m, config.bottom_m, config.top_m),
            config.motors.wheel_base_m,
            np.ones(arenas, np.bool_),
            self.state,
            self.travel_m,
            np.zeros((arenas, n), np.bool_),
        )
        self._touching = np.empty(0, np.int64)
        self._followed: IntArray = np.flatnonzero(config.followed)
        self._fixed: BoolArray = np.append(config.followed, True)  # bodies by number in `overlaps`
        self._end: FloatArray | None = None  # states of the followed robots at the end of the tick

    def tick(self, target: FloatArray) -> IntArray:
        """Move by one tick at targets (arenas, n, 3), and count the contacts that began, (arenas, 2)."""
        bodies = self._bodies
        if self._end is not None and len(self._followed) == target.shape[1]:  # nothing else moves, no contact counts
            _set_followed(bodies, self._followed, self._end, self._tick_s)
            return np.zeros((len(target), 2), np.int64)
        path_m = self._tick_s * float(portable.hypot(target[:, :, 0], target[:, :, 2]).max())
        correction = self._corrections.within(float(bodies.discs.radius_m.max()) + path_m)
        _move(correction, bodies, target, self._tick_s)
        if self._end is not None:
            _set_followed(bodies, self._followed, self._end, self._tick_s)
        overlapping = overlaps(bodies.state, bodies.discs, bodies.pushed, bodies.running, correction, self._cells)
        if len(self._followed):
            first, second = overlapping // len(self._fixed) % len(self._fixed), overlapping % len(self._fixed)
            overlapping = overlapping[~(self._fixed[first] & self._fixed[second])]
        overlapping_before, self._touching = self._touching, overlapping
        onsets = np.zeros((len(target), 2), np.int64)
        count_began(self._touching, overlapping_before, target.shape[1] + 1, onsets)
        mark(self._touching, self.touched)
        return onsets

    def follow(self, end: FloatArray) -> None:
        """Set the states of the followed robots at the end of the next tick, (arenas, k, 6)."""
        self._end = end

    def set_states(self, states: FloatArray) -> None:
        """Set the states of the followed robots at once, (arenas, k, 6)."""
        self.state[:, self._followed] = states

    def apply_impulse(self, by_mps: FloatArray) -> None:
        """Raise TypeError: this engine has no forces. Validation refuses scenarios with impulses for it."""
        raise TypeError("the kinematic engine knows no forces")

    def leave(self, over: BoolArray) -> None:
        """Stop the arenas `over` (arenas,): nothing in them moves or touches."""
        self._bodies.running[:] &= ~over


@kernel(from_python=True)
def _set_followed(bodies, followed, end, tick_s):
    """Set followed robots of running arenas to the states `end`, and add the way to the travel of their wheels."""
    for arena in range(len(end)):
        for k in range(len(followed) if bodies.running[arena] else 0):
            i, then = followed[k], end[arena, k]
            middle = then[2] - 0.5 * tick_s * then[5]
            rolled = tick_s * (then[3] * math_compiled.cos(middle) + then[4] * math_compiled.sin(middle))
            turned = 0.5 * tick_s * then[5] * bodies.wheel_base_m[i]
            bodies.travel_m[arena, i, 0] += rolled - turned
            bodies.travel_m[arena, i, 1] += rolled + turned
            bodies.pushed[arena, i] = False
            for column in range(6):
                bodies.state[arena, i, column] = then[column]


@kernel(from_python=True)
def _move(correction, bodies, target, tick_s):
    for arena in range(target.shape[0]):
        if not bodies.running[arena]:
            continue
        for i in range(target.shape[1]):
            forward, turn, left = target[arena, i, 0], target[arena, i, 1], target[arena, i, 2]
            disc = bodies.discs.radius_m[i], bodies.discs.bottom_m[i]
            speeds = forward, turn, left
            rolled, bodies.pushed[arena, i] = _move_robot(
                correction, arena, disc, speeds, tick_s, bodies.state[arena, i]
            )
            turned = 0.5 * tick_s * turn * bodies.wheel_base_m[i]
            bodies.travel_m[arena, i, 0] += rolled - turned
            bodies.travel_m[arena, i, 1] += rolled + turned


@kernel()
def _move_robot(correction, arena, disc, speeds, tick_s, state):
    """Move the state (6,) of one robot of this radius and lower side, `disc`, to the end of the tick.

    Returns:
        The distance that it rolled forward, and True if it was pushed.
    """
    radius_m, bottom_m = disc
    forward, turn, left = speeds
    x, y, heading = state[0], state[1], state[2]
    path_m = tick_s * np.sqrt(forward * forward + left * left)
    near = any_near(correction, arena, x, y, radius_m + path_m, bottom_m)
    substeps = max(int(np.ceil(path_m / (SUBSTEP_RADII * radius_m))), 1) if near else 1
    substep_s = tick_s / substeps
    half = 0.5 * turn * substep_s
    chord_s = (
        substep_s * math_compiled.sin(half) / half if half != 0.0 else substep_s
    )  # a chord is shorter than its arc
    vx = vy = rolled = 0.0
    was_pushed = False
    for _ in range(substeps):
        cos, sin = math_compiled.cos(heading + half), math_compiled.sin(heading + half)
        dx, dy = (forward * cos - left * sin) * chord_s, (forward * sin + left * cos) * chord_s
        nx, ny, pushed, free = x + dx, y + dy, False, True
        outside = abs(nx) + radius_m > correction.half_x_m or abs(ny) + radius_m > correction.half_y_m
        if near or (correction.walled and outside):
            nx, ny, pushed, free = push_out(correction, arena, nx, ny, radius_m, bottom_m, near)
        if not free:  # wedged in
            nx, ny = x, y
        rolled += forward * substep_s + (nx - x - dx) * cos + (ny - y - dy) * sin
        heading += 2.0 * half
        cos, sin = math_compiled.cos(heading), math_compiled.sin(heading)
        vx, vy = forward * cos - left * sin, forward * sin + left * cos
        if pushed:
            vx, vy, was_pushed = (nx - x) / substep_s, (ny - y) / substep_s, True
        x, y = nx, ny
    state[0], state[1] = (
        shortest(x, correction.half_x_m, correction.wraps),
        shortest(y, correction.half_y_m, correction.wraps),
    )
    state[2], state[3], state[4], state[5] = heading, vx, vy, turn
    return rolled, was_pushed
