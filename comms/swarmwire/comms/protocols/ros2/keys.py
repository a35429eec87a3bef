"""ROS 2 over zenoh: message types, names, keys, liveliness tokens and attachments of its two zenoh transports.

Both transports carry raw CDR. zenoh-bridge-ros2dds: a message travels under the full name of its topic without the
first slash; tokens announce topics to other bridges (zenoh-plugin-ros2dds: ros2_utils.rs, liveliness_mgt.rs).
rmw_zenoh: a message travels under domain, full name of the topic, type and its hash; tokens form the ROS graph for
`ros2 topic list`, and messages arrive without them (rmw_zenoh: docs/design.md, liveliness_utils.cpp).
"""

import re
import struct
from collections.abc import Sequence
from dataclasses import dataclass

from swarmwire.comms.base.errors import BadFrame, BadInput
from swarmwire.comms.base.extras import ROS2

TWIST = "geometry_msgs/msg/Twist"  # commanded velocities of a base
TWIST_STAMPED = "geometry_msgs/msg/TwistStamped"  # a Twist with the time of the command
LASER_SCAN = "sensor_msgs/msg/LaserScan"  # distances on the rays of a scanner
ODOMETRY = "nav_msgs/msg/Odometry"  # pose of a base, computed from its wheels
POSE_STAMPED = "geometry_msgs/msg/PoseStamped"  # pose in a frame, with its time
JOINT_STATE = "sensor_msgs/msg/JointState"  # angles and speeds of wheels
IMU = "sensor_msgs/msg/Imu"  # acceleration, turn rate, orientation
BATTERY_STATE = "sensor_msgs/msg/BatteryState"  # voltage and charge
ILLUMINANCE = "sensor_msgs/msg/Illuminance"  # reading of a photocell, in lux
CLOCK = "rosgraph_msgs/msg/Clock"  # simulated time
BYTES = "std_msgs/msg/UInt8MultiArray"  # bytes, with the names of their dimensions
TRANSFORMS = "tf2_msgs/msg/TFMessage"  # poses of frames in their parents
RANGE = "sensor_msgs/msg/Range"  # distance that a proximity sensor measures

RADIO_TOPICS = "radio/"  # topics of a robot's radio, in its namespace
TOKEN = r"(?!.*__)[A-Za-z_][A-Za-z0-9_]*"
NAME = re.compile(rf"/?{TOKEN}(?:/{TOKEN})*")
READ, WRITE = "MS", "MP"  # the two directions of a topic in a token
ANY = "*"
MAX_TOPICS = 10_000  # topics of a node; ids of nodes and topics are integers, unique in a session
LAYOUT = struct.Struct("<qqB16s")  # attachment of a message
ID_BYTES = 16
RMW_DEPTH = 42  # default depth of rmw_zenoh, which its tokens leave out


@dataclass(frozen=True)
class Qos:
    """Quality of service of a topic: always reliable, with a history of the last messages. Defaults are ROS's."""

    depth: int = 10  # number of messages in the history
    latched: bool = False  # transient local: later subscribers get the history

    @property
    def rmw(self) -> str:
        """QoS in tokens of rmw_zenoh, which leave out its default values (liveliness_utils.cpp, qos.cpp)."""
        return f":{1 if self.latched else ''}:,{'' if self.depth == RMW_DEPTH else self.depth}:,:,:,,"

    @property
    def bridge(self) -> str:
        """QoS in tokens of bridges: no key, reliable, durability, a history of the last `depth` messages."""
        return f":1:{int(self.latched)}:0,{self.depth}"


DEFAULT_QOS = Qos()


def dds_kind(kind: str) -> str:
    """Return the DDS name of a kind of message, which is part of rmw_zenoh's keys.

    >>> dds_kind("geometry_msgs/msg/Twist")
    'geometry_msgs::msg::dds_::Twist_'
    """
    package, folder, name = kind.split("/")
    return f"{package}::{folder}::dds_::{name}_"


def ros_name(robot: str) -> str:
    """Convert the name of a robot to a ROS name: letters, digits and single underscores, no digit first.

    >>> ros_name("flock-0"), ros_name("7.left")
    ('flock_0', 'r7_left')
    """
    name = re.sub(r"[^A-Za-z0-9]+", "_", robot)
    return f"r{name}" if name[:1].isdigit() else name


def ros_names(robots: Sequence[str], where: str) -> tuple[str, ...]:
    """Return the ROS names of robots; BadInput with `where` if two are equal."""
    names = tuple(map(ros_name, robots))
    for robot, name in zip(robots, names, strict=True):
        if names.count(name) > 1:
            raise BadInput(where, robot, f"expected names that differ in ROS, where this robot is called {name}")
    return names


