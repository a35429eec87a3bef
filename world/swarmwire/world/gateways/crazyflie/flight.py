"""The flight of an emulated Crazyflie: its set-points, supervisor and height, and its speeds in the world.

Set-points come in packets of the generic commander, and from the planner. The world moves robots in the plane, so this
module integrates the height: it follows the set-points at the firmware's limit, and falls with the motors off. Sources:
crazyflie-firmware src/modules/src/crtp_commander_generic.c, src/utils/interface/quatcompress.h (the packed attitude),
src/modules/src/supervisor.c (states and times), commander.c (priorities), controller/position_controller_pid.c and
platform_defaults_cf2.h (gain 2/s and limit 1 m/s towards a position).
"""

from dataclasses import dataclass
from enum import Enum
from math import isfinite, radians, sqrt
from struct import calcsize, unpack_from

import numpy as np

from swarmwire.comms.base.angles import wrap_angle
from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.protocols.crazyflie import (
    ARMED_BIT,
    CAN_FLY_BIT,
    FLYING_BIT,
    G_MPS2,
    LOCKED_BIT,
    turned,
    yaw_of,
)
from swarmwire.world.gateways.crazyflie.trajectories import Planner, TrajectoryPoint

LEVEL_OUT_MS, SHUT_DOWN_MS, LANDED_MS, WATCHDOG_MS = 500, 2000, 2000, 1000
GAIN_PER_S, MAX_MPS, MAX_TURN_RADPS = 2.0, 1.0, 3.5
STEP_S = 0.01  # time step of the height
AUTO_ARMED_BIT, PLANNER_ON_BIT, PLANNER_DONE_BIT, PLANNER_OFF_BIT = 2, 8, 9, 10
Plane = tuple[float, float]  # x ahead or along +x, y to the left or along +y


@dataclass(frozen=True, slots=True)
class Setpoint:
    """Speeds and positions; without a climb and a height the motors are off. Angles are counter-clockwise."""

    body_mps: Plane | None = None
    world_mps: Plane | None = None  # added to the speed towards `position_m`
    position_m: Plane | None = None
    climb_mps: float | None = None  # added to the speed towards `height_m`
    height_m: float | None = None
    turn_radps: float | None = None
    heading_rad: float | None = None

    @property
    def flies(self) -> bool:
        """True if the motors run."""
        return self.climb_mps is not None or self.height_m is not None


OFF = Setpoint()
STOP, WORLD_OLD, TILT_OLD, HOVER_OLD, FULL_STATE, POSITION, WORLD, TILT, HOVER = 0, 1, 2, 5, 6, 7, 8, 9, 10
_LAYOUTS = dict.fromkeys((WORLD_OLD, TILT_OLD, HOVER_OLD, POSITION, WORLD, TILT, HOVER), "<4f") | {
    STOP: "<",
    FULL_STATE: "<9hI3h",
}


def setpoint_of(data: bytes) -> Setpoint | None:
    """Decode the set-point in a packet; None for set-points that are not emulated: tilts, thrusts, and nan.

    A height with a tilt (`send_zdistance_setpoint`) is accepted without the tilt.
    """
    layout = _LAYOUTS.get(data[0]) if data else None
    if layout is None or len(data) < 1 + calcsize(layout):
        return None
    kind, values = data[0], unpack_from(layout, data, 1)
    if not all(isfinite(value) for value in values):
        return None
    if kind == STOP:
        return OFF
    if kind == FULL_STATE:
        x, y, z, vx, vy, vz = (0.001 * value for value in values[:6])
        heading = yaw_of(unpacked_attitude(values[9]))
        return Setpoint(world_mps=(vx, vy), position_m=(x, y), climb_mps=vz, height_m=z, heading_rad=heading)
    first, second, third, fourth = values
    if kind == POSITION:
        return Setpoint(position_m=(first, second), height_m=third, heading_rad=radians(fourth))
    if kind in (WORLD, WORLD_OLD):
        turn = radians(fourth if kind == WORLD else -fourth)
        return Setpoint(world_mps=(first, second), climb_mps=third, turn_radps=turn)
    turn = radians(third if kind in (TILT, HOVER) else -third)
    body = (first, second) if kind in (HOVER, HOVER_OLD) else (0.0, 0.0)
    return Setpoint(body_mps=body, height_m=fourth, turn_radps=turn)


