"""The frames of a base as TFMessage, and its proximity sensors as Range.

The tree is odom, base_footprint, base_link, and a frame per sensor whose x axis is the sensor's direction (REP 105,
REP 103).
"""

from math import cos, inf, radians, sin
from typing import Any

import numpy as np

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.protocols.ros2.keys import RANGE, TRANSFORMS
from swarmwire.comms.protocols.ros2.messages import Messages
from swarmwire.comms.protocols.ros2.motion import BASE_FRAME, CHILD_FRAME, IMU_FRAME, FramePose, quaternion
from swarmwire.comms.protocols.ros2.readings import BUMPER_FRAME, CLIFF_FRAMES, topics_of_light
from swarmwire.comms.robot.bodies.body import Body
from swarmwire.comms.robot.sensors.rays import ProximitySpec

INFRARED = 1  # a constant of Range
FIELD_OF_VIEW_RAD = radians(15.0)  # proximity sensor, for drawing; the emulated sensor is a ray
FIRST_WITH_VARIANCE = "iron"  # first distribution in which Range has a variance


def sensor_frames(body: Body) -> tuple[FramePose, ...]:
    """Return the static frames: base, scanner and IMU, and proximity sensors and photocells at the rim."""
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
            FramePose(BASE_FRAME, name, *point) for name, point in zip(CLIFF_FRAMES, body.ground.points_m, strict=True)
        ]
    return tuple(frames)


def _at_rim(radius_m: float, names: tuple[str, ...], angles_rad: FloatArray) -> list[FramePose]:
    """Return a frame at the rim for each of these angles, which looks away from the body."""
    return [
        FramePose(BASE_FRAME, name, radius_m * cos(angle), radius_m * sin(angle), angle)
        for name, angle in zip(names, map(float, angles_rad), strict=True)
    ]


def transforms(messages: Messages, frames: tuple[FramePose, ...], stamp_ns: int) -> Any:
    """Return the TFMessage of these frames."""
    make = messages.make
    poses = [
        make(
            "geometry_msgs/msg/TransformStamped",
            messages.header(stamp_ns, frame.parent),
            frame.name,
            make(
                "geometry_msgs/msg/Transform",
                make("geometry_msgs/msg/Vector3", frame.x_m, frame.y_m, frame.z_m),
                quaternion(messages, frame.yaw_rad),
            ),
        )
        for frame in frames
    ]
    return make(TRANSFORMS, poses)


def proximity_topics(count: int) -> tuple[str, ...]:
    """Return the topic, and the frame, of each proximity sensor.

    >>> proximity_topics(2)
    ('proximity_0', 'proximity_1')
    """
    return tuple(f"proximity_{index}" for index in range(count))


def proximity_range(messages: Messages, spec: ProximitySpec, value: float, frame: str, stamp_ns: int) -> Any:
    """Return the Range of a proximity sensor that reads `value`: the distance from the rim with this reading.

    The distance is inf if the reading is nothing, or so small that noise alone can cause it.
    """
    max_noise = spec.noise + 0.5 * spec.step
    distance_m = float(spec.response.distance_m(np.array(value))) if value > max_noise else inf
    fields = (INFRARED, FIELD_OF_VIEW_RAD, 0.0, spec.range_m, distance_m)
    variance = () if messages.distro < FIRST_WITH_VARIANCE else (0.0,)  # 0: unknown
    return messages.make(RANGE, messages.header(stamp_ns, frame), *fields, *variance)
