"""Bags of ROS 2 with real robots, in the form of robots' logs: poses, commands, and the packets that robots report.

A robot publishes its packets as texts (std_msgs/String) with JSON, a message each: `{"t_s": 12.5, "seq": 7}` for one
that it sent, and `{"t_s": 12.6, "seq": 7, "tx": "robot_2"}` for one that it received. Keys are those of the robots'
own logs: `to`, `size_bytes`, `tag`, `latency_s` and `distance_m` may be there, too.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import msgspec
import numpy as np

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.clock import NS_PER_S
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.protocols.ros2.bags import BagMessage, read_bag
from swarmwire.comms.protocols.ros2.keys import ODOMETRY, POSE_STAMPED, TRANSFORMS, TWIST, TWIST_STAMPED
from swarmwire.comms.protocols.ros2.messages import stamp_ns
from swarmwire.comms.protocols.ros2.poses import poses_of
from swarmwire.comms.robot.bodies.body import Body
from swarmwire.metrics.real.real_log.real_logs import RealLogs, named
from swarmwire.metrics.real.real_log.robot_log import (
    MAX_TIME_S,
    AboutRobot,
    LoggedRadio,
    LoggedReceptions,
    LoggedTransmissions,
    RealRobotLog,
    Steps,
)
from swarmwire.world.motion.traces.reading import read_trace

POSES, PACKETS, COMMANDS = "/{name}/odom", "/{name}/packets", "/{name}/cmd_vel"  # default topics
STRING = "std_msgs/msg/String"
POSE_KINDS, COMMAND_KINDS = (ODOMETRY, POSE_STAMPED, TRANSFORMS), (TWIST, TWIST_STAMPED)
NAME = "{name}"
USUAL_RATE_HZ = 10.0
NO_STAMP_NS = 2**63


@dataclass(frozen=True)
class BagTopics:
    """Names of topics, with {name} in place of the robot's. None: the default."""

    poses: str | None = None  # a topic, or topic, parent and frame of transforms: "/tf map {name}/base_link"
    packets: str | None = None


class PacketText(msgspec.Struct):
    """A packet that a robot sent, or received from `tx`."""

    t_s: Annotated[float, msgspec.Meta(gt=-MAX_TIME_S, lt=MAX_TIME_S)]  # by the clock of the robot's stamps
    seq: Annotated[int, msgspec.Meta(ge=0, lt=2**53)]
    tx: str = ""
    to: str = ""
    size_bytes: Annotated[int, msgspec.Meta(ge=0, lt=2**31)] = 0
    tag: str = ""
    latency_s: float | None = None
    distance_m: float | None = None


@dataclass
class _BagRobot:
    """What a bag holds of a robot."""

    time_s: FloatArray = field(default_factory=lambda: np.zeros(0))  # of poses
    pose: FloatArray = field(default_factory=lambda: np.zeros((0, 3)))
    packets: list[PacketText] = field(default_factory=list[PacketText])
    commands: list[tuple[float, float, float]] = field(default_factory=list[tuple[float, float, float]])


def read_bag_logs(
    path: Path, topics: BagTopics, bodies: Mapping[str, Body] | None = None, rate_hz: float = USUAL_RATE_HZ
) -> RealLogs:
    """Read a bag; `bodies` by name, the first one for other robots; `rate_hz`: steps of each robot per second.

    BadInput for a bag without poses or packets, for a damaged one, and if rosbags is not installed.
    """
    messages = _BagMessages(path, topics)
    robots = messages.robots()
    senders = {packet.tx for robot in robots.values() for packet in robot.packets if packet.tx}
    names = (*robots, *sorted(senders - robots.keys()))  # also those of which it holds only received packets
    sent_s = {name: _sent_s(robot) for name, robot in robots.items()}
    logs = [
        RealRobotLog(
            about=AboutRobot(name, path.name, names, "", "", {}, {}, rate_hz, 0, LoggedRadio("ros2")),
            body=bodies.get(name, next(iter(bodies.values()))) if bodies else None,
            where=str(path),
            steps=_steps(robot),
            received=_received(robot, sent_s),
            sent=_sent(robot),
            ended="recorded",
            half_lines=(),
        )
        for name, robot in robots.items()
    ]
    return RealLogs(str(path), tuple(logs), tuple(messages.notes))


