"""The high-level commander: takes off, lands, goes to positions and flies uploaded trajectories along polynomials.

Source: crazyflie-firmware src/modules/src/planner.c and crtp_commander_high_level.c: polynomials of seventh degree that
start and end without jerk; after a landing the motors are off.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import comb, factorial
from struct import unpack_from
from typing import Literal, NamedTuple

import numpy as np

from swarmwire.comms.base.angles import wrap_angle
from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.protocols.crazyflie import turned

DEGREE = 7
PIECE_BYTES = 4 * (4 * (DEGREE + 1) + 1)  # float32: the coefficients of x, y, z and yaw, and the duration
# Number of an axis's control points after the first, by the two bits of its type (pptraj_compressed.c).
CONTROL_POINTS = (0, 1, 3, 7)
COMPRESSED_UNITS = np.array([0.001, 0.001, 0.001, np.pi / 1800.0])  # x, y and z in m, yaw in rad


class TrajectoryPoint(NamedTuple):
    """A goal: pose and velocity, each of x, y, z in m and yaw in rad, (4,)."""

    pose: FloatArray
    velocity: FloatArray


class Piece(NamedTuple):
    """A polynomial of the time since its start."""

    duration_s: float
    coefficients: FloatArray  # (4, 8), the constants first

    def at(self, time_s: float) -> TrajectoryPoint:
        """Return the goal at this time."""
        powers = time_s ** np.arange(DEGREE + 1)
        slopes = np.arange(1, DEGREE + 1) * powers[:-1]
        return TrajectoryPoint(self.coefficients @ powers, self.coefficients[:, 1:] @ slopes)


def piece_between(start: TrajectoryPoint, end: TrajectoryPoint, duration_s: float) -> Piece:
    """Return the polynomial from start to end, without acceleration and jerk at its ends."""
    rows = [[_derivative(k, power, t) for power in range(DEGREE + 1)] for t in (0.0, 1.0) for k in range(4)]
    zero = np.zeros(4)
    ends = [start.pose, start.velocity * duration_s, zero, zero, end.pose, end.velocity * duration_s, zero, zero]
    unit_coefficients = np.linalg.solve(np.array(rows), np.array(ends)).T  # duration 1
    return Piece(duration_s, unit_coefficients / duration_s ** np.arange(DEGREE + 1))


def _derivative(order: int, power: int, time: float) -> float:
    return 0.0 if power < order else factorial(power) / factorial(power - order) * time ** (power - order)


def pieces_of(memory: bytes, offset: int, count: int) -> list[Piece] | None:
    """Decode uploaded pieces; None if the memory is too short, or a piece is malformed or without duration."""
    if offset + count * PIECE_BYTES > len(memory) or count == 0:
        return None
    numbers = [unpack_from(f"<{PIECE_BYTES // 4}f", memory, offset + i * PIECE_BYTES) for i in range(count)]
    if not np.isfinite(numbers).all():
        return None
    pieces = [Piece(row[-1], np.array(row[:-1]).reshape(4, DEGREE + 1)) for row in numbers]
    return pieces if all(piece.duration_s > 0.0 for piece in pieces) else None


def compressed_pieces_of(memory: bytes, offset: int) -> list[Piece] | None:
    """Decode a compressed trajectory up to the first piece without a duration; None if the memory ends before.

    The format is the pose at the start (int16: mm, 0.1 degrees), then for each piece its types (2 bits an axis, x
    lowest), its duration (uint16, ms) and the Bezier control points of x, y, z and yaw. The first control point is the
    end of the piece before, and omitted.
    """
    pieces: list[Piece] = []
    if offset + 8 > len(memory):
        return None
    start, offset = np.array(unpack_from("<4h", memory, offset)) * COMPRESSED_UNITS, offset + 8
    while offset + 3 <= len(memory):
        types, duration_ms = unpack_from("<BH", memory, offset)
        counts = [CONTROL_POINTS[types >> 2 * axis & 3] for axis in range(4)]
        offset += 3
        if duration_ms == 0:
            return pieces or None
        if offset + 2 * sum(counts) > len(memory):
            return None
        values = np.split(np.frombuffer(memory, "<i2", sum(counts), offset), np.cumsum(counts)[:-1])
        offset += 2 * sum(counts)
        coefficients, end = np.zeros((4, DEGREE + 1)), start.copy()
        for axis, later_points in enumerate(values):
            points = np.append(start[axis], COMPRESSED_UNITS[axis] * later_points)
            coefficients[axis, : len(points)] = bezier_coefficients(points, 0.001 * duration_ms)
            end[axis] = points[-1]
        pieces.append(Piece(0.001 * duration_ms, coefficients))
        start = end
    return None


def bezier_coefficients(points: FloatArray, duration_s: float) -> FloatArray:
    """Return the coefficients (n + 1,) in time, the constant first, of a Bezier curve with n + 1 control points.

    The coefficient of time^j is C(n, j) x j-th difference of the first points / duration^j (pptraj.c: polybezier).

    >>> bezier_coefficients(np.array([1.0, 3.0]), 4.0).tolist()
    [1.0, 0.5]
    """
    n = len(points) - 1
    return np.array([comb(n, j) * np.diff(points, j)[0] / duration_s**j for j in range(n + 1)])


@dataclass(frozen=True)
class Trajectory:
    """Consecutive pieces, stretched in time by `stretch`, rotated about the origin, then shifted."""

    pieces: Sequence[Piece]
    start_s: float
    stretch: float = 1.0
    is_reversed: bool = False
    turn_rad: float = 0.0
    shift: FloatArray | None = None  # (4,)

    @property
    def duration_s(self) -> float:
        """Time from start to end."""
        return self.stretch * sum(piece.duration_s for piece in self.pieces)

    def at(self, time_s: float) -> TrajectoryPoint:
        """Return the goal at this time; after the end, the last pose at rest."""
        total_s = sum(piece.duration_s for piece in self.pieces)
        elapsed_s = min(max((time_s - self.start_s) / self.stretch, 0.0), total_s)
        piece_time_s = total_s - elapsed_s if self.is_reversed else elapsed_s
        *earlier_pieces, piece = self.pieces
        for earlier in earlier_pieces:
            if piece_time_s <= earlier.duration_s:
                piece = earlier
                break
            piece_time_s -= earlier.duration_s
        pose, velocity = piece.at(min(piece_time_s, piece.duration_s))
        pace = 0.0 if elapsed_s >= total_s else (-1.0 if self.is_reversed else 1.0) / self.stretch
        velocity = np.multiply(velocity, pace)
        if self.turn_rad:
            for vector in (pose, velocity):
                vector[:2] = turned(float(vector[0]), float(vector[1]), self.turn_rad)
            pose[3] += self.turn_rad
        return TrajectoryPoint(pose if self.shift is None else pose + self.shift, velocity)


class Planner:
    """The planner of the high-level commander: `idle` (motors off), `flying` (or hovering), or `landing`."""

    def __init__(self) -> None:
        self.state: Literal["idle", "flying", "landing"] = "idle"
        self._trajectory: Trajectory | None = None

    def goal(self, now_s: float) -> TrajectoryPoint | None:
        """Return the present goal; None: motors off."""
        if self._trajectory is None:
            return None
        if self.state == "landing" and self.is_finished(now_s):
            self.stop()
            return None
        return self._trajectory.at(now_s)

    def is_finished(self, now_s: float) -> bool:
        """Return True if the trajectory is over, or without a trajectory."""
        trajectory = self._trajectory
        return trajectory is None or now_s >= trajectory.start_s + trajectory.duration_s

    def stop(self) -> None:
        """Switch the motors off."""
        self.state, self._trajectory = "idle", None

    def change_height(
        self, pose: FloatArray, height_m: float, yaw_rad: float | None, duration_s: float, now_s: float, *, land: bool
    ) -> bool:
        """Take off or land at this height, and turn to this yaw (None: no turn); return False if impossible now."""
        if self.state == "landing" if land else self.state != "idle":
            return False
        target = pose.copy()
        target[2] = height_m
        target[3] += 0.0 if yaw_rad is None else wrap_angle(yaw_rad - pose[3])
        start, end = TrajectoryPoint(pose, np.zeros(4)), TrajectoryPoint(target, np.zeros(4))
        self._begin([piece_between(start, end, max(duration_s, 1e-3))], now_s)
        self.state = "landing" if land else "flying"
        return True

    def go_to(
        self, pose: FloatArray, target: FloatArray, duration_s: float, now_s: float, *, relative: bool, linear: bool
    ) -> None:
        """Go to a target (4,), absolute or relative to the present goal; without a goal the start is `pose`."""
        goal = self.goal(now_s) or TrajectoryPoint(pose, np.zeros(4))
        target = goal.pose + target if relative else target.copy()
        target[3] = goal.pose[3] + wrap_angle(target[3] - goal.pose[3])
        duration_s = max(duration_s, 1e-3)
        velocity = (target - goal.pose) / duration_s if linear else np.zeros(4)
        start = TrajectoryPoint(goal.pose, velocity) if linear else goal
        self._begin([piece_between(start, TrajectoryPoint(target, velocity), duration_s)], now_s)
        self.state = "flying"

    def follow(
        self,
        pieces: Sequence[Piece],
        pose: FloatArray,
        stretch: float,
        now_s: float,
        *,
        relative: bool,
        relative_yaw: bool,
        is_reversed: bool,
    ) -> None:
        """Fly an uploaded trajectory, from `pose` if it is relative; `relative_yaw` then also rotates it to this yaw.

        As in the firmware, the position of its start is not rotated, nor is a reversed trajectory.
        """
        first = Trajectory(pieces, now_s, stretch, is_reversed).at(now_s).pose
        shift = (pose - first) * (1.0, 1.0, 1.0, 0.0) if relative else None
        is_rotated = relative and relative_yaw and not is_reversed
        turn_rad = wrap_angle(pose[3] - first[3]) if is_rotated else 0.0
        self._trajectory = Trajectory(pieces, now_s, stretch, is_reversed, turn_rad, shift)
        self.state = "flying"

    def _begin(self, pieces: Sequence[Piece], now_s: float) -> None:
        self._trajectory = Trajectory(pieces, now_s)
