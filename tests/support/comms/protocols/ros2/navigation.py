"""What tf2, slam_toolbox and Nav2 demand of a base's messages, as their sources check it.

Read from geometry2 1b005c65, slam_toolbox a3442d2f, navigation2 a3a97043 and laser_geometry 22f3aa94. Messages are
those of the independent library. Each check returns the names of faults; the names of tf2 are its own.
"""

# pycdr2 has arrays for types that are lists in fact:
# pyright: reportGeneralTypeIssues=false, reportIndexIssue=false, reportArgumentType=false

from collections.abc import Iterable
from dataclasses import dataclass, field
from itertools import pairwise
from math import atan2, cos, hypot, isfinite, pi, sin

import numpy as np

from tests.support.comms.protocols.ros2.independent import (
    Clock,
    Header,
    LaserScan,
    Odometry,
    Quaternion,
    TFMessage,
    TransformStamped,
    stamp_ns,
)

Pose = tuple[float, float, float]  # x and y in m, yaw in rad
ODOM, BASES = "odom", ("base_footprint", "base_link")


@dataclass
class Recording:
    """The messages of one base, in the order in which they came."""

    scans: list[LaserScan] = field(default_factory=list)
    odometry: list[Odometry] = field(default_factory=list)
    moved: list[TFMessage] = field(default_factory=list)  # tf
    still: list[TFMessage] = field(default_factory=list)  # tf_static
    clock: list[Clock] = field(default_factory=list)


class TransformBuffer:
    """The transforms of a recording as tf2's BufferCore keeps and looks them up (buffer_core.cpp, cache.cpp).

    Attributes:
        faults: of what was inserted.
    """

    def __init__(self, recording: Recording) -> None:
        self.faults: list[str] = []
        self._parents: dict[str, str] = {}
        self._still: dict[str, Pose] = {}
        self._moved: dict[str, list[tuple[int, Pose]]] = {}
        for message in recording.still:
            for transform in message.transforms:
                if self._is_taken(transform):
                    self._still[transform.child_frame_id] = _pose(transform)
        for message in recording.moved:
            for transform in message.transforms:
                if self._is_taken(transform):
                    self._insert(transform)

    def lookup(self, target: str, source: str, at_ns: int) -> Pose:
        """Where `source` is in `target` at this time; KeyError with tf2's exception where it raises one."""
        to_target = self._to_root(target, at_ns)
        to_source = self._to_root(source, at_ns)
        if to_target[0] != to_source[0]:
            raise KeyError("ConnectivityException")
        return combined(inverse(to_target[1]), to_source[1])

    def _is_taken(self, transform: TransformStamped) -> bool:
        """As setTransformImpl decides."""
        parent, child = transform.header.frame_id, transform.child_frame_id
        where, turn = transform.transform.translation, transform.transform.rotation
        paths = {
            "TF_SELF_TRANSFORM": parent == child,
            "TF_NO_CHILD_FRAME_ID": not child,
            "TF_NO_FRAME_ID": not parent,
            "TF_NAN_INPUT": not all(map(isfinite, (where.x, where.y, where.z, turn.x, turn.y, turn.z, turn.w))),
            "TF_DENORMALIZED_QUATERNION": not abs(_length2(turn) - 1.0) < 10e-3,
            "two parents": self._parents.setdefault(child, parent) != parent,
        }
        self.faults += [name for name, is_so in paths.items() if is_so]
        return not any(paths.values())

    def _insert(self, transform: TransformStamped) -> None:
        """tf2 refuses what is older than its buffer; a base whose stamps fall or repeat is faulty at once."""
        transforms = self._moved.setdefault(transform.child_frame_id, [])
        at_ns = stamp_ns(transform.header)
        if transforms and at_ns <= transforms[-1][0]:
            self.faults.append("TF_OLD_DATA")
            return
        transforms.append((at_ns, _pose(transform)))

    def _to_root(self, frame: str, at_ns: int) -> tuple[str, Pose]:
        pose = (0.0, 0.0, 0.0)
        if frame not in self._parents and frame not in self._parents.values():
            raise KeyError("LookupException")
        while frame in self._parents:
            step = self._still[frame] if frame in self._still else self._at(frame, at_ns)
            frame, pose = self._parents[frame], combined(step, pose)
        return frame, pose

    def _at(self, frame: str, at_ns: int) -> Pose:
        transforms = self._moved[frame]
        if not transforms[0][0] <= at_ns <= transforms[-1][0]:
            raise KeyError("ExtrapolationException")
        after = next(i for i, (stamp, _) in enumerate(transforms) if stamp >= at_ns)
        (late_ns, late), (early_ns, early) = transforms[after], transforms[max(after - 1, 0)]
        share = 1.0 if late_ns == early_ns else (at_ns - early_ns) / (late_ns - early_ns)
        turn = (late[2] - early[2] + pi) % (2 * pi) - pi
        return (
            early[0] + share * (late[0] - early[0]),
            early[1] + share * (late[1] - early[1]),
            early[2] + share * turn,
        )


