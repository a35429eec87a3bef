"""Poses of the swarm's robots as a tracker publishes them: a camera above the arena, or the world that emulates it."""

# zenoh's stubs leave out the return type of undeclare.
# pyright: reportUnknownMemberType=false

from collections.abc import Sequence

import zenoh
from zenoh.handlers import Callback

from swarmwire.comms.clock import NS_PER_S
from swarmwire.comms.errors import BadFrame
from swarmwire.comms.wire.radio_bridge import POSE_BYTES, Pose, decode_pose
from swarmwire.comms.wire.robot_network import SwarmKeys

OLDEST_NS = NS_PER_S  # a pose that was seen longer ago, or is dated so far ahead, is not used


class Tracker:
    """The newest pose of each robot; `pose` may be called from any thread.

    Attributes:
        malformed: messages that are no pose, so far.
        unknown: poses of robots that are not of the swarm.
    """

    def __init__(self, session: zenoh.Session, keys: SwarmKeys, robots: Sequence[str]) -> None:
        self._session, self._keys = session, keys
        self._robot_of = {keys.pose(robot): robot for robot in robots}
        self._newest: dict[str, tuple[int, Pose]] = {}  # with its stamp
        self._subscriber: zenoh.Subscriber[None] | None = None
        self.malformed = self.unknown = 0

    def open(self) -> None:
        """Listen for poses."""
        # All poses of a swarm cost each robot a call for each: whoever wants one alone asks for that.
        only = next(iter(self._robot_of)) if len(self._robot_of) == 1 else self._keys.any_pose
        self._subscriber = self._session.declare_subscriber(
            only, Callback(self._keep, indirect=False), allowed_origin=zenoh.Locality.REMOTE
        )

    def pose(self, robot: str, now_utc_ns: int) -> Pose | None:
        """Where the robot was seen last, if that was within a second of now."""
        stamp_ns, pose = self._newest.get(robot, (0, None))
        return pose if abs(now_utc_ns - stamp_ns) <= OLDEST_NS else None

    def counts(self) -> dict[str, int]:
        """What came that was of no use, by name."""
        return {"poses_malformed": self.malformed, "poses_of_unknown": self.unknown}

    def close(self) -> None:
        """Listen no more; safe to call more than once."""
        subscriber, self._subscriber = self._subscriber, None
        if subscriber is not None and not self._session.is_closed():
            subscriber.undeclare()

    def _keep(self, sample: zenoh.Sample) -> None:
        """Called by the network's thread: it must take no time."""
        robot = self._robot_of.get(str(sample.key_expr))
        if robot is None:
            self.unknown += 1
            return
        if sample.kind != zenoh.SampleKind.PUT or len(sample.payload) != POSE_BYTES:
            self.malformed += 1
            return
        try:
            pose, stamp_ns = decode_pose(sample.payload.to_bytes())
        except BadFrame:
            self.malformed += 1
        else:
            self._newest[robot] = (stamp_ns, pose)
