"""Set-points: what a Crazyflie is to do now, from packets of the generic commander and from the planner.

Source: crazyflie-firmware src/modules/src/crtp_commander_generic.c; the packed attitude is that of
src/utils/interface/quatcompress.h.
"""

from dataclasses import dataclass
from math import isfinite, radians, sqrt
from struct import calcsize, unpack_from

from swarmwire.comms.robots.crazyflie import yaw_of
from swarmwire.world.gateways.crazyflie.trajectories import Goal

Plane = tuple[float, float]  # x ahead or along +x, y to the left or along +y


@dataclass(frozen=True, slots=True)
class Setpoint:
    """Speeds and places; without a climb and a height the motors are off. Angles are counter-clockwise."""

    body_mps: Plane | None = None
    world_mps: Plane | None = None  # beside a place: added to the speed towards it
    place_m: Plane | None = None
    climb_mps: float | None = None  # beside a height: added to the speed towards it
    height_m: float | None = None
    turn_radps: float | None = None
    heading_rad: float | None = None

    @property
    def flies(self) -> bool:
        """Whether the motors run."""
        return self.climb_mps is not None or self.height_m is not None


OFF = Setpoint()
STOP, WORLD_OLD, TILT_OLD, HOVER_OLD, FULL_STATE, PLACE, WORLD, TILT, HOVER = 0, 1, 2, 5, 6, 7, 8, 9, 10
_LAYOUTS = dict.fromkeys((WORLD_OLD, TILT_OLD, HOVER_OLD, PLACE, WORLD, TILT, HOVER), "<4f") | {
    STOP: "<",
    FULL_STATE: "<9hI3h",
}


def setpoint_of(data: bytes) -> Setpoint | None:
    """The set-point in a packet; None if an emulated Crazyflie cannot follow it: tilts, thrusts, and what is no number.

    A height with a tilt (`send_zdistance_setpoint`) is kept without the tilt.
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
        return Setpoint(world_mps=(vx, vy), place_m=(x, y), climb_mps=vz, height_m=z, heading_rad=heading)
    first, second, third, fourth = values
    if kind == PLACE:
        return Setpoint(place_m=(first, second), height_m=third, heading_rad=radians(fourth))
    if kind in (WORLD, WORLD_OLD):
        turn = radians(fourth if kind == WORLD else -fourth)
        return Setpoint(world_mps=(first, second), climb_mps=third, turn_radps=turn)
    turn = radians(third if kind in (TILT, HOVER) else -third)
    body = (first, second) if kind in (HOVER, HOVER_OLD) else (0.0, 0.0)
    return Setpoint(body_mps=body, height_m=fourth, turn_radps=turn)


def setpoint_at(goal: Goal) -> Setpoint:
    """The set-point of the planner's goal."""
    (x, y, z, yaw), (vx, vy, vz, turn) = goal.place.tolist(), goal.velocity.tolist()
    return Setpoint(None, (vx, vy), (x, y), vz, z, turn, yaw)


def unpacked_attitude(packed: int) -> tuple[float, float, float, float]:
    """An attitude (x, y, z, w) from 32 bits: which of them is the largest, then sign and 9 bits of each other."""
    largest, parts = packed >> 30, [0.0] * 4
    for i in (3, 2, 1, 0):
        if i != largest:
            size = (packed & 0x1FF) / 0x1FF / sqrt(2.0)
            parts[i] = -size if packed & 0x200 else size
            packed >>= 10
    parts[largest] = sqrt(max(1.0 - sum(part * part for part in parts), 0.0))
    return parts[0], parts[1], parts[2], parts[3]
