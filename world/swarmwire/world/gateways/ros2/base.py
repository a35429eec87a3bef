"""One emulated ROS 2 base: the commands that it receives, and its topics on the network.

A base has its topics on the keys of a bridge and of rmw_zenoh, and its place in the ROS graph. A `Broadcaster` is one
topic of every base; `ReadingRate` gives the ticks in which it has something new.
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

REST = Velocities(0.0, 0.0)
COMMAND_TOPIC, NODE = "cmd_vel", "base"
Fields = dict[str, FloatArray]  # "sensor.field" -> (n,) or (n, width)
NEAR = 1e-6  # a reading that misses its time by less than this share of a period is due


class ReadingRate:
    """The ticks in which a reading is due, as for the sensors of the world."""

    def __init__(self, rate_hz: float) -> None:
        """0: in each tick."""
        self._rate_hz = rate_hz
        self._last = -1

    def is_due(self, time_ns: int) -> bool:
        """Whether a reading is due at this time since the start of the run, which may not go back."""
        if not self._rate_hz:
            return True
        now = floor(time_ns * self._rate_hz / NS_PER_S + NEAR)
        due, self._last = now > self._last, max(now, self._last)
        return due


class Broadcaster(ABC):
    """One topic of every base. Its messages are stamped with the time at which their readings were measured.

    Attributes:
        kind: of its messages.
        topic: its name within the namespace of a base.
        reads: the fields that it needs, or one of them.
        rate_hz: how often there is something new; 0: in each tick.
        qos: that of its publishers.
    """

    kind: str
    reads: tuple[str, ...]
    topic: str
    rate_hz: float
    qos: Qos = DEFAULT_QOS

    def is_published(self, fields: Fields) -> bool:
        """Whether there is anything to publish."""
        return any(name in fields for name in self.reads)

    def age_ns(self, ages_ns: Mapping[str, int]) -> int:
        """The age of its oldest reading, by those of all sensors."""
        return max((ages_ns.get(name.partition(".")[0], 0) for name in self.reads), default=0)

    def follow(self, time_ns: int, fields: Fields) -> None:
        """Take note of new readings, measured at this time, whether or not anybody subscribes."""
        return

    @abstractmethod
    def message(self, messages: Messages, fields: Fields, base: int, stamp_ns: int) -> Any | None:
        """The message of one base; None: its reading was lost."""


class CommandInbox:
    """Keeps the newest command, and stops a base that gets none for a while, as real ones do.

    Attributes:
        is_open: whether commands are taken; the dead take none.
    """

    def __init__(self, timeout_ns: int, clock: Clock) -> None:
        self.is_open = True
        self._counts: Counter[str] = Counter()
        self._timeout_ns, self._clock = timeout_ns, clock
        self._lock = threading.Lock()
        self._came: tuple[int, Velocities] | None = None  # the newest that was not taken yet, and when
        self._until_ns: int | None = None  # when a base that drives will stop by itself
        self._rests = False  # it is to be told so before anything else

    def take(self, payload: bytes, decode: Callable[[bytes], Velocities]) -> None:
        """A command came; it is counted instead if it cannot be read."""
        try:
            told = decode(payload)
        except BadFrame as error:
            self.refuse(error.fault)
            return
        with self._lock:
            if self.is_open:
                self._came = self._clock.now_ns(), told

    def refuse(self, fault: str) -> None:
        """Count what is no command."""
        with self._lock:
            self._counts[fault] += 1

    def counts(self) -> Counter[str]:
        """What was refused so far, and how often the base stopped by itself, by name."""
        with self._lock:
            return self._counts.copy()

    def newest(self) -> Velocities | None:
        """The command that holds from now on; None: still the one before."""
        now_ns = self._clock.now_ns()
        with self._lock:
            if self._rests:
                self._rests = False
                return REST
            came, self._came = self._came, None
            if came is not None:
                at_ns, told = came
                self._until_ns = at_ns + self._timeout_ns if told != REST else None
                return told
            if self._until_ns is not None and now_ns >= self._until_ns:
                self._until_ns = None
                self._counts["command_timeouts"] += 1
                return REST
        return None

    def forget(self) -> None:
        """Be at rest, and drop what waits: the base died."""
        with self._lock:
            self._came = self._until_ns = None
            self._rests = True


class Base:
    """A base that takes Twist and TwistStamped on `cmd_vel`, and has a topic for each broadcaster.

    Attributes:
        inbox: its commands.
        publishers: of each broadcaster: to nodes behind a bridge, and to those of rmw_zenoh; none while it is hidden.
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
        """`node` is what it is in the graph of rmw_zenoh; `stamped` is which kind of command the graphs tell of."""
        self.inbox = inbox
        self._session = session
        topics = [(WRITE, of.topic, of.kind, of.qos) for of in broadcasters]
        topics.append((READ, COMMAND_TOPIC, TWIST_STAMPED if stamped else TWIST, DEFAULT_QOS))
        named = [
            (way, absolute(node.namespace, topic), kind, messages.hash_of(kind), qos)
            for way, topic, kind, qos in topics
        ]
        in_rmw = [node.topic_token(place, *of) for place, of in enumerate(named, start=1)]
        self._tokens = [node.token, *in_rmw, *dict.fromkeys(bridge_token(node.zid, *of) for of in named)]
        self._declared: list[Any] = []
        self.publishers: list[tuple[Publisher, Publisher]] = []
        self._openers = [
            (
                partial(Publisher, session, bridge_key(topic), None, qos),
                partial(Publisher, session, rmw_key(node.domain, topic, kind, type_hash), token, qos),
            )
            for (way, topic, kind, type_hash, qos), token in zip(named, in_rmw, strict=True)
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
        """Take commands, and let the graphs have it; nothing happens if they do."""
        if self._subscriptions:
            return
        self.inbox.is_open = True
        for key, decode, attached in self._commands:
            take = partial(self.inbox.take, decode=decode)
            self._subscriptions.append(
                Subscription(self._session, key, attached=attached, on_payload=take, on_fault=self.inbox.refuse)
            )
        self.publishers = [(to_bridge(), to_rmw()) for to_bridge, to_rmw in self._openers]
        self._declared = [self._session.liveliness().declare_token(token) for token in self._tokens]

    def hide(self) -> None:
        """Vanish from the graphs, as a base that was switched off; nothing happens if it did."""
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
        self.inbox.forget()