def setpoint_at(goal: TrajectoryPoint) -> Setpoint:
    """Return the set-point of the planner's goal."""
    (x, y, z, yaw), (vx, vy, vz, turn) = goal.pose.tolist(), goal.velocity.tolist()
    return Setpoint(None, (vx, vy), (x, y), vz, z, turn, yaw)


def unpacked_attitude(packed: int) -> tuple[float, float, float, float]:
    """Decode an attitude (x, y, z, w) from 32 bits: index of the largest part, then sign and 9 bits of each other."""
    largest, parts = packed >> 30, [0.0] * 4
    for i in (3, 2, 1, 0):
        if i != largest:
            size = (packed & 0x1FF) / 0x1FF / sqrt(2.0)
            parts[i] = -size if packed & 0x200 else size
            packed >>= 10
    parts[largest] = sqrt(max(1.0 - sum(part * part for part in parts), 0.0))
    return parts[0], parts[1], parts[2], parts[3]


class SupervisorState(Enum):
    """State of the supervisor; a locked Crazyflie runs no motor until it is switched on again."""

    READY = "ready to fly"
    FLYING = "flying"
    LEVEL_OUT = "level out"  # no set-point for half a second
    LOCKED = "locked"


@dataclass(frozen=True, slots=True)
class BodyVelocity:
    """Speeds in the body's frame; 0 on the floor."""

    forward_mps: float = 0.0
    left_mps: float = 0.0
    turn_radps: float = 0.0


STANDSTILL = BodyVelocity()


class FlightEstimate:
    """The state estimate: position, heading and speed, by the body's sensors.

    With positioning and a compass they are in the arena's frame. Otherwise they start at 0 and drift: the position is
    the integral of the flow, the heading that of the gyro.

    Attributes:
        x_m, y_m, yaw_rad: position and heading.
        body_mps: speed forward and to the left.
    """

    def __init__(self) -> None:
        self.x_m = self.y_m = self.yaw_rad = 0.0
        self.body_mps: Plane = (0.0, 0.0)

    def reset(self, x_m: float, y_m: float, yaw_rad: float) -> None:
        """Set position and heading."""
        self.x_m, self.y_m, self.yaw_rad = x_m, y_m, yaw_rad

    def update(self, row: dict[str, FloatArray], motion: BodyVelocity, elapsed_s: float) -> None:
        """Update with readings, "sensor.field" -> () or (width,); `motion` replaces lost and absent readings."""

        def read(name: str, default: float) -> float:
            value = float(row[name]) if name in row else default
            return value if isfinite(value) else default

        flow = read("flow.forward_mps", motion.forward_mps), read("flow.left_mps", motion.left_mps)
        yaw = wrap_angle(self.yaw_rad + elapsed_s * read("imu.turn_radps", motion.turn_radps))
        dx, dy = turned(*flow, self.yaw_rad)
        self.body_mps, self.yaw_rad = flow, read("compass.heading_rad", yaw)
        self.x_m = read("positioning.x_m", self.x_m + elapsed_s * dx)
        self.y_m = read("positioning.y_m", self.y_m + elapsed_s * dy)

    def pose(self, height_m: float) -> FloatArray:
        """Return x, y, height and yaw, (4,)."""
        return np.array([self.x_m, self.y_m, height_m, self.yaw_rad])


