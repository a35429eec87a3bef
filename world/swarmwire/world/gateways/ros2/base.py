"""One emulated ROS 2 base: the commands that it receives, and its topics on the network.

A base has its topics on the keys of a bridge and of rmw_zenoh, and its node in the ROS graph. A `Broadcaster` is one
topic of every base; `ReadingRate` determines the ticks with new readings.
"""

import threading
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Callable, Mapping
from functools import partial
from math import floor
from typing import Any

import zenoh

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.clock import NS_PER_S, Clock
from swarmwire.comms.base.errors import BadFrame
from swarmwire.comms.protocols.ros2.keys import (
    DEFAULT_QOS,
    READ,
    TWIST,
    TWIST_STAMPED,
    WRITE,
    Qos,
    RmwNode,
    absolute,
    bridge_key,
    bridge_token,
    rmw_key,
)
from swarmwire.comms.protocols.ros2.links import Publisher, Subscription
from swarmwire.comms.protocols.ros2.messages import (
    Messages,
    Velocities,
    decode_either,
    decode_twist,
    decode_twist_stamped,
)

STANDSTILL = Velocities(0.0, 0.0)
COMMAND_TOPIC, NODE = "cmd_vel", "base"
Fields = dict[str, FloatArray]  # "sensor.field" -> (n,) or (n, width)
NEAR = 1e-6  # a reading that misses its time by less than this share of a period is due


class ReadingRate:
    """The ticks in which a reading is due, as for the sensors of the world."""

    def __init__(self, rate_hz: float) -> None:
        """`rate_hz` of 0 is every tick."""
        self._rate_hz = rate_hz
        self._last = -1

    def is_due(self, time_ns: int) -> bool:
        """Return True if a reading is due at this time of the run; times must not decrease."""
        if not self._rate_hz:
            return True
        now = floor(time_ns * self._rate_hz / NS_PER_S + NEAR)
        due, self._last = now > self._last, max(now, self._last)
        return due


class Broadcaster(ABC):
    """One topic of every base. Its messages are stamped with the time at which their readings were measured.

    Attributes:
        kind: type of its messages.
        topic: its name within the namespace of a base.
        reads: fields of its readings.
        rate_hz: rate of new readings; 0: every tick.
        qos: quality of service of its publishers.
    """

    kind: str
    reads: tuple[str, ...]
    topic: str
    rate_hz: float
    qos: Qos = DEFAULT_QOS

    def is_published(self, fields: Fields) -> bool:
        """Return True if the readings have one of its fields."""
        return any(name in fields for name in self.reads)

    def age_ns(self, ages_ns: Mapping[str, int]) -> int:
        """Return the age of its oldest reading, by the ages of all sensors."""
        return max((ages_ns.get(name.partition(".")[0], 0) for name in self.reads), default=0)

    def follow(self, time_ns: int, fields: Fields) -> None:
        """Update with new readings, measured at this time, also without subscribers."""
        return

    @abstractmethod
    def message(self, messages: Messages, fields: Fields, base: int, stamp_ns: int) -> Any | None:
        """Return the message of one base; None if its reading was lost."""


class CommandInbox:
    """Stores the newest command, and stops a base without commands after a time-out, as real ones do.

    Attributes:
        is_open: True if commands are accepted; False for a dead base.
    """

    def __init__(self, timeout_ns: int, clock: Clock) -> None:
        self.is_open = True
        self._counts: Counter[str] = Counter()
        self._timeout_ns, self._clock = timeout_ns, clock
        self._lock = threading.Lock()
        self._pending: tuple[int, Velocities] | None = None  # time of arrival and velocities of the newest command
        self._stop_ns: int | None = None  # time at which a driving base stops without a new command
        self._was_reset = False  # the next command is a standstill

    def accept(self, payload: bytes, decode: Callable[[bytes], Velocities]) -> None:
        """Store a command, or count a malformed one."""
        try:
            velocities = decode(payload)
        except BadFrame as error:
            self.refuse(error.fault)
            return
        with self._lock:
            if self.is_open:
                self._pending = self._clock.now_ns(), velocities

    def refuse(self, fault: str) -> None:
        """Count a malformed command."""
        with self._lock:
            self._counts[fault] += 1

    def counts(self) -> Counter[str]:
        """Return the numbers of refused commands and of time-outs, by name."""
        with self._lock:
            return self._counts.copy()

    def pop_newest(self) -> Velocities | None:
        """Remove and return the newest command; None: the last command continues."""
        now_ns = self._clock.now_ns()
        with self._lock:
            if self._was_reset:
                self._was_reset = False
                return STANDSTILL
            pending, self._pending = self._pending, None
            if pending is not None:
                arrived_ns, velocities = pending
                self._stop_ns = arrived_ns + self._timeout_ns if velocities != STANDSTILL else None
                return velocities
            if self._stop_ns is not None and now_ns >= self._stop_ns:
                self._stop_ns = None
                self._counts["command_timeouts"] += 1
                return STANDSTILL
        return None

    def reset(self) -> None:
        """Drop the pending command of a base that died, and stop it."""
        with self._lock:
            self._pending = self._stop_ns = None
            self._was_reset = True


