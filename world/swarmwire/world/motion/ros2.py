"""Poses of ROS 2 topics, over rmw_zenoh or zenoh-bridge-ros2dds: Odometry, PoseStamped, or transforms."""

from functools import partial
from threading import Event, Lock, Thread
from typing import Any

import zenoh

from swarmwire.comms.base.clock import NS_PER_S
from swarmwire.comms.base.errors import BadFrame, BadInput
from swarmwire.comms.protocols.ros2.keys import (
    ODOMETRY,
    POSE_STAMPED,
    READ,
    TRANSFORMS,
    RmwNode,
    absolute,
    bridge_itself,
    bridge_key,
    check_name,
    rmw_key,
    ros_name,
)
from swarmwire.comms.protocols.ros2.links import Subscription, check_endpoint, close, open_client, open_router
from swarmwire.comms.protocols.ros2.messages import Messages
from swarmwire.comms.protocols.ros2.poses import ONLY, poses_of, space_pose, transform_name
from swarmwire.comms.wire.network import is_local
from swarmwire.world.gateways.ros2.radio import RADIO_NODE, RosRadio
from swarmwire.world.motion.live import LiveSource
from swarmwire.world.scenario.motion import Ros2Motion

TOPICS = {ODOMETRY: "/{name}/odom", POSE_STAMPED: "/{name}/pose", TRANSFORMS: "/tf"}
ROUTER = "tcp/127.0.0.1:7447"  # default address of rmw_zenoh's router, of a bridge and of the gateway
NODE = "swarmwire_poses"
CONNECT_S = 1.0  # duration of an attempt to connect, which delays the end of a run that still waits


