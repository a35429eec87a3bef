"""The packets of the high-level commander, and the memory into which clients upload trajectories.

Source: crazyflie-firmware src/modules/src/crtp_commander_high_level.c, docs/functional-areas/crtp/crtp_mem.md.
"""

from struct import calcsize, unpack_from
from typing import Any, NamedTuple

import numpy as np

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.world.gateways.crazyflie.crtp import Errno
from swarmwire.world.gateways.crazyflie.flight import Flight
from swarmwire.world.gateways.crazyflie.trajectories import compressed_pieces_of, pieces_of
from swarmwire.world.gateways.crazyflie.variables import Parameters

MEMORY_BYTES, MEMORY_TYPE = 4096, 0x12  # the only memory, for trajectories
MAX_TRAJECTORIES = 31
IN_MEMORY, POLY4D, COMPRESSED = 1, 0, 1  # the only location, and the types of trajectories
MASK, STOP, GO_TO_OLD, FOLLOW_OLD, DEFINE, TAKE_OFF, LAND, GO_TO, FOLLOW = 0, 3, 4, 5, 6, 7, 8, 12, 13
_LAYOUTS = {
    MASK: "<B",
    STOP: "<B",
    GO_TO_OLD: "<BBfffff",
    FOLLOW_OLD: "<BBBBf",
    DEFINE: "<BBBIB",
    TAKE_OFF: "<Bff?f",
    LAND: "<Bff?f",
    GO_TO: "<BBBfffff",
    FOLLOW: "<BBBBBf",
}


class TrajectoryMemory:
    """The memory of a Crazyflie.

    Attributes:
        data: bytes that clients wrote.
    """

    def __init__(self) -> None:
        self.data = bytearray(MEMORY_BYTES)

    def answer(self, channel: int, data: bytes) -> bytes | None:
        """Return the answer to a request on the memory's port; None: no answer."""
        if channel == 0 and data[:1] == b"\1":
            return b"\1\1"
        if channel == 0 and data[:1] == b"\2":
            return data[:2] + bytes([MEMORY_TYPE]) + MEMORY_BYTES.to_bytes(4, "little") + bytes(8)
        if channel not in (1, 2) or len(data) < 6:
            return None
        start = int.from_bytes(data[1:5], "little")
        end = start + (data[5] if channel == 1 else len(data) - 5)
        if data[0] != 0 or end > MEMORY_BYTES:
            return data[:5] + bytes([Errno.EIO])
        if channel == 2:
            self.data[start:end] = data[5:]
        return data[:5] + bytes([Errno.OK]) + (self.data[start:end] if channel == 1 else b"")


class Definition(NamedTuple):
    """A client's description of a trajectory, which need not be in the memory yet."""

    location: int
    kind: int
    offset: int  # bytes from the start of the memory
    pieces: int  # without meaning for a compressed trajectory


class HighLevelCommander:
    """Passes clients' commands to the planner of a flight.

    Attributes:
        memory: memory for trajectories.
    """

    def __init__(self, flight: Flight, parameters: Parameters) -> None:
        self.memory = TrajectoryMemory()
        self._flight, self._parameters = flight, parameters
        self._definitions: dict[int, Definition] = {}

    def command(self, data: bytes, now_s: float) -> Errno:
        """Execute the command of a packet; spirals and trajectories outside the memory are refused."""
        layout = _LAYOUTS.get(data[0]) if data else None
        if layout is None or len(data) < 1 + calcsize(layout):
            return Errno.ENOEXEC
        values: tuple[Any, ...] = unpack_from(layout, data, 1)
        if not np.isfinite(np.array(values, float)).all():
            return Errno.EINVAL
        command, (first, *arguments) = data[0], values
        if command == MASK:
            self._parameters["hlCommander.groupmask"] = first
            return Errno.OK
        if command == DEFINE:
            return self._define(first, Definition(*arguments))
        if first and not first & int(self._parameters["hlCommander.groupmask"]):
            return Errno.OK  # the command is for other groups
        if command == FOLLOW_OLD:
            return self._follow(now_s, arguments[0], 0, *arguments[1:])
        if command == FOLLOW:
            return self._follow(now_s, *arguments)
        return self._move(command, arguments, now_s)

    def _move(self, command: int, values: list[Any], now_s: float) -> Errno:
        planner = self._flight.planner
        if command == STOP:
            planner.stop()
        elif command in (TAKE_OFF, LAND):
            height_m, yaw_rad, keeps_yaw, duration_s = values
            yaw = None if keeps_yaw else yaw_rad
            done = planner.change_height(self._pose(now_s), height_m, yaw, duration_s, now_s, land=command == LAND)
            return Errno.OK if done else Errno.ENOEXEC
        else:
            relative, linear = values[0], values[1] if command == GO_TO else 0
            *target, duration_s = values[-5:]
            planner.go_to(
                self._pose(now_s), np.array(target), duration_s, now_s, relative=bool(relative), linear=bool(linear)
            )
        return Errno.OK

    def _define(self, number: int, definition: Definition) -> Errno:
        if number >= MAX_TRAJECTORIES:
            return Errno.ENOEXEC
        self._definitions[number] = definition
        return Errno.OK

    def _follow(
        self, now_s: float, relative: int, relative_yaw: int, is_reversed: int, number: int, stretch: float
    ) -> Errno:
        """Fly the trajectory that is now in the memory at the newest definition.

        The firmware flies compressed trajectories only forwards and at their pace, and never rotates them.
        """
        definition, memory = self._definitions.get(number), bytes(self.memory.data)
        if definition is None or definition.location != IN_MEMORY or stretch <= 0.0:
            return Errno.ENOEXEC
        pieces = None
        if definition.kind == POLY4D:
            pieces = pieces_of(memory, definition.offset, definition.pieces)
        elif definition.kind == COMPRESSED and stretch == 1.0 and not is_reversed:
            pieces, relative_yaw = compressed_pieces_of(memory, definition.offset), 0
        if pieces is None:
            return Errno.ENOEXEC
        flags = {"relative": bool(relative), "relative_yaw": bool(relative_yaw), "is_reversed": bool(is_reversed)}
        self._flight.planner.follow(pieces, self._pose(now_s), stretch, now_s, **flags)
        return Errno.OK

    def _pose(self, now_s: float) -> FloatArray:
        """Return x, y, height and yaw, (4,), of the planner's goal, or of the estimate while it is idle."""
        goal = self._flight.planner.goal(now_s)
        return self._flight.estimate.pose(self._flight.height_m) if goal is None else goal.pose
