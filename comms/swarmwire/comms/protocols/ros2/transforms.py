"""The frames of a base as TFMessage, and its proximity sensors as Range.

The tree is odom, base_footprint, base_link, and a frame per sensor, x pointing to where it looks (REP 105, REP 103).
"""

from math import cos, inf, radians, sin
from typing import Any, NamedTuple

import numpy as np

from swarmwire.comms.base.angles import wrap_angle
from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.protocols.ros2.keys import RANGE, TRANSFORMS
from swarmwire.comms.protocols.ros2.messages import Messages
from swarmwire.comms.protocols.ros2.motion import BASE_FRAME, CHILD_FRAME, IMU_FRAME, ODOMETRY_FRAME, quaternion
from swarmwire.comms.protocols.ros2.readings import BUMPER_FRAME, CLIFF_FRAMES, topics_of_light
from swarmwire.comms.robot.bodies.body import Body
from swarmwire.comms.robot.sensors.rays import ProximitySpec

INFRARED = 1  # a constant of Range
FIELD_OF_VIEW_RAD = radians(15.0)  # of a proximity sensor, for drawing: the emulated one is a ray
FIRST_WITH_VARIANCE = "iron"


class FramePose(NamedTuple):
    """Where a frame is in its parent."""

    parent: str
    name: str
    x_m: float = 0.0
    y_m: float = 0.0
    yaw_rad: float = 0.0


def odometry_frame(x_m: float, y_m: float, yaw_rad: float) -> FramePose:
    """Where the wheels say that the base is."""
    return FramePose(ODOMETRY_FRAME, CHILD_FRAME, x_m, y_m, wrap_angle(yaw_rad))


def sensor_frames(body: Body) -> tuple[FramePose, ...]:
    """The frames that never move: the base, its scanner and IMU, and proximity sensors and photocells at its rim."""
    frames = [FramePose(CHILD_FRAME, BASE_FRAME)]
    if body.scan:
        frames.append(
            FramePose(BASE_FRAME, body.ros2.scan_frame, body.scan.at_m, 0.0, radians(body.ros2.scan_frame_deg))
        )
    if "imu" in body.sensors or "compass" in body.sensors:
        frames.append(FramePose(BASE_FRAME, IMU_FRAME))
    if body.proximity:
        frames += _at_rim(body.radius_m, proximity_topics(len(body.proximity.angle_rad)), body.proximity.angle_rad)
    if body.light:
        topics = topics_of_light("illuminance", len(body.light.angle_rad))
        frames += _at_rim(body.radius_m, topics, body.light.angle_rad)
    if body.ros2.create3 and body.ground:
        frames.append(FramePose(BASE_FRAME, BUMPER_FRAME, body.radius_m))
        frames += [
            FramePose(BASE_FRAME, name, *at) for name, at in zip(CLIFF_FRAMES, body.ground.points_m, strict=True)
        ]
    return tuple(frames)


def _at_rim(radius_m: float, names: tuple[str, ...], angles_rad: FloatArray) -> list[FramePose]:
    """A frame for each of these angles at the rim, which looks away from the body."""
    return [
        FramePose(BASE_FRAME, name, radius_m * cos(angle), radius_m * sin(angle), angle)
        for name, angle in zip(names, map(float, angles_rad), strict=True)
    ]


def transforms(messages: Messages, frames: tuple[FramePose, ...], stamp_ns: int) -> Any:
    """The TFMessage of these frames."""
    make = messages.make
    moved = [
        make(
            "geometry_msgs/msg/TransformStamped",
            messages.header(stamp_ns, frame.parent),
            frame.name,
            make(
                "geometry_msgs/msg/Transform",
                make("geometry_msgs/msg/Vector3", frame.x_m, frame.y_m, 0.0),
                quaternion(messages, frame.yaw_rad),
            ),
        )
        for frame in frames
    ]
    return make(TRANSFORMS, moved)


def proximity_topics(count: int) -> tuple[str, ...]:
    """The topic, and the frame, of each proximity sensor.

    >>> proximity_topics(2)
    ('proximity_0', 'proximity_1')
    """
    return tuple(f"proximity_{place}" for place in range(count))


def proximity_range(messages: Messages, spec: ProximitySpec, value: float, frame: str, stamp_ns: int) -> Any:
    """The Range of a proximity sensor that reads `value`: the distance from the rim at which it does.

    inf: nothing, which is also each reading that noise alone can make.
    """
    of_nothing = spec.noise + 0.5 * spec.step
    distance_m = float(spec.response.distance_m(np.array(value))) if value > of_nothing else inf
    fields = (INFRARED, FIELD_OF_VIEW_RAD, 0.0, spec.range_m, distance_m)
    variance = () if messages.distro < FIRST_WITH_VARIANCE else (0.0,)  # 0: not known
    return messages.make(RANGE, messages.header(stamp_ns, frame), *fields, *variance)
