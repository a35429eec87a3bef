"""Poses by MAVLink: GLOBAL_POSITION_INT if the arena has an origin on earth, else LOCAL_POSITION_NED and ATTITUDE.

MAVLink's axes are north, east and down, its angles count clockwise from north; here x is east, y north, z up. Messages
of versions 1 and 2 arrive as datagrams, many vehicles at one address. Those of cameras, companions and ground stations
are ignored. Source: common.xml of MAVLink, https://mavlink.io/en/messages/common.html.
"""

from functools import partial
from math import isfinite, nan, pi, radians
from typing import Any

from swarmwire.comms.base.angles import wrap_angle
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.base.extras import MAVLINK
from swarmwire.world.motion.traces.emane import Geodetic, to_local
from swarmwire.world.motion.udp import DatagramSource
from swarmwire.world.scenario.motion import MavlinkMotion

AUTOPILOT = 1  # MAV_COMP_ID_AUTOPILOT1
MAX_SYSTEM = 255
UNKNOWN_HEADING = 65_535  # `hdg` of GLOBAL_POSITION_INT
UNITS_PER_DEG, MM_PER_M, UNITS_PER_HDG_DEG, NS_PER_MS = 1e7, 1e3, 100.0, 1_000_000
BAD_DATA = "BAD_DATA"  # pymavlink's type of bytes that are no message


class MavlinkSource(DatagramSource):
    """Takes the messages of the autopilots of the group's vehicles."""

    motion: MavlinkMotion

    def open(self) -> None:
        """Begin to receive; BadInput without pymavlink, an id for each robot, or a free address."""
        MAVLINK.need("mavlink")
        from pymavlink.dialects.v20 import common

        self._new_parser = partial(common.MAVLink, None)
        count = len(self.names)
        systems = self.motion.systems or range(1, min(count, MAX_SYSTEM) + 1)
        if not count == len(systems) == len(set(systems)):
            expected = f"expected {count} different system ids of 1 to {MAX_SYSTEM}, one for each robot; got "
            raise BadInput("", "systems", f"{expected}{len(set(systems))}")
        self._name_of = dict(zip(systems, self.names, strict=True))
        self._yaw_rad = dict[int, float]()  # of the last ATTITUDE, by system id
        self.listen(self.motion.listen.removeprefix("udpin:").removeprefix("udp:"))

    def take(self, datagram: bytes) -> None:
        """Take the messages in a datagram."""
        parser: Any = self._new_parser()  # for each datagram: what one lacks is not in the next
        parser.robust_parsing = True
        messages = parser.parse_buffer(datagram)
        if parser.buf_len():
            self.count("poses_malformed")
        for message in messages or ():
            kind: str = message.get_type()
            if kind == BAD_DATA:
                self.count("poses_malformed")
            elif message.get_srcComponent() == AUTOPILOT:
                self._take(kind, message.get_srcSystem(), message)

    def _take(self, kind: str, system: int, message: Any) -> None:
        name, origin = self._name_of.get(system, ""), self.motion.origin
        if kind == "ATTITUDE":
            self._yaw_rad[system] = message.yaw
        elif kind == "LOCAL_POSITION_NED" and origin is None:
            heading_rad = _heading_rad(self._yaw_rad.get(system, nan))
            self.put(name, message.y, message.x, -message.z, heading_rad, NS_PER_MS * message.time_boot_ms)
        elif kind == "GLOBAL_POSITION_INT" and origin is not None and (message.lat or message.lon):  # 0, 0: no fix yet
            point = Geodetic(message.lat / UNITS_PER_DEG, message.lon / UNITS_PER_DEG, message.alt / MM_PER_M)
            east_m, north_m, up_m = map(float, to_local(point, Geodetic(*origin)))
            yaw_rad = nan if message.hdg == UNKNOWN_HEADING else radians(message.hdg / UNITS_PER_HDG_DEG)
            self.put(name, east_m, north_m, up_m, _heading_rad(yaw_rad), NS_PER_MS * message.time_boot_ms)


def _heading_rad(yaw_rad: float) -> float:
    """Return the heading, 0 to the east and rising to the left, of an angle that rises from north to the right.

    >>> _heading_rad(0.0) == pi / 2, _heading_rad(pi / 2)
    (True, 0.0)
    """
    return wrap_angle(0.5 * pi - yaw_rad) if isfinite(yaw_rad) else yaw_rad