def faults_of(recording: Recording, max_laser_range_m: float, fastest_mps: float) -> list[str]:
    """The faults of a recording of a base that drives no faster than this; empty: all checks pass."""
    buffer = TransformBuffer(recording)
    faults = list(buffer.faults)
    for scan in recording.scans:
        faults += faults_for_slam_toolbox(scan, buffer, max_laser_range_m)
        faults += faults_for_nav2(scan, buffer)
    for message in recording.odometry:
        faults += faults_of_odometry(message, buffer)
    return faults + faults_of_order(recording) + faults_of_conventions(recording, fastest_mps)


def faults_for_slam_toolbox(scan: LaserScan, buffer: TransformBuffer, max_laser_range_m: float) -> list[str]:
    """slam_toolbox: slam_toolbox_common.cpp, laser_utils.cpp, get_pose_helper.hpp; Karto.h and Karto.cpp in it."""
    faults = _faults_of_header(scan.header)
    for base in BASES:  # base_footprint is its default, base_link that of TurtleBots
        faults += _faults_of_lookup(buffer, ODOM, base, stamp_ns(scan.header))  # getOdomPose, MessageFilter
        faults += _faults_of_lookup(buffer, base, scan.header.frame_id, stamp_ns(scan.header))  # isInverted
    span, step = np.float32(scan.angle_max) - np.float32(scan.angle_min), np.float32(scan.angle_increment)
    if not step > 0.0:
        return [*faults, "angle_increment"]
    is_full_circle = bool(abs(abs(span) - np.float32(2 * pi)) < step - np.finfo(np.float32).eps * 2 * pi)
    is_full_circle &= not (span > 6.10865 and np.round(span / step) + 1 == len(scan.ranges))
    expected = np.round(float(span) / float(step)) + (not is_full_circle)
    faults += [] if len(scan.ranges) == expected else ["number of range readings"]  # LaserRangeFinder::Validate
    threshold_m = min(max_laser_range_m, scan.range_max)
    faults += [] if scan.range_min <= threshold_m <= scan.range_max else ["range threshold"]
    return faults


def faults_for_nav2(scan: LaserScan, buffer: TransformBuffer) -> list[str]:
    """Nav2: amcl_node.cpp (range_max), obstacle_layer.cpp by way of laser_geometry.cpp (transforms of both ends)."""
    faults = [] if scan.range_max > 0.0 else ["range_max"]
    end_ns = stamp_ns(scan.header) + round(1e9 * (len(scan.ranges) - 1) * scan.time_increment)
    for at_ns in (stamp_ns(scan.header), end_ns):
        faults += _faults_of_lookup(buffer, ODOM, scan.header.frame_id, at_ns)
    return faults


def faults_of_odometry(message: Odometry, buffer: TransformBuffer) -> list[str]:
    """Nav2: validate_messages.hpp for header and pose; REP 105: tf has the pose that odometry has.

    A covariance must be one, within validate_messages.hpp's 1e9; that file, which is not for odometry, refuses all
    negative numbers, also between x and y.
    """
    pose, turn = message.pose.pose, message.pose.pose.orientation
    faults = _faults_of_header(message.header)
    faults += [] if abs(_length2(turn) - 1.0) < 1e-4 else ["orientation"]
    for covariance in (message.pose.covariance, message.twist.covariance):
        matrix = np.reshape(covariance, (6, 6))
        is_one = np.allclose(matrix, matrix.T) and np.linalg.eigvalsh(matrix).min() > 0.0 and matrix.max() <= 1e9
        faults += [] if is_one else ["covariance"]
    try:
        moved = buffer.lookup(message.header.frame_id, message.child_frame_id, stamp_ns(message.header))
    except KeyError as error:
        return [*faults, str(error.args[0])]
    apart = (*np.subtract(moved[:2], (pose.position.x, pose.position.y)), sin(moved[2] - _yaw(turn)))
    return faults if np.abs(apart).max() < 1e-6 else [*faults, "odometry and tf differ"]


