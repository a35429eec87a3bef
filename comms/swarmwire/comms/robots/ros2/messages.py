"""Messages of a ROS 2 distribution and their CDR encoding, by the library rosbags."""

from typing import Any

from swarmwire.comms.clock import NS_PER_S
from swarmwire.comms.errors import BadFrame, BadInput

DISTROS = ("humble", "iron", "jazzy", "kilted", "lyrical")  # of ROS 2, whose messages are known
NO_HASH = "TypeHashNotSupported"  # what Humble's rmw_zenoh has in place of a hash


class Messages:
    """Makes, encodes and decodes messages, which are rosbags' dataclasses: fields as ROS names them."""

    def __init__(self, distro: str) -> None:
        """BadInput if rosbags is not installed."""
        try:
            from rosbags.serde import SerdeError
            from rosbags.typesys import Stores, get_typestore
        except ModuleNotFoundError as error:
            needs = f'ROS 2 needs the package {error.name}: pip install "swarmwire-agent[ros2]"'
            raise BadInput("ros2", "", needs) from None
        self._distro, self._store, self._fault = distro, get_typestore(Stores(f"ros2_{distro}")), SerdeError

    def make(self, kind: str, *fields: Any) -> Any:
        """A message with these fields, in the order of its definition."""
        return self._store.types[kind](*fields)

    def header(self, stamp_ns: int, frame: str) -> Any:
        """A header of the time in ns since 1970, in the frame of this name."""
        return self.make("std_msgs/msg/Header", self.time(stamp_ns), frame)

    def time(self, stamp_ns: int) -> Any:
        """A time in ns since 1970 as ROS has it."""
        return self.make("builtin_interfaces/msg/Time", stamp_ns // NS_PER_S, stamp_ns % NS_PER_S)

    def encode(self, kind: str, message: Any) -> bytes:
        """CDR of a message, little-endian, with the four bytes before it that say so."""
        return bytes(self._store.serialize_cdr(message, kind, little_endian=True))

    def decode(self, kind: str, payload: bytes) -> Any:
        """The message of CDR bytes of either endianness; BadFrame if they are none of this kind."""
        try:
            return self._store.deserialize_cdr(payload, kind)
        except (self._fault, IndexError, AssertionError) as error:
            raise BadFrame("malformed", f"{kind}: {error}") from None

    def hash_of(self, kind: str) -> str:
        """The hash of this kind of message as rmw_zenoh of the distribution writes it (REP 2016)."""
        return NO_HASH if self._distro == "humble" else self._store.hash_rihs01(kind)


def stamp_ns(header: Any) -> int:
    """The time of a header in ns since 1970."""
    return header.stamp.sec * NS_PER_S + header.stamp.nanosec