def absolute(namespace: str, topic: str) -> str:
    """Return the full name of a topic: within the namespace, unless the topic starts with a slash.

    >>> absolute("flock_0", "scan"), absolute("/", "scan"), absolute("flock_0", "/clock")
    ('/flock_0/scan', '/scan', '/clock')
    """
    return topic if topic.startswith("/") else "/" + "/".join(filter(None, (namespace.strip("/"), topic)))


def check_name(name: str, where: str, key: str) -> None:
    """Raise BadInput with `where` and `key` unless the name is valid in ROS 2."""
    if not NAME.fullmatch(name):
        raise BadInput(where, key, f"expected a ROS name such as scan or robot_1/scan, got {name!r}")


def bridge_key(topic: str) -> str:
    """Return the key of a topic with this full name.

    >>> bridge_key("/flock_0/scan")
    'flock_0/scan'
    """
    return topic.removeprefix("/")


def bridge_token(zid: str, direction: str, topic: str, kind: str, type_hash: str, qos: Qos = DEFAULT_QOS) -> str:
    """Return the token of a topic that the bridge with this zenoh id writes or reads (READ or WRITE, seen from ROS)."""
    names = "/".join(part.replace("/", "§") for part in (bridge_key(topic), kind))
    return f"{bridge_itself(zid)}/{direction}/{names}/{qos.bridge}:typehash={type_hash};"


def bridge_itself(zid: str) -> str:
    """Return the token of the bridge with this zenoh id."""
    return f"@/{zid}/@ros2_lv"


def rmw_key(domain: int, topic: str, kind: str, type_hash: str = ANY) -> str:
    """Return the key of a topic with this full name; with ANY in place of its hash, a key to subscribe to.

    >>> rmw_key(0, "/cmd_vel", "geometry_msgs/msg/Twist", "RIHS01_9c45")
    '0/cmd_vel/geometry_msgs::msg::dds_::Twist_/RIHS01_9c45'
    """
    return f"{domain}{topic}/{dds_kind(kind)}/{type_hash}"


@dataclass(frozen=True)
class RmwNode:
    """A node of the ROS graph, with the facts in its tokens."""

    domain: int
    zid: str  # id of the zenoh session
    index: int  # index among the nodes of the session
    namespace: str  # "/flock_0", "/" for none
    name: str

    @property
    def token(self) -> str:
        """Token of the node itself."""
        return self._token(0, "NN")

    def topic_token(
        self, number: int, direction: str, topic: str, kind: str, type_hash: str, qos: Qos = DEFAULT_QOS
    ) -> str:
        """Return the token of a topic that the node writes (MP) or reads (MS); `number` counts topics from 1."""
        return f"{self._token(number, direction)}/{_mangled(topic)}/{dds_kind(kind)}/{type_hash}/{qos.rmw}"

    def _token(self, number: int, direction: str) -> str:
        node = self.index * MAX_TOPICS
        namespace = _mangled(self.namespace)
        return f"@ros2_lv/{self.domain}/{self.zid}/{node}/{node + number}/{direction}/%/{namespace}/{self.name}"


def _mangled(name: str) -> str:
    return name.replace("/", "%")


# rmw_zenoh attaches to each message the sequence number and the source time as little-endian int64, then the
# publisher's id of 16 bytes, as zenoh's serializer writes them: 33 bytes. A subscriber drops messages without it.
# (rmw_zenoh: attachment_helpers.cpp.)


def publisher_id(token: str) -> bytes:
    """Return the id (gid) of the publisher with this liveliness token: its XXH3-128, 16 bytes, low half first.

    rmw_zenoh: liveliness_utils.cpp; the digest of the library has the highest byte first.
    """
    ROS2.need("ros2")
    from xxhash import xxh3_128_digest

    return xxh3_128_digest(token.encode())[::-1]


def attachment(sequence: int, utc_ns: int, publisher: bytes) -> bytes:
    """Return the attachment of a message; `publisher` is its `publisher_id`."""
    return LAYOUT.pack(sequence, utc_ns, ID_BYTES, publisher)


def check_attachment(attached: bytes | None) -> None:
    """Raise BadFrame unless a message has an attachment of the right layout."""
    if attached is None or len(attached) != LAYOUT.size or attached[16] != ID_BYTES:
        size = 0 if attached is None else len(attached)
        raise BadFrame("no_attachment", f"expected an attachment of {LAYOUT.size} bytes, got {size}")