class _BagMessages:
    """The messages of robots in a bag.

    Attributes:
        notes: data that the bag lacks, a line each.
    """

    def __init__(self, path: Path, topics: BagTopics) -> None:
        self.notes: list[str] = []
        self._path, self._topics = path, topics
        self._poses = _pattern(topics.poses or POSES, "--poses")
        self._packets = _pattern(topics.packets or PACKETS, "--packets")
        self._commands = _pattern(COMMANDS, "")
        self._start_ns = NO_STAMP_NS  # first stamp of any pose
        self._names: dict[str, str] = {}  # robots by topic of packets or commands
        self._candidates: list[str] = []

    def robots(self) -> dict[str, _BagRobot]:
        """Read the robots, those with poses first."""
        packets, commands = dict[str, list[PacketText]](), dict[str, list[tuple[float, float, float]]]()
        for message in read_bag(self._path, self._is_read):
            if message.kind in POSE_KINDS:
                stamps_ns = (stamp_ns(part.header) for part in poses_of(message.kind, message.content))
                self._start_ns = min([self._start_ns, *stamps_ns])
            elif message.kind == STRING:
                packets.setdefault(self._names[message.topic], []).append(self._packet(message))
            else:
                commands.setdefault(self._names[message.topic], []).append(_command(message))
        robots = self._posed()
        for name in sorted(packets):
            robots.setdefault(name, _BagRobot()).packets = packets[name]
        for name in commands.keys() & robots.keys():
            robots[name].commands = commands[name]
        self._report(robots)
        return robots

    def _posed(self) -> dict[str, _BagRobot]:
        if self._start_ns == NO_STAMP_NS:
            return {}
        trace, robots = read_trace(self._path), dict[str, _BagRobot]()
        for name, first, stop in zip(trace.names, trace.first[:-1], trace.first[1:], strict=True):
            if match := self._poses.fullmatch(name):
                pose = np.stack([trace.x_m, trace.y_m, trace.heading_rad], axis=1)[first:stop]
                pose[np.isnan(pose).any(axis=1)] = np.nan
                time_s = self._start_ns / NS_PER_S + trace.t_s[first:stop]
                later = np.append(np.diff(time_s) > 0.0, True)  # of poses of one time, the last
                robots[match["name"]] = _BagRobot(time_s[later], pose[later])
        if not robots and self._topics.poses:
            raise BadInput("--poses", self._topics.poses, f"expected one of {named(trace.names)}")
        return robots

    def _report(self, robots: Mapping[str, _BagRobot]) -> None:
        packets, candidates = self._topics.packets or PACKETS, named(sorted(set(self._candidates))) or "none"
        has_packets = any(robot.packets for robot in robots.values())
        if self._topics.packets and not has_packets:
            raise BadInput("--packets", packets, f"expected topics of {STRING}; poses and texts are on {candidates}")
        if not robots:
            expected = f"expected poses on {self._topics.poses or POSES} or packets on {packets}"
            raise BadInput(
                str(self._path), "", f"{expected}; poses and texts are on {candidates}: see --poses and --packets"
            )
        if not has_packets:
            self.notes.append(f"no packets: no topic {packets} of {STRING}")
        without = [name for name, robot in robots.items() if not robot.commands]
        if without:
            self.notes.append(f"no commands of {named(without)}: no topic {COMMANDS}")

    def _is_read(self, topic: str, kind: str) -> bool:
        """Return True for topics of poses, and those of a robot's packets and commands, whose robot it keeps."""
        if kind in (*POSE_KINDS, STRING):
            self._candidates.append(topic)
        pattern = self._packets if kind == STRING else self._commands if kind in COMMAND_KINDS else None
        if pattern is not None and (match := pattern.fullmatch(topic)):
            self._names[topic] = match["name"]
        return kind in POSE_KINDS or topic in self._names

    def _packet(self, message: BagMessage) -> PacketText:
        try:
            return msgspec.json.decode(message.content.data, type=PacketText)
        except msgspec.MsgspecError as error:
            expected = f'expected a packet such as {{"t_s": 12.5, "seq": 7}}: {error}'
            raise BadInput(str(self._path), message.position, expected) from None


