"""Bags of ROS 2 as traces: each topic of Odometry or PoseStamped is a robot, as is each transform.

A robot's name is its topic, `/robot_1/odom`, or a topic of TFMessage, parent and frame, `/tf map robot_1/base_link`.
Times are those of the stamps, and count from the first one. Topics of other types are ignored.
"""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from swarmwire.comms.base.clock import NS_PER_S
from swarmwire.comms.base.errors import BadFrame, BadInput
from swarmwire.comms.protocols.ros2.bags import METADATA, SUFFIXES, read_bag
from swarmwire.comms.protocols.ros2.keys import ODOMETRY, POSE_STAMPED, TRANSFORMS
from swarmwire.comms.protocols.ros2.messages import stamp_ns
from swarmwire.comms.protocols.ros2.poses import SpacePose, poses_of, space_pose
from swarmwire.world.motion.traces.lines import MAX_NUMBER, refuse_empty
from swarmwire.world.motion.traces.trace import MotionTrace

KINDS = (ODOMETRY, POSE_STAMPED, TRANSFORMS)
STORAGES = (*SUFFIXES, ".zstd")


class StampedPose(NamedTuple):
    """A pose of a robot, with the stamp of its message."""

    stamp_ns: int
    pose: SpacePose


def files(folder: Path) -> list[Path]:
    """Return the files of the folder of a bag."""
    return [folder / METADATA, *sorted(path for path in folder.iterdir() if path.suffix in STORAGES)]


def read(path: Path) -> MotionTrace:
    """Read the robots in the order of their names; BadInput if rosbags is not installed."""
    samples: dict[str, list[StampedPose]] = {}
    for name, sample in _samples(path):
        samples.setdefault(name, []).append(sample)
    if not samples:
        raise refuse_empty(path)
    names = sorted(samples, key=_natural)
    for name in names:
        samples[name].sort(key=lambda stamped: stamped.stamp_ns)
        if len(samples[name]) > 1 and samples[name][0].stamp_ns == samples[name][-1].stamp_ns:
            raise BadInput(str(path), name, "expected messages with stamps, which differ")
    start_ns = min(robot[0].stamp_ns for robot in samples.values())
    rows = [sample for name in names for sample in samples[name]]
    t_s = np.array([sample.stamp_ns - start_ns for sample in rows]) / NS_PER_S
    poses = np.array([sample.pose for sample in rows])
    first = np.cumsum([0, *(len(samples[name]) for name in names)], dtype=np.int64)
    return MotionTrace(tuple(names), first, np.column_stack((t_s, poses)))


def _samples(path: Path) -> Iterator[tuple[str, StampedPose]]:
    """Yield the robots' names and poses in the order of the file."""
    for message in read_bag(path, lambda _, kind: kind in KINDS):
        try:
            for part in poses_of(message.kind, message.content):
                pose = space_pose(part.position, part.orientation)
                if not max(map(abs, pose[:3])) <= MAX_NUMBER:
                    raise BadFrame("malformed", f"a position beyond {MAX_NUMBER:g} m")
                yield f"{message.topic} {part.name}".rstrip(), StampedPose(stamp_ns(part.header), pose)
        except BadFrame as error:
            raise BadInput(
                str(path), message.position, f"expected a pose of the type {message.kind}: {error}"
            ) from None


def _natural(name: str) -> list[Any]:
    """Return a key that sorts robot_2 before robot_10: texts and numbers take turns."""
    return [int(part) if part.isdecimal() else part for part in re.split(r"(\d+)", name)]
