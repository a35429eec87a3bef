"""The topics of emulated ROS 2 bases that follow from the travel of their wheels."""

from collections.abc import Callable
from math import isnan
from typing import Any

from swarmwire.comms.protocols.ros2.keys import DEFAULT_QOS, JOINT_STATE, ODOMETRY, TRANSFORMS, Qos
from swarmwire.comms.protocols.ros2.messages import STOP_STATUS, WHEEL_TICKS, WHEEL_VELS, Messages
from swarmwire.comms.protocols.ros2.motion import WheelPoses, joint_state, odometry_frame
from swarmwire.comms.protocols.ros2.readings import stop_status, wheel_ticks, wheel_vels
from swarmwire.comms.protocols.ros2.transforms import transforms
from swarmwire.comms.robot.bodies.body import Body
from swarmwire.comms.robot.bodies.drives import wheel_base_of, wheel_radius_of
from swarmwire.comms.robot.sensors.simple import OdometrySpec
from swarmwire.world.gateways.ros2.base import Broadcaster, Fields

TRANSFORMS_QOS = Qos(depth=100)  # tf2_ros: qos.hpp
# Arguments: messages, poses, row of a base, stamp (ns since 1970).
MakeMessage = Callable[
    [Messages, WheelPoses, int, int], Any
]  # the integers are a base's row and a stamp, ns since 1970


class OdometryBroadcaster(Broadcaster):
    """`odometry` as Odometry: the pose by the wheels.

    Attributes:
        poses: poses of all bases.
    """

    kind = ODOMETRY
    reads = ("odometry.left_m", "odometry.right_m")
    topic = "odom"

    def __init__(self, spec: OdometrySpec, bases: int, wheel_base_m: float) -> None:
        self.rate_hz = spec.rate_hz
        self.poses = WheelPoses(bases, wheel_base_m, spec)

    def follow(self, time_ns: int, fields: Fields) -> None:
        """See `Broadcaster.follow`."""
        self.poses.add(time_ns, fields["odometry.left_m"], fields["odometry.right_m"])

    def message(self, messages: Messages, fields: Fields, base: int, stamp_ns: int) -> Any | None:
        """See `Broadcaster.message`."""
        return None if self.is_lost(fields, base) else self.poses.message(messages, base, stamp_ns)

    def is_lost(self, fields: Fields, base: int) -> bool:
        """Return True if the reading of a base was lost."""
        return isnan(fields["odometry.left_m"][base] + fields["odometry.right_m"][base])


class WheelBroadcaster(Broadcaster):
    """Another message of the same poses."""

    reads = OdometryBroadcaster.reads

    def __init__(self, topic: str, kind: str, odometry: OdometryBroadcaster, make: MakeMessage) -> None:
        """`odometry` must be published earlier in each tick."""
        self.topic, self.kind, self.rate_hz = topic, kind, odometry.rate_hz
        self.qos = TRANSFORMS_QOS if kind == TRANSFORMS else DEFAULT_QOS
        self._odometry, self._make = odometry, make

    def message(self, messages: Messages, fields: Fields, base: int, stamp_ns: int) -> Any | None:
        """See `Broadcaster.message`."""
        if self._odometry.is_lost(fields, base):
            return None
        return self._make(messages, self._odometry.poses, base, stamp_ns)


def wheel_broadcasters(body: Body, bases: int) -> list[Broadcaster]:
    """Return the topics of bases with this body; [] without wheels or encoders."""
    wheel_base_m, radius_m = wheel_base_of(body.drive), wheel_radius_of(body.drive)
    if not body.odometry or not wheel_base_m:
        return []
    odometry = OdometryBroadcaster(body.odometry, bases, wheel_base_m)
    makers: dict[str, tuple[str, MakeMessage]] = {"tf": (TRANSFORMS, _transform)}
    if radius_m:
        makers["joint_states"] = (
            JOINT_STATE,
            lambda messages, poses, base, stamp_ns: joint_state(
                messages, body.ros2, poses.travel_m[base], poses.wheel_mps[base], radius_m, stamp_ns
            ),
        )
    if body.ros2.create3:
        makers |= _create3_makers(radius_m)
    return [odometry, *(WheelBroadcaster(topic, kind, odometry, make) for topic, (kind, make) in makers.items())]


def _transform(messages: Messages, poses: WheelPoses, base: int, stamp_ns: int) -> Any:
    return transforms(messages, (odometry_frame(*map(float, poses.pose[base])),), stamp_ns)


def _create3_makers(radius_m: float) -> dict[str, tuple[str, MakeMessage]]:
    """Return the topics of a Create 3 with wheels of this radius, each with its kind."""
    return {
        "wheel_ticks": (
            WHEEL_TICKS,
            lambda messages, poses, base, stamp_ns: wheel_ticks(messages, poses.travel_m[base], radius_m, stamp_ns),
        ),
        "wheel_vels": (
            WHEEL_VELS,
            lambda messages, poses, base, stamp_ns: wheel_vels(messages, poses.wheel_mps[base], radius_m, stamp_ns),
        ),
        "stop_status": (
            STOP_STATUS,
            lambda messages, poses, base, stamp_ns: stop_status(
                messages, stopped=not poses.wheel_mps[base].any(), stamp_ns=stamp_ns
            ),
        ),
    }