def _command(message: BagMessage) -> tuple[float, float, float]:
    """Return time in s, speed and turn rate."""
    is_stamped = message.kind == TWIST_STAMPED
    time_ns = stamp_ns(message.content.header) if is_stamped else message.log_ns
    twist = message.content.twist if is_stamped else message.content
    return time_ns / NS_PER_S, float(twist.linear.x), float(twist.angular.z)


def _pattern(text: str, option: str) -> re.Pattern[str]:
    """Return the pattern of names of topics; BadInput unless the text has {name} once."""
    if text.count(NAME) != 1:
        raise BadInput(option, text, f"expected a topic with {NAME} in place of the robot's name, such as {PACKETS}")
    before, after = map(re.escape, text.split(NAME))
    return re.compile(f"{before}(?P<name>[^/ ]+){after}")


def _sent_s(robot: _BagRobot) -> dict[int, list[float]]:
    """Return the times of sending by sequence number, several after a restart."""
    times: dict[int, list[float]] = {}
    for packet in robot.packets:
        if not packet.tx:
            times.setdefault(packet.seq, []).append(packet.t_s)
    return times


def _steps(robot: _BagRobot) -> Steps:
    """Return a step per pose, or per packet without poses."""
    time_s, pose = robot.time_s, robot.pose
    if not len(time_s):
        time_s = np.unique([packet.t_s for packet in robot.packets])
        pose = np.full((len(time_s), 3), np.nan)
    command = np.full((len(time_s), 2), np.nan)
    if robot.commands:
        rows = np.array([(-np.inf, 0.0, 0.0), *sorted(robot.commands)])  # before its first command a robot rests
        command = rows[np.searchsorted(rows[:, 0], time_s, side="right") - 1, 1:]
    return Steps(time_s, pose, command, [""] * len(time_s), np.full(len(time_s), np.nan))


def _sent(robot: _BagRobot) -> LoggedTransmissions:
    rows = sorted((packet for packet in robot.packets if not packet.tx), key=lambda packet: packet.t_s)
    return LoggedTransmissions(
        np.array([packet.t_s for packet in rows], np.float64),
        np.array([packet.seq for packet in rows], np.int64),
        np.array([packet.to for packet in rows], np.str_),
        np.array([packet.size_bytes for packet in rows], np.int64),
        np.array([packet.tag for packet in rows], np.str_),
        np.zeros(len(rows), np.bool_),
    )


def _received(robot: _BagRobot, sent_s: Mapping[str, dict[int, list[float]]]) -> LoggedReceptions:
    rows = sorted((packet for packet in robot.packets if packet.tx), key=lambda packet: packet.t_s)
    return LoggedReceptions(
        time_s=np.array([packet.t_s for packet in rows], np.float64),
        sender=np.array([packet.tx for packet in rows], np.str_),
        sequence=np.array([packet.seq for packet in rows], np.int64),
        to=np.array([packet.to for packet in rows], np.str_),
        size_bytes=np.array([packet.size_bytes for packet in rows], np.int64),
        tag=np.array([packet.tag for packet in rows], np.str_),
        latency_s=np.array([_latency_s(packet, sent_s.get(packet.tx, {})) for packet in rows], np.float64),
        distance_m=np.array([np.nan if packet.distance_m is None else packet.distance_m for packet in rows]),
    )


def _latency_s(packet: PacketText, sent_s: Mapping[int, list[float]]) -> float:
    """Return the latency that the receiver measured, or since its sending, if both are known; else NaN."""
    if packet.latency_s is not None:
        return packet.latency_s
    times = sent_s.get(packet.seq)
    return min((packet.t_s - time_s for time_s in times), key=abs) if times else np.nan
