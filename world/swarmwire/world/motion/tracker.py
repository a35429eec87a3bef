"""Poses of a tracker on the robots' network, on the keys `pose/NAME`: a camera above an arena, or a gateway's world."""

# zenoh's stubs leave out the return type of undeclare.
# pyright: reportUnknownMemberType=false

import math

import zenoh
from zenoh.handlers import Callback

from swarmwire.comms.base.errors import BadFrame
from swarmwire.comms.wire.keys import SwarmKeys
from swarmwire.comms.wire.network import Network
from swarmwire.comms.wire.radio_bridge import POSE_BYTES, decode_pose
from swarmwire.comms.wire.robot_network import endpoints_of, open_swarm
from swarmwire.comms.wire.sessions import close_session
from swarmwire.world.motion.live import LiveSource
from swarmwire.world.scenario.motion import TrackerMotion


class TrackerSource(LiveSource):
    """Subscribes to the poses of a swarm; the age of a pose counts from its arrival."""

    _session: zenoh.Session | None = None

    def open(self) -> None:
        """Join the network; BadInput if an endpoint is in use, or is not on this machine."""
        assert isinstance(self.motion, TrackerMotion)
        network = Network(listen=self.motion.listen, connect=self.motion.connect)
        network.check("", "motion")
        self._session = open_swarm(network, small=False)
        keys = SwarmKeys(self.motion.swarm)
        self._name_of = {keys.pose(name): name for name in self.names}
        self._subscriber = self._session.declare_subscriber(keys.any_pose, Callback(self._store, indirect=False))
        endpoints = endpoints_of(self._session, network) if network.listen else network.connect
        self.address = f"{keys.any_pose} at {', '.join(endpoints)}"

    def close(self) -> None:
        """Leave the network; safe to call more than once."""
        session, self._session = self._session, None
        if session is not None:
            close_session(session)

    def _store(self, sample: zenoh.Sample) -> None:
        """Take a pose; the network's threads call this."""
        name = self._name_of.get(str(sample.key_expr))
        if name is None:
            self.count("poses_of_unknown")
        elif sample.kind != zenoh.SampleKind.PUT or len(sample.payload) != POSE_BYTES:
            self.count("poses_malformed")
        else:
            try:
                pose, utc_ns = decode_pose(sample.payload.to_bytes())
            except BadFrame:
                self.count("poses_malformed")
            else:
                self.put(name, pose.x_m, pose.y_m, math.nan, pose.heading_rad, utc_ns)
