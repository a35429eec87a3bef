"""The tables of [robots.<group>.motion]: sources of the poses of robots that others move."""

from typing import Annotated, Any, Literal

from pydantic import Field

from swarmwire.world.scenario.tables import Point, ScenarioTable


class TraceMotion(ScenarioTable):
    """Poses of a file: a trace of BonnMotion, ns-2, EMANE or ROS 2, a table, or a recorded run."""

    source: Literal["trace"]
    """Poses of a file, which the robots follow in every arena."""
    file: str = Field(min_length=1)
    """Path, relative to the scenario: .movements, .movements.gz, .tcl, .ns_movements, .eel, .csv, .parquet,
    .mcap, .db3, or the folder of a run or of rosbag2."""
    robots: tuple[str, ...] = Field(default=(), strict=False)
    """Names or numbers of the file's robots, in the order of the group's; default: all, in the file's order."""
    start_s: float = Field(default=0.0, ge=-1e9, le=1e9, json_schema_extra={"unit": "s"})
    """Time in the file at which the run starts."""
    offset_m: Point = (0.0, 0.0)
    """Added to the file's x and y; files of BonnMotion and ns-2 begin at a corner, an arena's origin is its centre."""
    origin: Annotated[tuple[float, float, float], Field(strict=False)] | None = None
    """Latitude and longitude in degrees and altitude in m of the arena's origin; only, and always, for .eel."""


class CustomMotion(ScenarioTable):
    """Poses of a class of the user."""

    source: Literal["custom"]
    """Poses of a class of the user."""
    kind: str = Field(min_length=1)
    """The class, as module:Class or file.py:Class, below swarmwire.world.motion.source.PoseSource."""
    params: dict[str, Any] = Field(default_factory=dict)
    """Its parameters."""


class _LiveMotion(ScenarioTable):
    """Poses as they arrive; only in real time, with one seed."""

    max_age_s: float = Field(default=1.0, gt=0, le=3600, json_schema_extra={"unit": "s"})
    """A robot without a new pose for this time counts as silent; it keeps its last pose."""
    max_speed_mps: float = Field(default=100.0, gt=0, le=1e5, json_schema_extra={"unit": "m/s"})
    """A pose that is farther from the last one than this speed allows is a jump: it is counted and ignored. Without
    stamps the time between them may have been 0.1 s more than between their arrivals."""
    stamps: bool = False
    """Whether the stamps of messages order and time the poses, in place of their arrival: a pose with an older stamp
    than the last one is late: it is counted and ignored, and jumps are judged by the time between stamps."""
    wait_s: float = Field(default=30.0, gt=0, le=86_400, json_schema_extra={"unit": "s"})
    """Time for which the run waits for the first pose of each robot."""


class UdpMotion(_LiveMotion):
    """Poses by UDP, one JSON object a datagram."""

    source: Literal["udp"]
    """Poses by UDP, one JSON object a datagram."""
    listen: str = Field(default="127.0.0.1:9870", min_length=1)
    """Address and port on which they are received; port 0: a free port, which the run prints."""


class MavlinkMotion(_LiveMotion):
    """Poses of MAVLink by UDP, as PX4, ArduPilot and their simulators send them."""

    source: Literal["mavlink"]
    """Poses of MAVLink by UDP, as PX4, ArduPilot and their simulators send them."""
    listen: str = Field(default="127.0.0.1:14550", min_length=1)
    """Address and port on which they are received, also in the spelling of pymavlink, "udpin:127.0.0.1:14550"."""
    systems: tuple[Annotated[int, Field(ge=1, le=255)], ...] = Field(default=(), strict=False)
    """System ids of the vehicles, in the order of the group's robots; default: 1, 2, …"""
    origin: Annotated[tuple[float, float, float], Field(strict=False)] | None = None
    """Latitude and longitude in degrees and altitude in m of the arena's origin, for positions of GLOBAL_POSITION_INT;
    default: positions are those of LOCAL_POSITION_NED."""


class TrackerMotion(_LiveMotion):
    """Poses of a tracker on the robots' network, such as a camera above a real arena."""

    source: Literal["zenoh"]
    """Poses on the key pose/NAME of a swarm's network, as a tracker publishes them."""
    swarm: str = Field(min_length=1)
    """Name of the swarm."""
    listen: tuple[str, ...] = Field(default=(), strict=False)
    """Endpoints at which the tracker connects, such as "tcp/127.0.0.1:7447"."""
    connect: tuple[str, ...] = Field(default=(), strict=False)
    """Endpoints at which the tracker listens."""


class Ros2Motion(_LiveMotion):
    """Poses of ROS 2 topics, over zenoh."""

    source: Literal["ros2"]
    """Poses of ROS 2 topics, over zenoh."""
    type: Literal["nav_msgs/msg/Odometry", "geometry_msgs/msg/PoseStamped", "tf2_msgs/msg/TFMessage"] = (
        "nav_msgs/msg/Odometry"
    )
    """Type of the messages."""
    topic: str | None = Field(default=None, min_length=1)
    """Name of each robot's topic, with {name}, {index} or {number}; default: by type "/{name}/odom", "/{name}/pose" or
    "/tf"."""
    frame: str = Field(default="{name}/base_link", min_length=1)
    """Each robot's frame in messages of the type TFMessage, with {name}, {index} or {number}."""
    parent: str = Field(default="map", min_length=1)
    """Parent of these frames, which is the arena's frame; transforms to other parents are ignored."""
    namespace: str = Field(default="/{name}", min_length=1)
    """Namespace of each robot's nodes, with {name}, {index} or {number}, for topics that cross the radio."""
    transport: Literal["bridge", "rmw"] = "rmw"
    """The nodes' connection to zenoh: zenoh-bridge-ros2dds or rmw_zenoh."""
    domain: int = Field(default=0, ge=0, le=232)
    """ROS_DOMAIN_ID of rmw_zenoh."""
    distro: Literal["humble", "iron", "jazzy", "kilted", "lyrical"] = "jazzy"
    """Distribution of ROS 2 of the nodes."""
    connect: tuple[str, ...] = Field(default=(), strict=False)
    """Endpoints of routers or bridges; default without `listen`: "tcp/127.0.0.1:7447"."""
    listen: tuple[str, ...] = Field(default=(), strict=False)
    """Endpoints at which nodes, routers or bridges connect."""


LiveMotion = UdpMotion | MavlinkMotion | TrackerMotion | Ros2Motion
MotionTable = Annotated[TraceMotion | CustomMotion | LiveMotion, Field(discriminator="source")]
