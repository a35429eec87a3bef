"""The high-level commander: takes off, lands, goes to places and flies uploaded trajectories along polynomials.

Source: crazyflie-firmware src/modules/src/planner.c and crtp_commander_high_level.c: polynomials of seventh degree that
begin and end without jerk; a landing that is over turns the motors off.
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
CONTROL_POINTS = (0, 1, 3, 7)  # of an axis after its first, by the two bits of its type (pptraj_compressed.c)
COMPRESSED_UNITS = np.array([0.001, 0.001, 0.001, np.pi / 1800.0])  # of x, y and z in m, of yaw in rad


class TrajectoryPoint(NamedTuple):
    """Where to be, and how fast: x, y, z in m and yaw in rad, (4,) each."""

    place: FloatArray
    velocity: FloatArray


class Piece(NamedTuple):
    """A polynomial of the time since its start: coefficients (4, 8), the constant first."""

    duration_s: float
    coefficients: FloatArray

    def at(self, time_s: float) -> TrajectoryPoint:
        """The goal at this time."""
        powers = time_s ** np.arange(DEGREE + 1)
        slopes = np.arange(1, DEGREE + 1) * powers[:-1]
        return TrajectoryPoint(self.coefficients @ powers, self.coefficients[:, 1:] @ slopes)


def piece_between(start: TrajectoryPoint, end: TrajectoryPoint, duration_s: float) -> Piece:
    """The polynomial from start to end, with neither acceleration nor jerk at both."""
    rows = [[_derivative(k, power, t) for power in range(DEGREE + 1)] for t in (0.0, 1.0) for k in range(4)]
    zero = np.zeros(4)
    ends = [start.place, start.velocity * duration_s, zero, zero, end.place, end.velocity * duration_s, zero, zero]
    unit = np.linalg.solve(np.array(rows), np.array(ends)).T  # in time as a share of the duration
    return Piece(duration_s, unit / duration_s ** np.arange(DEGREE + 1))


def _derivative(order: int, power: int, time: float) -> float:
    return 0.0 if power < order else factorial(power) / factorial(power - order) * time ** (power - order)


def pieces_of(memory: bytes, offset: int, count: int) -> list[Piece] | None:
    """Uploaded pieces; None if the memory does not hold so many, or one has no duration."""
    if offset + count * PIECE_BYTES > len(memory) or count == 0:
        return None
    numbers = [unpack_from(f"<{PIECE_BYTES // 4}f", memory, offset + i * PIECE_BYTES) for i in range(count)]
    pieces = [Piece(of[-1], np.array(of[:-1]).reshape(4, DEGREE + 1)) for of in numbers]
    return pieces if all(np.isfinite(of).all() for of in numbers) and all(p.duration_s > 0.0 for p in pieces) else None


def compressed_pieces_of(memory: bytes, offset: int) -> list[Piece] | None:
    """Uploaded pieces of a compressed trajectory, up to the first without a duration; None if the memory ends before.

    The place at the start (int16: mm, 0.1 degrees), then for each piece its types (2 bits an axis, x lowest), its
    duration (uint16, ms) and the Bezier control points of x, y, z and yaw after the first, which is where the piece
    before ended.
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
        for axis, after_first in enumerate(values):
            points = np.append(start[axis], COMPRESSED_UNITS[axis] * after_first)
            coefficients[axis, : len(points)] = bezier_coefficients(points, 0.001 * duration_ms)
            end[axis] = points[-1]
        pieces.append(Piece(0.001 * duration_ms, coefficients))
        start = end
    return None


def bezier_coefficients(points: FloatArray, duration_s: float) -> FloatArray:
    """The coefficients (n + 1,) in time, the constant first, of a Bezier curve with these control points (n + 1,).

    That of time^j is C(n, j) times the j-th difference of the first points / duration^j (pptraj.c: polybezier).

    >>> bezier_coefficients(np.array([1.0, 3.0]), 4.0).tolist()
    [1.0, 0.5]
    """
    n = len(points) - 1
    return np.array([comb(n, j) * np.diff(points, j)[0] / duration_s**j for j in range(n + 1)])


