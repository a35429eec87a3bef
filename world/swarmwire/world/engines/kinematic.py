"""Bodies that go where they are told: no forces, and no contacts between robots. All arenas in one compiled call.

A robot has its target's speed from the start of a tick on and runs the exact arc; masses and the drive's forces play no
part. Walls, and obstacles that reach above its lower side, hold it back: it slides along them; lower ones it flies
over.
Robots pass through one another; where two begin to overlap at the end of a tick, that counts as a contact that began.
On a torus positions wrap, velocities go on.
"""

# pyright: basic, reportUnknownMemberType=false

from typing import ClassVar

import numpy as np

from swarmwire.comms.arrays import BoolArray, FloatArray, IntArray
from swarmwire.comms.kernels import kernel
from swarmwire.world.engines.contacts import count_began, mark
from swarmwire.world.engines.engine import EngineConfig
from swarmwire.world.engines.position_correction import PositionCorrections, any_near, held_back, overlaps, shortest

PIECE_OF_RADIUS = 0.25  # near obstacles a tick's way is gone in pieces of so much of the radius, so none is jumped over


class KinematicEngine:
    """The bodies of all arenas; see `Engine`."""

    name: ClassVar[str] = "kinematic"

    def __init__(self, setting: EngineConfig, pose: FloatArray) -> None:
        """Bodies at rest at `pose` (arenas, n, 3)."""
        arenas, n = pose.shape[:2]
        self.state = np.zeros((arenas, n, 6))
        self.state[:, :, :3] = pose
        self.travel_m = np.zeros((arenas, n, 2))
        self.touched = np.zeros((arenas, n))
        self.braked: BoolArray = np.zeros((arenas, n), np.bool_)
        self._tick_s, self._wheel_base_m = setting.tick_s, setting.motors.wheel_base_m
        self._disc = setting.radius_m, setting.bottom_m, setting.top_m
        self._hindrances = PositionCorrections(setting)
        self._running: BoolArray = np.ones(arenas, np.bool_)
        self._held: BoolArray = np.zeros((arenas, n), np.bool_)
        self._touching = np.empty(0, np.int64)

    def tick(self, target: FloatArray) -> IntArray:
        """Move by one tick at targets (arenas, n, 3), and count the contacts that began, (arenas, 2)."""
        radius_m, bottom_m, _ = self._disc
        bodies = self._wheel_base_m, radius_m, bottom_m
        way_m = self._tick_s * float(np.hypot(target[:, :, 0], target[:, :, 2]).max())
        around = self._hindrances.within(float(radius_m.max()) + way_m)
        _move(around, *bodies, target, self._tick_s, self._running, self.state, self.travel_m, self._held)
        now = overlaps(self.state, *self._disc, self._held, self._running, around)
        before, self._touching = self._touching, now
        onsets = np.zeros((len(target), 2), np.int64)
        count_began(self._touching, before, target.shape[1] + 1, onsets)
        mark(self._touching, self.touched)
        return onsets

    def apply_impulse(self, by_mps: FloatArray) -> None:
        """TypeError: bodies that go where they are told cannot be pushed, and scenarios that ask for it are refused."""
        raise TypeError("the kinematic engine knows no forces")

    def leave(self, over: BoolArray) -> None:
        """Nothing in these arenas (arenas,) moves or touches any more."""
        self._running &= ~over


@kernel(from_python=True)
def _move(around, wheel_base_m, radius_m, bottom_m, target, tick_s, running, state, travel_m, held):
    for arena in range(target.shape[0]):
        if not running[arena]:
            continue
        for i in range(target.shape[1]):
            forward, turn, left = target[arena, i, 0], target[arena, i, 1], target[arena, i, 2]
            size = radius_m[i], bottom_m[i]
            rolled, held[arena, i] = _go(around, arena, size, forward, turn, left, tick_s, state[arena, i])
            apart = 0.5 * tick_s * turn * wheel_base_m[i]
            travel_m[arena, i, 0] += rolled - apart
            travel_m[arena, i, 1] += rolled + apart


@kernel()
def _go(around, arena, size, forward, turn, left, tick_s, state):
    """Bring the state (6,) of one robot of this radius and height to the end of the tick.

    Returns how far it rolled forward, and whether something held it back.
    """
    radius_m, bottom_m = size
    x, y, heading = state[0], state[1], state[2]
    way_m = tick_s * np.sqrt(forward * forward + left * left)
    near = any_near(around, arena, x, y, radius_m + way_m, bottom_m)
    pieces = max(int(np.ceil(way_m / (PIECE_OF_RADIUS * radius_m))), 1) if near else 1
    piece_s = tick_s / pieces
    half = 0.5 * turn * piece_s
    chord_s = piece_s * np.sin(half) / half if half != 0.0 else piece_s  # a chord is shorter than its arc
    vx = vy = rolled = 0.0
    stopped = False
    for _ in range(pieces):
        cos, sin = np.cos(heading + half), np.sin(heading + half)
        dx, dy = (forward * cos - left * sin) * chord_s, (forward * sin + left * cos) * chord_s
        nx, ny, pushed, free = x + dx, y + dy, False, True
        out = abs(nx) + radius_m > around.half_x_m or abs(ny) + radius_m > around.half_y_m
        if near or (around.walled and out):
            nx, ny, pushed, free = held_back(around, arena, nx, ny, radius_m, bottom_m, near)
        if not free:  # wedged in
            nx, ny = x, y
        rolled += forward * piece_s + (nx - x - dx) * cos + (ny - y - dy) * sin
        heading += 2.0 * half
        cos, sin = np.cos(heading), np.sin(heading)
        vx, vy = forward * cos - left * sin, forward * sin + left * cos
        if pushed:
            vx, vy, stopped = (nx - x) / piece_s, (ny - y) / piece_s, True
        x, y = nx, ny
    state[0], state[1] = shortest(x, around.half_x_m, around.wraps), shortest(y, around.half_y_m, around.wraps)
    state[2], state[3], state[4], state[5] = heading, vx, vy, turn
    return rolled, stopped
