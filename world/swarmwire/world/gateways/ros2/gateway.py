"""The ROS 2 gateway: ROS 2 nodes drive the robots of a group."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import ClassVar

import numpy as np
import zenoh

from swarmwire.comms.base.arrays import BoolArray, FloatArray
from swarmwire.comms.base.clock import DatedClock, to_ns
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.protocols.ros2.keys import (
    CLOCK,
    WRITE,
    RmwNode,
    bridge_itself,
    bridge_key,
    bridge_token,
    rmw_key,
    ros_names,
)
from swarmwire.comms.protocols.ros2.links import Publisher, check_endpoint, close, open_router
from swarmwire.comms.protocols.ros2.messages import Messages
from swarmwire.comms.robot.bodies.body import Body
from swarmwire.comms.robot.bodies.drives import Holonomic
from swarmwire.comms.robot.tick_io import NOTHING_SET
from swarmwire.world.gateways.gateway import FRESH, ForeignCommands, Gateway
from swarmwire.world.gateways.ros2.base import NODE, Base, CommandInbox, ReadingRate
from swarmwire.world.gateways.ros2.publishers import Ros2GatewayOptions, broadcasters_of
from swarmwire.world.gateways.ros2.radio import RADIO_NODE, RosRadio

ANY_PORT = "tcp/127.0.0.1:0"  # the system chooses the port
ON_ROBOT = "tcp/127.0.0.1:7447"  # default address of the router for nodes of rmw_zenoh
CREATE3_SENSORS = frozenset({"bumper", "ground"})  # sensors without a topic on other bases
CLOCK_TOPIC, CLOCK_NODE = "/clock", "world"


class Ros2Gateway(Gateway):
    """The robots of a group as ROS 2 bases, each in a namespace with its name, behind one zenoh router.

    Robots with separate networks have a router each, so that their nodes do not reach one another through it. Times are
    the date on which the run began plus simulated time: `/clock` is the present, a stamp the time of a measurement.
    """

    options: ClassVar[type] = Ros2GatewayOptions
    sensors: ClassVar[frozenset[str]] = CREATE3_SENSORS | {
        *("scan", "odometry", "imu", "compass", "battery", "light", "proximity")
    }

    def __init__(
        self, names: Sequence[str], body: Body, address: str, options: Ros2GatewayOptions, clock: DatedClock
    ) -> None:
        """See `Gateway`; BadInput also if rosbags is not installed, or two robots have the same name in ROS."""
        super().__init__(names, body, address or ANY_PORT, options, clock)
        check_endpoint(self.address, "ros2", "address")
        self._on_robot = address or ON_ROBOT
        self._options = options
        self.namespaces = tuple(f"/{name}" for name in ros_names(names, "ros2"))
        self._messages = Messages(options.distro)
        self._broadcasters = broadcasters_of(body, len(names), options)
        self._rates = [ReadingRate(broadcaster.rate_hz) for broadcaster in self._broadcasters]
        self._began_ns: int | None = None
        self._sessions: list[zenoh.Session] = []
        self._bases: list[Base] = []
        self._clocks: tuple[Publisher, ...] = ()
        self._tokens: list[object] = []  # liveliness tokens of the gateway

    def differences(self) -> tuple[str, ...]:
        """See `Gateway.differences`."""
        silent = [] if self.body.ros2.create3 else sorted(CREATE3_SENSORS & self.body.sensors.keys())
        return (
            *super().differences(),
            *([f"no program receives its {', '.join(silent)}"] if silent else []),
            *(["no program switches its LEDs"] if self.body.led_count else []),
        )

    def open(self) -> tuple[str, ...]:
        """See `Gateway.open`; all robots share one endpoint, with a namespace each, unless they are separate."""
        if not self.separate:
            return self._serve(range(len(self.names)), self.address)
        if not self._on_robot.startswith("tcp/"):
            expected = f"expected an address such as {ON_ROBOT} on robots with network interfaces"
            raise BadInput("ros2", "address", f"{expected}, got {self._on_robot!r}")
        return tuple(endpoint for index in range(len(self.names)) for endpoint in self._serve([index], ANY_PORT))

    def on_robot(self, address: str) -> str:
        """See `Gateway.on_robot`; the address is the same for all robots."""
        return self._on_robot

    def join(self, radio: RosRadio, first: int) -> None:
        """Offer the robots' topics of the radio, in their namespaces; `first` is the row of the first robot."""
        radio.prepare(self._messages)
        for index, base in enumerate(self._bases):
            node = replace(base.node, index=len(self._bases) + 1 + index, name=RADIO_NODE)
            radio.join(first + index, base.session, node, self._messages, is_rmw=(False, True))

    def _serve(self, indices: Sequence[int], address: str) -> tuple[str, ...]:
        """Open a router for the robots with these indices in the group, and return their addresses."""
        try:
            session, endpoint = open_router(address)
        except zenoh.ZError as error:
            raise BadInput("ros2", "address", f"cannot listen on {address}: {str(error).split(' at ')[0]}") from error
        self._sessions.append(session)
        self._declare(session, bridge_itself(str(session.zid())))
        self._bases += [self._base(session, index) for index in indices]
        self._clocks += self._clock_publishers(session)
        return (endpoint,) * len(indices)

    def publish(
        self, time_ns: int, fields: dict[str, FloatArray], alive: BoolArray, ages_ns: Mapping[str, int] = FRESH
    ) -> None:
        """See `Gateway.publish`; only topics that are due and have subscribers are published."""
        if self._began_ns is None:
            self._began_ns = self.clock.utc_ns() - time_ns
        now_ns = self._began_ns + time_ns
        for base, is_alive in zip(self._bases, alive, strict=True):
            base.show() if is_alive else base.hide()
        for topic, (broadcaster, rate) in enumerate(zip(self._broadcasters, self._rates, strict=True)):
            age_ns = broadcaster.age_ns(ages_ns)
            if broadcaster.is_published(fields) and rate.is_due(time_ns - age_ns):
                broadcaster.follow(time_ns - age_ns, fields)
                for row in np.flatnonzero(alive):
                    self._publish_topic(topic, int(row), fields, now_ns - age_ns, now_ns)
        if any(publisher.has_subscribers for publisher in self._clocks):
            now = self._messages.make(CLOCK, self._messages.time(now_ns))
            _put(self._clocks, self._messages.encode(CLOCK, now), now_ns)

    def pop_commands(self) -> ForeignCommands:
        """See `Gateway.pop_commands`; a base without a command for `cmd_timeout_s` stops."""
        newest = [base.inbox.pop_newest() for base in self._bases]
        speeds = np.array([command or (0.0, 0.0, 0.0) for command in newest], np.float64).reshape(-1, 3)
        drive = np.array([command is not None for command in newest], np.bool_)
        lateral_mps = speeds[:, 2] if isinstance(self.body.drive, Holonomic) else np.zeros(len(speeds))
        return ForeignCommands(drive, speeds[:, 0].copy(), speeds[:, 1].copy(), lateral_mps.copy(), NOTHING_SET)

    def counts(self) -> dict[str, int]:
        """See `Gateway.counts`."""
        return dict(sum((base.inbox.counts() for base in self._bases), Counter[str]()))

    def close(self) -> None:
        """See `Gateway.close`."""
        for session in self._sessions:
            close(session)
        self._sessions, self._tokens, self._clocks = [], [], ()

    def _clock_publishers(self, session: zenoh.Session) -> tuple[Publisher, ...]:
        """Return the publishers of `/clock`, and declare its node in the graphs."""
        zid, type_hash = str(session.zid()), self._messages.hash_of(CLOCK)
        node = RmwNode(self._options.domain, zid, len(self.names), "/", CLOCK_NODE)
        token = node.topic_token(1, WRITE, CLOCK_TOPIC, CLOCK, type_hash)
        self._declare(session, node.token, token, bridge_token(zid, WRITE, CLOCK_TOPIC, CLOCK, type_hash))
        key = rmw_key(node.domain, CLOCK_TOPIC, CLOCK, type_hash)
        return Publisher(session, bridge_key(CLOCK_TOPIC), None), Publisher(session, key, token)

    def _declare(self, session: zenoh.Session, *tokens: str) -> None:
        self._tokens += [session.liveliness().declare_token(token) for token in tokens]

    def _base(self, session: zenoh.Session, index: int) -> Base:
        options = self._options
        node = RmwNode(options.domain, str(session.zid()), index, self.namespaces[index], NODE)
        inbox = CommandInbox(to_ns(options.cmd_timeout_s), self.clock)
        return Base(session, node, self._broadcasters, self._messages, inbox, stamped=options.stamped)

    def _publish_topic(self, topic: int, row: int, fields: dict[str, FloatArray], stamp_ns: int, now_ns: int) -> None:
        publishers, broadcaster = self._bases[row].publishers[topic], self._broadcasters[topic]
        if any(publisher.has_subscribers for publisher in publishers):
            message = broadcaster.message(self._messages, fields, row, stamp_ns)
            if message is not None:
                _put(publishers, self._messages.encode(broadcaster.kind, message), now_ns)


def _put(publishers: tuple[Publisher, ...], payload: bytes, now_ns: int) -> None:
    for publisher in publishers:
        if publisher.has_subscribers:
            publisher.put(payload, now_ns)
