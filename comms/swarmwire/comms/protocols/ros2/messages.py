"""Messages of a ROS 2 distribution and their CDR encoding by rosbags; Twist and TwistStamped without it."""

import struct
from math import isfinite
from typing import Any, NamedTuple

from swarmwire.comms.base.clock import NS_PER_S
from swarmwire.comms.base.errors import BadFrame
from swarmwire.comms.base.extras import ROS2

DISTROS = ("humble", "iron", "jazzy", "kilted", "lyrical")  # supported distributions of ROS 2
NO_HASH = "TypeHashNotSupported"  # hash of every message in Humble's rmw_zenoh
LITTLE_ENDIAN = b"\x00\x01\x00\x00"  # header of little-endian CDR
TWIST_BYTES = 4 + 48
MAX_STAMPED_BYTES = 512  # TwistStamped; the name of its frame has at most some hundred letters
MAX_PADDING = 4  # some writers pad to a multiple of four bytes
# Messages that rosbags lacks: our own, and irobot_create_msgs, equal on its branches humble and rolling.
PACKAGE = "irobot_create_msgs/msg"
HAZARD = f"{PACKAGE}/HazardDetection"
HAZARDS = f"{PACKAGE}/HazardDetectionVector"
INTENSITY = f"{PACKAGE}/IrIntensity"
INTENSITIES = f"{PACKAGE}/IrIntensityVector"
DOCK_STATUS = f"{PACKAGE}/DockStatus"
STOP_STATUS = f"{PACKAGE}/StopStatus"
WHEEL_TICKS = f"{PACKAGE}/WheelTicks"
WHEEL_VELS = f"{PACKAGE}/WheelVels"
HEADER = "std_msgs/Header header\n"
PACKET = "swarmwire_msgs/msg/Packet"  # a packet of an emulated radio at one receiver
DEFINITIONS = {
    HAZARD: HEADER + "uint8 type",
    HAZARDS: HEADER + "irobot_create_msgs/HazardDetection[] detections",
    INTENSITY: HEADER + "int16 value",
    INTENSITIES: HEADER + "irobot_create_msgs/IrIntensity[] readings",
    DOCK_STATUS: HEADER + "bool dock_visible\nbool is_docked",
    STOP_STATUS: HEADER + "bool is_stopped",
    WHEEL_TICKS: HEADER + "int32 ticks_left\nint32 ticks_right",
    WHEEL_VELS: HEADER + "float32 velocity_left\nfloat32 velocity_right",
    PACKET: HEADER + "builtin_interfaces/Time sent\nbuiltin_interfaces/Time on_air\nstring sender\nstring receiver\n"
    "string to\nstring fate\nuint32 receivers\nuint64 sequence\nstring topic\nuint32 size_bytes\nfloat32 distance_m\n"
    "float32 rssi_dbm\nuint8[] payload",
}