class Ros2Source(LiveSource):
    """Subscribes to the topics of the group's robots at each endpoint.

    Attributes:
        namespaces: the namespace of each robot's nodes; known from `open` on.
    """

    motion: Ros2Motion

    def open(self) -> None:
        """Listen, and begin to connect; BadInput for names or endpoints that cannot be used, or without rosbags."""
        self._messages = Messages(self.motion.distro)
        self._name_of, self.namespaces = self._names_by_pose(), self._namespaces()
        self._sessions: list[zenoh.Session] = []
        self._radio: RosRadio | None = None
        self._lock = Lock()  # of sessions and radio
        self._tokens: list[Any] = []  # zenoh undeclares a token with its last reference
        self._is_closed, self._threads = Event(), list[Thread]()
        connect, listen = self.motion.connect, self.motion.listen
        if not connect and not listen:
            connect = (ROUTER,)
        for key, endpoints in (("connect", connect), ("listen", listen)):
            for endpoint in endpoints:
                check_endpoint(endpoint, "motion", key)
        opened = [self._open_router(endpoint) for endpoint in listen]
        for endpoint in connect:
            self._threads.append(Thread(target=self._connect, args=(endpoint,), name="poses", daemon=True))
            self._threads[-1].start()
        self.is_exposed = not all(map(is_local, listen))
        self.address = f"{next(iter(self._name_of))} at {', '.join((*opened, *connect))}"

    def close(self) -> None:
        """Leave the network; safe to call more than once."""
        self._is_closed.set()
        for thread in self._threads:
            thread.join()
        for session in self._sessions:
            close(session)
        self._sessions, self._tokens = [], []

    def _namespaces(self) -> list[str]:
        names = [absolute("/", _filled(self.motion.namespace, name, at)) for at, name in enumerate(self.names)]
        for name in names:
            check_name(name, "motion", "namespace")
        if len(set(names)) < len(names):
            raise BadInput("motion", "namespace", "expected {name}, {index} or {number} in it: robots would share one")
        return names

    def join(self, radio: RosRadio) -> None:
        """Offer the robots' topics of the radio, in their namespaces; BadInput for a type that is unknown."""
        radio.prepare(self._messages)
        with self._lock:
            self._radio, sessions = radio, tuple(self._sessions)
        for session in sessions:
            self._offer(radio, session)

    def _offer(self, radio: RosRadio, session: zenoh.Session) -> None:
        is_rmw, zid = self.motion.transport == "rmw", str(session.zid())
        if not is_rmw:
            self._tokens.append(session.liveliness().declare_token(bridge_itself(zid)))
        for index, (row, namespace) in enumerate(zip(self.rows, self.namespaces, strict=True)):
            node = RmwNode(self.motion.domain, zid, 1 + index, namespace, RADIO_NODE)
            radio.join(row, session, node, self._messages, is_rmw=(is_rmw,))

    def _names_by_pose(self) -> dict[str, dict[str, str]]:
        """Return the robot of each pose, by the topic's full name and by the pose's name in its messages."""
        motion, name_of = self.motion, dict[str, dict[str, str]]()
        for index, name in enumerate(self.names):
            topic = absolute("/", _filled(motion.topic or TOPICS[motion.type], name, index))
            check_name(topic, "motion", "topic")
            is_frame, pose_name = motion.type == TRANSFORMS, ONLY
            if is_frame:
                pose_name = transform_name(motion.parent, _filled(motion.frame, name, index))
            if other := name_of.setdefault(topic, {}).get(pose_name):
                key = "frame" if is_frame else "topic"
                expected = "expected {name}, {index} or {number} in it"
                raise BadInput("motion", key, f"{expected}: {other} and {name} would have the same poses")
            name_of[topic][pose_name] = name
        return name_of

    def _open_router(self, endpoint: str) -> str:
        """Listen at an endpoint, and return it with the port that the system chose."""
        try:
            session, opened = open_router(endpoint)
        except zenoh.ZError as error:
            self.close()
            reason = f"cannot listen on {endpoint}: {str(error).split(' at ')[0]}"
            raise BadInput("motion", "listen", reason) from error
        self._subscribe(session)
        return opened

    def _connect(self, endpoint: str) -> None:
        """Try to connect until there is an answer; later zenoh itself connects again."""
        while not self._is_closed.is_set():
            try:
                session = open_client(endpoint, CONNECT_S)
            except zenoh.ZError:
                self._is_closed.wait(CONNECT_S)
            else:
                self._subscribe(session)
                return

    def _subscribe(self, session: zenoh.Session) -> None:
        """Subscribe to all topics, and take part in the graph of rmw_zenoh: some nodes publish for subscribers only."""
        with self._lock:
            self._sessions.append(session)
            radio = self._radio
        if radio:
            self._offer(radio, session)
        motion, is_rmw = self.motion, self.motion.transport == "rmw"
        node = RmwNode(motion.domain, str(session.zid()), 0, "/", NODE)
        tokens = [node.token] if is_rmw else []
        for number, topic in enumerate(self._name_of, start=1):
            if is_rmw:
                type_hash = self._messages.hash_of(motion.type)
                tokens.append(node.topic_token(number, READ, topic, motion.type, type_hash))
            Subscription(
                session,
                rmw_key(motion.domain, topic, motion.type) if is_rmw else bridge_key(topic),
                attached=is_rmw,
                on_payload=partial(self._take, self._name_of[topic]),
                on_fault=lambda _: self.count("poses_malformed"),
            )
        self._tokens += [session.liveliness().declare_token(token) for token in tokens]

    def _take(self, name_of: dict[str, str], payload: bytes) -> None:
        """Take the poses in a message; the network's threads call this."""
        try:
            message = self._messages.decode(self.motion.type, payload)
        except BadFrame:
            self.count("poses_malformed")
            return
        for part in poses_of(self.motion.type, message):
            if name := name_of.get(part.name):  # other transforms are those of wheels, sensors and other robots
                try:
                    stamp = part.header.stamp
                    stamp_ns = stamp.sec * NS_PER_S + stamp.nanosec
                    self.put(name, *space_pose(part.position, part.orientation), stamp_ns)
                except BadFrame:
                    self.count("poses_malformed")


def _filled(pattern: str, name: str, index: int) -> str:
    """Return a name for a robot; `{number}` counts from 1.

    >>> _filled("/{name}/odom", "flock-0", 0), _filled("/robot{number}/odom", "flock-0", 0)
    ('/flock_0/odom', '/robot1/odom')
    """
    filled = pattern.replace("{name}", ros_name(name)).replace("{index}", str(index))
    return filled.replace("{number}", str(index + 1))
