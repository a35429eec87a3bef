"""Robots' poses from a tracker: a camera above the arena, or a world that emulates it."""

# zenoh's stubs leave out the return type of undeclare.
# pyright: reportUnknownMemberType=false

from collections.abc import Sequence

import zenoh
from zenoh.handlers import Callback

from swarmwire.comms.base.clock import NS_PER_S
from swarmwire.comms.base.errors import BadFrame
from swarmwire.comms.wire.keys import SwarmKeys
from swarmwire.comms.wire.radio_bridge import POSE_BYTES, Pose, decode_pose

MAX_AGE_NS = NS_PER_S  # poses whose stamps differ more from now, past or future, are ignored


class Tracker:
    """The newest pose of each robot; `pose` may be called from any thread.

    Attributes:
        malformed: malformed messages so far.
        unknown: poses of robots outside the swarm so far.
    """

    def __init__(self, session: zenoh.Session, keys: SwarmKeys, robots: Sequence[str]) -> None:
        self._session, self._keys = session, keys
        self._robot_of = {keys.pose(robot): robot for robot in robots}
        self._newest: dict[str, tuple[int, Pose]] = {}  # robot -> stamp in ns of UTC, pose
        self._subscriber: zenoh.Subscriber[None] | None = None
        self.malformed = self.unknown = 0

    def open(self) -> None:
        """Subscribe to poses."""
        # Each pose costs a call, so a robot that needs one pose subscribes to the key of that pose.
        key = next(iter(self._robot_of)) if len(self._robot_of) == 1 else self._keys.any_pose
        self._subscriber = self._session.declare_subscriber(
            key, Callback(self._store, indirect=False), allowed_origin=zenoh.Locality.REMOTE
        )

    def pose(self, robot: str, now_utc_ns: int) -> Pose | None:
        """Return the robot's newest pose; None if its stamp differs from now by more than a second."""
        stamp_ns, pose = self._newest.get(robot, (0, None))
        return pose if abs(now_utc_ns - stamp_ns) <= MAX_AGE_NS else None

    def counts(self) -> dict[str, int]:
        """Return the numbers of unusable messages, by name."""
        return {"poses_malformed": self.malformed, "poses_of_unknown": self.unknown}

    def close(self) -> None:
        """End the subscription; safe to call more than once."""
        subscriber, self._subscriber = self._subscriber, None
        if subscriber is not None and not self._session.is_closed():
            subscriber.undeclare()

    def _store(self, sample: zenoh.Sample) -> None:
        """Store a pose, without delay for the network's thread, which calls this."""
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