class Messages:
    """Construction, encoding and decoding of messages: rosbags' dataclasses with the field names of ROS."""

    def __init__(self, distro: str) -> None:
        """Load the messages of a distribution; BadInput if rosbags is not installed."""
        ROS2.need("ros2")
        from rosbags.serde import SerdeError
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore

        self.distro, self._store, self._fault = distro, get_typestore(Stores(f"ros2_{distro}")), SerdeError
        for kind, definition in DEFINITIONS.items():
            self._store.register(get_types_from_msg(definition, kind))

    def has(self, kind: str) -> bool:
        """Return True if this kind of message is known."""
        return kind in self._store.types

    def add(self, kind: str, definition: str) -> None:
        """Add a kind of message, and those whose definitions follow; BadFrame unless it is complete."""
        from rosbags.typesys import TypesysError, get_types_from_msg

        try:
            self._store.register(get_types_from_msg(definition, kind))
            self._store.hash_rihs01(kind)
        except (TypesysError, KeyError) as error:
            raise BadFrame("malformed", f"definition of {kind}: {error}") from None

    def make(self, kind: str, *fields: Any) -> Any:
        """Make a message with these fields, in the order of its definition."""
        return self._store.types[kind](*fields)

    def header(self, stamp_ns: int, frame: str) -> Any:
        """Make a header of a time in ns since 1970, in a frame."""
        return self.make("std_msgs/msg/Header", self.time(stamp_ns), frame)

    def time(self, stamp_ns: int) -> Any:
        """Convert a time in ns since 1970 to ROS's Time."""
        return self.make("builtin_interfaces/msg/Time", stamp_ns // NS_PER_S, stamp_ns % NS_PER_S)

    def encode(self, kind: str, message: Any) -> bytes:
        """Encode a message as little-endian CDR, with its header of four bytes."""
        return bytes(self._store.serialize_cdr(message, kind, little_endian=True))

    def decode(self, kind: str, payload: bytes) -> Any:
        """Decode CDR of either endianness; BadFrame if it is no message of this kind."""
        try:
            return self._store.deserialize_cdr(payload, kind)
        except (self._fault, IndexError, AssertionError) as error:
            raise BadFrame("malformed", f"{kind}: {error}") from None

    def definition(self, kind: str) -> str:
        """Return the definitions of a kind of message and of the messages in it, as bags have them (ros2msg)."""
        return self._store.generate_msgdef(kind, ros_version=2)[0]

    def hash_of(self, kind: str) -> str:
        """Return the hash of a kind of message, as rmw_zenoh of the distribution writes it (REP 2016)."""
        return NO_HASH if self.distro == "humble" else self._store.hash_rihs01(kind)


def stamp_ns(header: Any) -> int:
    """Return the time of a header in ns since 1970."""
    return header.stamp.sec * NS_PER_S + header.stamp.nanosec


# Twist and TwistStamped, the commands of a base. CDR has two bytes of zero and endianness, two bytes of options, and
# the fields, each at a multiple of its size from the first field.


class Velocities(NamedTuple):
    """Commanded velocities of a base in its own frame."""

    linear_mps: float
    angular_radps: float  # positive to the left
    lateral_mps: float = 0.0  # positive to the left


def encode_twist(velocities: Velocities) -> bytes:
    """Encode a Twist, 52 bytes."""
    return LITTLE_ENDIAN + struct.pack(
        "<6d", velocities.linear_mps, velocities.lateral_mps, 0.0, 0.0, 0.0, velocities.angular_radps
    )


def encode_twist_stamped(velocities: Velocities, stamp_ns: int, frame: str) -> bytes:
    """Encode a TwistStamped of a time in ns since 1970."""
    name = frame.encode() + b"\0"
    seconds, nanoseconds = divmod(stamp_ns, NS_PER_S)
    head = struct.pack("<iII", seconds, nanoseconds, len(name)) + name
    return LITTLE_ENDIAN + head + bytes(-len(head) % 8) + encode_twist(velocities)[4:]


def decode_twist(payload: bytes) -> Velocities:
    """Decode a Twist; BadFrame for other bytes, or numbers that are not finite."""
    return _velocities(payload, TWIST_BYTES)


def decode_twist_stamped(payload: bytes) -> Velocities:
    """Decode a TwistStamped and ignore its time; BadFrame for other bytes, or numbers that are not finite."""
    if not TWIST_BYTES < len(payload) <= MAX_STAMPED_BYTES:
        raise BadFrame("malformed", f"{len(payload)} bytes are no TwistStamped")
    (length,) = struct.unpack_from(_order(payload) + "I", payload, 12)
    return _velocities(payload, 4 + (12 + length + 7) // 8 * 8 + 48)


def decode_either(payload: bytes) -> Velocities:
    """Decode a Twist or a TwistStamped, which is longer; BadFrame for other bytes, or numbers that are not finite."""
    return decode_twist(payload) if len(payload) < TWIST_BYTES + MAX_PADDING else decode_twist_stamped(payload)


def _velocities(payload: bytes, size: int) -> Velocities:
    """Decode the last six numbers of a message of `size` bytes."""
    if not size <= len(payload) < size + MAX_PADDING:
        raise BadFrame("malformed", f"expected {size} bytes, got {len(payload)}")
    numbers = struct.unpack_from(_order(payload) + "6d", payload, size - 48)
    if not all(map(isfinite, numbers)):
        raise BadFrame("malformed", "a velocity that is not finite")
    return Velocities(numbers[0], numbers[5], numbers[1])


def _order(payload: bytes) -> str:
    if payload[:2] not in (b"\x00\x00", b"\x00\x01"):
        raise BadFrame("malformed", "no CDR")
    return "<" if payload[1] else ">"