class Base:
    """A base that accepts Twist and TwistStamped on `cmd_vel`, and has a topic for each broadcaster.

    Attributes:
        session: the session with its topics.
        node: its node in the graph of rmw_zenoh.
        inbox: its commands.
        publishers: publishers of each broadcaster to nodes behind a bridge and of rmw_zenoh; [] while it is hidden.
    """

    def __init__(
        self,
        session: zenoh.Session,
        node: RmwNode,
        broadcasters: tuple[Broadcaster, ...],
        messages: Messages,
        inbox: CommandInbox,
        *,
        stamped: bool,
    ) -> None:
        """`stamped`: the graphs announce `cmd_vel` as TwistStamped."""
        self.inbox, self.session, self.node = inbox, session, node
        topics = [(WRITE, each.topic, each.kind, each.qos) for each in broadcasters]
        topics.append((READ, COMMAND_TOPIC, TWIST_STAMPED if stamped else TWIST, DEFAULT_QOS))
        endpoints = [
            (way, absolute(node.namespace, topic), kind, messages.hash_of(kind), qos)
            for way, topic, kind, qos in topics
        ]
        rmw_tokens = [node.topic_token(number, *endpoint) for number, endpoint in enumerate(endpoints, start=1)]
        bridge_tokens = dict.fromkeys(bridge_token(node.zid, *endpoint) for endpoint in endpoints)
        self._tokens = [node.token, *rmw_tokens, *bridge_tokens]
        self._declared: list[Any] = []
        self.publishers: list[tuple[Publisher, Publisher]] = []
        self._openers = [
            (
                partial(Publisher, session, bridge_key(topic), None, qos),
                partial(Publisher, session, rmw_key(node.domain, topic, kind, type_hash), token, qos),
            )
            for (way, topic, kind, type_hash, qos), token in zip(endpoints, rmw_tokens, strict=True)
            if way == WRITE
        ]
        topic, domain = absolute(node.namespace, COMMAND_TOPIC), node.domain
        self._commands = (
            (bridge_key(topic), decode_either, False),
            (rmw_key(domain, topic, TWIST), decode_twist, True),
            (rmw_key(domain, topic, TWIST_STAMPED), decode_twist_stamped, True),
        )
        self._subscriptions: list[Subscription] = []
        self.show()

    def show(self) -> None:
        """Accept commands, and appear in the graphs; no effect if it is visible."""
        if self._subscriptions:
            return
        self.inbox.is_open = True
        for key, decode, attached in self._commands:
            accept = partial(self.inbox.accept, decode=decode)
            self._subscriptions.append(
                Subscription(self.session, key, attached=attached, on_payload=accept, on_fault=self.inbox.refuse)
            )
        self.publishers = [(to_bridge(), to_rmw()) for to_bridge, to_rmw in self._openers]
        self._declared = [self.session.liveliness().declare_token(token) for token in self._tokens]

    def hide(self) -> None:
        """Disappear from the graphs, as a base that was switched off; no effect if it is hidden."""
        if not self._subscriptions:
            return
        for token in self._declared:
            token.undeclare()
        for subscription in self._subscriptions:
            subscription.close()
        for pair in self.publishers:
            for publisher in pair:
                publisher.close()
        self._declared, self._subscriptions, self.publishers = [], [], []
        self.inbox.is_open = False
        self.inbox.reset()