class Flight:
    """The flights of a Crazyflie.

    Attributes:
        state: state of the supervisor.
        planner: the high-level commander.
        estimate: estimate of position and heading.
        height_m, climb_mps: true height and vertical speed.
        setpoint: present set-point.
        motion: present speeds.
    """

    def __init__(self) -> None:
        self.state, self.planner, self.estimate = SupervisorState.READY, Planner(), FlightEstimate()
        self.height_m = self.climb_mps = 0.0
        self.setpoint, self.motion = OFF, STANDSTILL
        self._low_level: tuple[Setpoint, int] | None = None  # a client's newest, and its time of arrival; None: planner
        self._watchdog_ms: int | None = None
        self._thrust_ms = -LANDED_MS

    def set(self, setpoint: Setpoint, now_ms: int) -> None:
        """Follow a client's set-point, which has priority over the planner until `relax`."""
        self._low_level = setpoint, now_ms
        self.planner.stop()

    def relax(self) -> None:
        """Return the control to the planner."""
        self._low_level = None

    def emergency_stop(self) -> None:
        """Lock the motors."""
        self.state = SupervisorState.LOCKED

    def feed_watchdog(self, now_ms: int) -> None:
        """Reset the watchdog; after the first call, a second without a call locks the motors."""
        self._watchdog_ms = now_ms

    def info(self, now_s: float) -> int:
        """Return the log variable supervisor.info."""
        locked = self.state is SupervisorState.LOCKED
        flying = self.state in (SupervisorState.FLYING, SupervisorState.LEVEL_OUT)
        bits = {
            ARMED_BIT: not locked,
            AUTO_ARMED_BIT: True,
            CAN_FLY_BIT: not locked,
            FLYING_BIT: flying,
            LOCKED_BIT: locked,
            PLANNER_ON_BIT: self.planner.state != "idle",
            PLANNER_DONE_BIT: self.planner.is_finished(now_s),
            PLANNER_OFF_BIT: False,
        }
        return sum(1 << bit for bit, is_set in bits.items() if is_set)

    def step(self, now_ms: int, elapsed_s: float) -> None:
        """Follow the set-points for the time up to now."""
        setpoint, age_ms = self._active_setpoint(now_ms)
        self._supervise(setpoint, age_ms, now_ms)
        self.setpoint = OFF if self.state is SupervisorState.LOCKED else setpoint
        for _ in range(round(elapsed_s / STEP_S)):
            self._climb(self.setpoint)
        self.motion = self._motion(self.setpoint)

    def _active_setpoint(self, now_ms: int) -> tuple[Setpoint, int]:
        """Return the set-point with the highest priority, and its age in ms."""
        if self._low_level is not None:
            setpoint, arrived_ms = self._low_level
            return setpoint, now_ms - arrived_ms
        goal = self.planner.goal(0.001 * now_ms)
        return OFF if goal is None else setpoint_at(goal), 0

    def _supervise(self, setpoint: Setpoint, age_ms: int, now_ms: int) -> None:
        if setpoint.flies and self.state is not SupervisorState.LOCKED:
            self._thrust_ms = now_ms
        has_thrust = now_ms - self._thrust_ms < LANDED_MS
        if self._watchdog_ms is not None and now_ms - self._watchdog_ms >= WATCHDOG_MS:
            self.state = SupervisorState.LOCKED
        if self.state is SupervisorState.READY and setpoint.flies:
            self.state = SupervisorState.FLYING
        if self.state in (SupervisorState.FLYING, SupervisorState.LEVEL_OUT):
            if age_ms > SHUT_DOWN_MS:
                self.state = SupervisorState.LOCKED
            elif age_ms > LEVEL_OUT_MS:
                self.state = SupervisorState.LEVEL_OUT
            else:
                self.state = SupervisorState.FLYING if has_thrust else SupervisorState.READY

    def _climb(self, setpoint: Setpoint) -> None:
        if not setpoint.flies:
            self.climb_mps -= G_MPS2 * STEP_S
        elif setpoint.height_m is None:
            self.climb_mps = _limited(setpoint.climb_mps or 0.0, MAX_MPS)
        else:
            approach_mps = GAIN_PER_S * (setpoint.height_m - self.height_m)
            self.climb_mps = _limited(approach_mps + (setpoint.climb_mps or 0.0), MAX_MPS)
        self.height_m += self.climb_mps * STEP_S
        if self.height_m <= 0.0:
            self.height_m = self.climb_mps = 0.0

    def _motion(self, setpoint: Setpoint) -> BodyVelocity:
        if not setpoint.flies or self.height_m <= 0.0 or self.state is SupervisorState.LEVEL_OUT:
            return STANDSTILL
        estimate = self.estimate
        turn = setpoint.turn_radps or 0.0
        if setpoint.heading_rad is not None:
            turn += GAIN_PER_S * wrap_angle(setpoint.heading_rad - estimate.yaw_rad)
        if setpoint.body_mps is not None:
            forward, left = setpoint.body_mps
        else:
            x_mps, y_mps = setpoint.world_mps or (0.0, 0.0)
            if setpoint.position_m is not None:
                x_mps = _limited(x_mps + GAIN_PER_S * (setpoint.position_m[0] - estimate.x_m), MAX_MPS)
                y_mps = _limited(y_mps + GAIN_PER_S * (setpoint.position_m[1] - estimate.y_m), MAX_MPS)
            forward, left = turned(x_mps, y_mps, -estimate.yaw_rad)
        return BodyVelocity(forward, left, _limited(turn, MAX_TURN_RADPS))


def _limited(value: float, limit: float) -> float:
    return min(max(value, -limit), limit)
