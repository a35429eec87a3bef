"""Poses of the swarm's robots as a tracker publishes them: a camera above the arena, or the world that emulates it."""

# zenoh's stubs leave out the return type of undeclare.
# pyright: reportUnknownMemberType=false

from collections.abc import Sequence

import zenoh
from zenoh.handlers import Callback

from swarmwire.comms.base.clock import NS_PER_S
from swarmwire.comms.base.errors import BadFrame
from swarmwire.comms.wire.keys import SwarmKeys
from swarmwire.comms.wire.radio_bridge import POSE_BYTES, Pose, decode_pose

MAX_AGE_NS = NS_PER_S  # a pose with an older stamp, or one that far in the future, is not used


class Tracker:
    """The newest pose of each robot; `pose` may be called from any thread.

    Attributes:
        malformed: messages so far that are no pose.
        unknown: poses so far of robots outside the swarm.
    """

    def __init__(self, session: zenoh.Session, keys: SwarmKeys, robots: Sequence[str]) -> None:
        self._session, self._keys = session, keys
        self._robot_of = {keys.pose(robot): robot for robot in robots}
        self._newest: dict[str, tuple[int, Pose]] = {}  # with its stamp
        self._subscriber: zenoh.Subscriber[None] | None = None
        self.malformed = self.unknown = 0

    def open(self) -> None:
        """Subscribe to poses."""
        # Each pose costs a call, so a robot that needs key one pose subscribes to that one.
        key = next(iter(self._robot_of)) if len(self._robot_of) == 1 else self._keys.any_pose
        self._subscriber = self._session.declare_subscriber(
            key, Callback(self._store, indirect=False), allowed_origin=zenoh.Locality.REMOTE
        )

    def pose(self, robot: str, now_utc_ns: int) -> Pose | None:
        """The robot's newest pose, if its stamp is within a second of now."""
        stamp_ns, pose = self._newest.get(robot, (0, None))
        return pose if abs(now_utc_ns - stamp_ns) <= MAX_AGE_NS else None

    def counts(self) -> dict[str, int]:
        """Unusable messages, by name."""
        return {"poses_malformed": self.malformed, "poses_of_unknown": self.unknown}

    def close(self) -> None:
        """End the subscription; safe to call more than once."""
        subscriber, self._subscriber = self._subscriber, None
        if subscriber is not None and not self._session.is_closed():
            subscriber.undeclare()

    def _store(self, sample: zenoh.Sample) -> None:
        """Called by the network's thread, which it must not delay."""
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