@dataclass(frozen=True)
class Trajectory:
    """Pieces one after another, from `began_s` on, `stretch` times as long, turned about the origin, then moved."""

    pieces: Sequence[Piece]
    began_s: float
    stretch: float = 1.0
    is_reversed: bool = False
    turn_rad: float = 0.0
    shift: FloatArray | None = None  # (4,)

    @property
    def duration_s(self) -> float:
        """From start to end."""
        return self.stretch * sum(piece.duration_s for piece in self.pieces)

    def at(self, time_s: float) -> TrajectoryPoint:
        """The goal at this time; after the end, the last place at rest."""
        total_s = sum(piece.duration_s for piece in self.pieces)
        passed_s = min(max((time_s - self.began_s) / self.stretch, 0.0), total_s)
        within_s = total_s - passed_s if self.is_reversed else passed_s
        *before, piece = self.pieces
        for earlier in before:
            if within_s <= earlier.duration_s:
                piece = earlier
                break
            within_s -= earlier.duration_s
        place, velocity = piece.at(min(within_s, piece.duration_s))
        pace = 0.0 if passed_s >= total_s else (-1.0 if self.is_reversed else 1.0) / self.stretch
        velocity = np.multiply(velocity, pace)
        if self.turn_rad:
            for vector in (place, velocity):
                vector[:2] = turned(float(vector[0]), float(vector[1]), self.turn_rad)
            place[3] += self.turn_rad
        return TrajectoryPoint(place if self.shift is None else place + self.shift, velocity)


class Planner:
    """What the high-level commander does: nothing (`idle`, motors off), `flying` (also in place), or `landing`."""

    def __init__(self) -> None:
        self.state: Literal["idle", "flying", "landing"] = "idle"
        self._trajectory: Trajectory | None = None

    def goal(self, now_s: float) -> TrajectoryPoint | None:
        """Where to be now; None: motors off."""
        if self._trajectory is None:
            return None
        if self.state == "landing" and self.is_finished(now_s):
            self.stop()
            return None
        return self._trajectory.at(now_s)

    def is_finished(self, now_s: float) -> bool:
        """Whether the trajectory is over; true if there is none."""
        of = self._trajectory
        return of is None or now_s >= of.began_s + of.duration_s

    def stop(self) -> None:
        """Motors off."""
        self.state, self._trajectory = "idle", None

    def change_height(
        self, here: FloatArray, height_m: float, yaw_rad: float | None, duration_s: float, now_s: float, *, land: bool
    ) -> bool:
        """Take off or land at this height, and turn to this yaw (None: as it is); false if that cannot be done now."""
        if self.state == "landing" if land else self.state != "idle":
            return False
        there = here.copy()
        there[2] = height_m
        there[3] += 0.0 if yaw_rad is None else wrap_angle(yaw_rad - here[3])
        rest = np.zeros(4)
        self._begin(
            [piece_between(TrajectoryPoint(here, rest), TrajectoryPoint(there, rest), max(duration_s, 1e-3))], now_s
        )
        self.state = "landing" if land else "flying"
        return True

    def go_to(
        self, here: FloatArray, there: FloatArray, duration_s: float, now_s: float, *, relative: bool, linear: bool
    ) -> None:
        """Go to a place (4,), which is relative to the present goal or absolute; from `here` if there is no goal."""
        goal = self.goal(now_s) or TrajectoryPoint(here, np.zeros(4))
        place = goal.place + there if relative else there.copy()
        place[3] = goal.place[3] + wrap_angle(place[3] - goal.place[3])
        duration_s = max(duration_s, 1e-3)
        velocity = (place - goal.place) / duration_s if linear else np.zeros(4)
        start = TrajectoryPoint(goal.place, velocity) if linear else goal
        self._begin([piece_between(start, TrajectoryPoint(place, velocity), duration_s)], now_s)
        self.state = "flying"

    def follow(
        self,
        pieces: Sequence[Piece],
        here: FloatArray,
        stretch: float,
        now_s: float,
        *,
        relative: bool,
        relative_yaw: bool,
        is_reversed: bool,
    ) -> None:
        """Fly an uploaded trajectory, from `here` if it is relative; `relative_yaw` then also turns it to this yaw.

        As in the firmware, the place of its start is not turned, and a reversed one does not turn.
        """
        first = Trajectory(pieces, now_s, stretch, is_reversed).at(now_s).place
        shift = (here - first) * (1.0, 1.0, 1.0, 0.0) if relative else None
        turns = relative and relative_yaw and not is_reversed
        turn_rad = wrap_angle(here[3] - first[3]) if turns else 0.0
        self._trajectory = Trajectory(pieces, now_s, stretch, is_reversed, turn_rad, shift)
        self.state = "flying"

    def _begin(self, pieces: Sequence[Piece], now_s: float) -> None:
        self._trajectory = Trajectory(pieces, now_s)