def faults_of_order(recording: Recording) -> list[str]:
    """Stamps rise in each topic; with use_sim_time they are not ahead of the clock."""
    clock = [message.clock.sec * 10**9 + message.clock.nanosec for message in recording.clock]
    scans = [stamp_ns(message.header) for message in recording.scans]
    ordered = (scans, clock, [stamp_ns(message.header) for message in recording.odometry])
    faults = [] if all(_rises(stamps) for stamps in ordered) else ["stamps do not rise"]
    return faults if max(scans) <= max(clock) else [*faults, "ahead of the clock"]


def faults_of_conventions(recording: Recording, fastest_mps: float) -> list[str]:
    """REP 103: x is ahead, turns are counter-clockwise; REP 105: the pose in odom is continuous."""
    faults: list[str] = []
    for first, other in pairwise(recording.odometry):
        pose, next_pose = first.pose.pose, other.pose.pose
        for_s = (stamp_ns(other.header) - stamp_ns(first.header)) / 1e9
        by_m = next_pose.position.x - pose.position.x, next_pose.position.y - pose.position.y
        turned = (_yaw(next_pose.orientation) - _yaw(pose.orientation) + pi) % (2 * pi) - pi
        course = _yaw(pose.orientation) + 0.5 * turned
        twist = other.twist.twist
        if hypot(*by_m) > 1.2 * fastest_mps * for_s + 1e-3:
            faults.append("a jump in odom")
        if abs(by_m[0] * cos(course) + by_m[1] * sin(course) - twist.linear.x * for_s) > 1e-3:
            faults.append("x is not ahead")
        if abs(turned - twist.angular.z * for_s) > 1e-3:
            faults.append("turns are not counter-clockwise")
    return faults


def points_in(buffer: TransformBuffer, scan: LaserScan, frame: str) -> np.ndarray:
    """The returns of a scan as points (n, 2) in a frame, as laser_geometry projects them."""
    range_m = np.asarray(scan.ranges, np.float64)
    hits = np.flatnonzero((range_m >= scan.range_min) & (range_m <= scan.range_max))
    angle = scan.angle_min + scan.angle_increment * hits
    x_m, y_m, yaw = buffer.lookup(frame, scan.header.frame_id, stamp_ns(scan.header))
    return np.stack([x_m + range_m[hits] * np.cos(yaw + angle), y_m + range_m[hits] * np.sin(yaw + angle)], axis=1)


def combined(outer: Pose, inner: Pose) -> Pose:
    """The pose `inner`, which is in the frame of `outer`, in that one's parent."""
    c, s = cos(outer[2]), sin(outer[2])
    return outer[0] + c * inner[0] - s * inner[1], outer[1] + s * inner[0] + c * inner[1], outer[2] + inner[2]


def inverse(pose: Pose) -> Pose:
    """The pose of the parent in the frame of this pose."""
    c, s = cos(pose[2]), sin(pose[2])
    return -c * pose[0] - s * pose[1], s * pose[0] - c * pose[1], -pose[2]


def _faults_of_header(header: Header) -> list[str]:
    """validate_messages.hpp, and EmptyFrameID of tf2_ros' message_filter.h; tf2 has no frames with a slash in front."""
    fine = header.frame_id and not header.frame_id.startswith("/") and header.stamp.nanosec < 10**9
    return [] if fine else ["header"]


def _faults_of_lookup(buffer: TransformBuffer, target: str, source: str, at_ns: int) -> list[str]:
    try:
        buffer.lookup(target, source, at_ns)
    except KeyError as error:
        return [str(error.args[0])]
    return []


def _pose(transform: TransformStamped) -> Pose:
    where = transform.transform.translation
    return where.x, where.y, _yaw(transform.transform.rotation)


def _yaw(turn: Quaternion) -> float:
    return 2.0 * atan2(turn.z, turn.w)


def _length2(turn: Quaternion) -> float:
    return turn.x**2 + turn.y**2 + turn.z**2 + turn.w**2


def _rises(stamps: Iterable[int]) -> bool:
    return all(first < other for first, other in pairwise(stamps))
