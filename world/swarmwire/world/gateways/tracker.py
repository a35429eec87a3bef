"""The world as the tracker of its robots: what a camera above a real arena would publish."""

# pyright: reportUnknownMemberType=false

from typing import cast

import zenoh

from swarmwire.comms.arrays import BoolArray, FloatArray
from swarmwire.comms.clock import DatedClock
from swarmwire.comms.truth import Static
from swarmwire.comms.wire.radio_bridge import Pose, encode_pose
from swarmwire.comms.wire.robot_network import SwarmKeys

# zenoh's stubs leave out the return type of put.


class EmulatedTracker:
    """Publishes where each robot alive is, once per tick; of a world of several arenas, those of the first."""

    def __init__(self, session: zenoh.Session, keys: SwarmKeys, clock: DatedClock) -> None:
        """`clock` dates the poses: by the pace of the run, where that is not the wall clock's."""
        self._session, self._keys, self._clock = session, keys, clock
        self._publishers: list[zenoh.Publisher] = []
        self._refused = 0

    def begin(self, static: Static) -> None:
        """Ready to publish, under the names that robots have in their arena."""
        self._publishers = [
            self._session.declare_publisher(
                self._keys.pose(name),
                congestion_control=zenoh.CongestionControl.DROP,
                allowed_destination=zenoh.Locality.REMOTE,
            )
            for name in static.robot_names
        ]

    def tell(self, poses: FloatArray, alive: BoolArray) -> None:
        """Where the robots (rows, 3) of the first arena are now, if they are alive (rows,)."""
        stamp_ns = self._clock.utc_ns()
        pose = cast("list[list[float]]", poses[: len(self._publishers)].tolist())
        for publisher, living, place in zip(self._publishers, alive.tolist(), pose, strict=False):
            if not living:
                continue
            try:
                publisher.put(encode_pose(Pose(*place), stamp_ns))
            except zenoh.ZError:
                self._refused += 1

    def counts(self) -> dict[str, int]:
        """Poses that the network did not take, since the session was closed, by name, where there is any."""
        return {"tracker_poses_refused": self._refused} if self._refused else {}

    def end(self) -> None:
        """Publish no more."""
        publishers, self._publishers = self._publishers, []
        for publisher in publishers:
            if not self._session.is_closed():
                publisher.undeclare()
