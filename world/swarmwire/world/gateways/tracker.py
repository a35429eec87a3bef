"""The emulated tracker: publishes the poses of robots, as a camera above a real arena would."""

# pyright: reportUnknownMemberType=false

from typing import cast

import zenoh

from swarmwire.comms.arrays import BoolArray, FloatArray
from swarmwire.comms.clock import DatedClock
from swarmwire.comms.truth import Static
from swarmwire.comms.wire.keys import SwarmKeys
from swarmwire.comms.wire.radio_bridge import Pose, encode_pose

# zenoh's stubs leave out the return type of put.


class EmulatedTracker:
    """Publishes the pose of each robot that is alive, once per tick; of several arenas, only the first."""

    def __init__(self, session: zenoh.Session, keys: SwarmKeys, clock: DatedClock) -> None:
        """`clock` dates the poses: by the pace of the run, where that is not the wall clock's."""
        self._session, self._keys, self._clock = session, keys, clock
        self._publishers: list[zenoh.Publisher] = []
        self._refused = 0

    def begin(self, static: Static) -> None:
        """Declare the publishers, under the names of the robots in their arena."""
        self._publishers = [
            self._session.declare_publisher(
                self._keys.pose(name),
                congestion_control=zenoh.CongestionControl.DROP,
                allowed_destination=zenoh.Locality.REMOTE,
            )
            for name in static.robot_names
        ]

    def tell(self, poses: FloatArray, alive: BoolArray) -> None:
        """Publish the poses (rows, 3) of the robots of the first arena that are alive (rows,)."""
        stamp_ns = self._clock.utc_ns()
        pose = cast("list[list[float]]", poses[: len(self._publishers)].tolist())
        for publisher, is_alive, place in zip(self._publishers, alive.tolist(), pose, strict=False):
            if not is_alive:
                continue
            try:
                publisher.put(encode_pose(Pose(*place), stamp_ns))
            except zenoh.ZError:
                self._refused += 1

    def counts(self) -> dict[str, int]:
        """Poses that a closed session refused, by name, if any."""
        return {"tracker_poses_refused": self._refused} if self._refused else {}

    def end(self) -> None:
        """Publish no more."""
        publishers, self._publishers = self._publishers, []
        for publisher in publishers:
            if not self._session.is_closed():
                publisher.undeclare()
