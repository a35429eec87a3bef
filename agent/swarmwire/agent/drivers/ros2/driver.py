"""The driver of a ROS 2 base, which takes Twist and publishes LaserScan, Odometry, Imu, BatteryState, Illuminance.

`CommandPublisher` sends the current command when it changes and again 20 times per second, because bases time out.
`Ros2Driver` reads the newest message of each topic without waiting.
"""

import threading
from collections import Counter
from collections.abc import Callable
from math import copysign, isfinite
from typing import ClassVar

import zenoh

from swarmwire.agent.drivers.driver import STOP, Command, Driver, DriverLost
from swarmwire.agent.drivers.ros2.feed import Feed, SessionTopics
from swarmwire.agent.drivers.ros2.topics import Ros2Options, readers_of
from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.clock import NS_PER_S, Clock, DatedClock, to_ns
from swarmwire.comms.protocols.ros2.keys import TWIST, TWIST_STAMPED, absolute, ros_name
from swarmwire.comms.protocols.ros2.links import Publisher, check_endpoint, close, is_linked, open_client
from swarmwire.comms.protocols.ros2.messages import Messages, Velocities, encode_twist, encode_twist_stamped
from swarmwire.comms.robot.bodies.body import Body
from swarmwire.comms.robot.bodies.drives import Holonomic

RESEND_HZ = 20  # bases stop after 0.2 s to 1 s without a command
STOP_REPEATS = 3  # repetitions of a stop; afterwards, other nodes may drive the base
FRAME = "base_link"
POLL_NS = NS_PER_S // 100  # interval of checks for a base that takes commands


class CommandPublisher:
    """Repeats commands from a thread of its own. A stop is sent at once, and never followed by an earlier command."""

    def __init__(self, send: Callable[[Command], None], clock: Clock) -> None:
        self._send, self._clock = send, clock
        self._lock = threading.Lock()
        self._command, self._remaining_stops = STOP, STOP_REPEATS  # the current command; remaining repeats of a stop
        self._ended = False
        self._thread = threading.Thread(target=self._resend, name="ros2 commands", daemon=True)
        self.publish(STOP)
        self._thread.start()

    def publish(self, command: Command) -> None:
        """Send this command from now on; do nothing after `end`."""
        with self._lock:
            if not self._ended:
                self._command, self._remaining_stops = command, STOP_REPEATS
                self._send(command)

    def end(self) -> None:
        """Stop the base, and end the thread."""
        with self._lock:
            already_ended, self._ended = self._ended, True
            if not already_ended:
                self._send(STOP)
        self._thread.join()

    def _resend(self) -> None:
        next_ns = self._clock.now_ns()
        while True:
            next_ns = max(next_ns + NS_PER_S // RESEND_HZ, self._clock.now_ns())
            self._clock.sleep_until(next_ns)
            with self._lock:
                if self._ended:
                    return
                if self._command != STOP:
                    self._send(self._command)
                elif self._remaining_stops:
                    self._remaining_stops -= 1
                    self._send(STOP)


class Ros2Driver(Driver):
    """A ROS 2 base behind zenoh-bridge-ros2dds or rmw_zenoh's router; `address` is the endpoint of that.

    The base stays at rest, and commands have no effect, until every scanner, odometry and IMU that the agent needs has
    delivered a message.
    """

    options: ClassVar[type] = Ros2Options
    body_name: ClassVar[str] = "turtlebot3-burger"

    def __init__(self, address: str, body: Body, options: Ros2Options, clock: DatedClock) -> None:
        """Check the parameters; BadInput also if rosbags is not installed."""
        super().__init__(address, body, options, clock)
        check_endpoint(address, "driver", "address")
        options.check()
        self._options = options
        self._messages = Messages(options.distro)
        readers = readers_of(body, options)
        self._readers = tuple(readers.values())
        self._feeds = {topic: Feed(reader, self._messages, clock) for topic, reader in readers.items()}
        self._sensed_feeds: tuple[Feed, ...] = ()
        self._counts: Counter[str] = Counter()
        self._since_ns: int | None = None  # time of the connection
        self._session: zenoh.Session | None = None
        self._topics: SessionTopics | None = None
        self._commander: CommandPublisher | None = None
        self._publisher: Publisher | None = None

    @property
    def target(self) -> str:
        """Endpoint, domain, namespace and topic: several bases may be behind one router."""
        options = self._options
        return f"{self.address} {options.domain} {options.namespace or self.robot} {options.command_topic}"

    @property
    def measures(self) -> frozenset[str]:
        """Sensors of the body that have a topic."""
        sensors = (feed.sensors for feed in self._feeds.values())
        return frozenset[str]().union(*sensors) & self.body.sensors.keys()

    def open(self) -> None:
        """Connect, and wait for a base that takes commands; DriverLost after `connect_s`."""
        self.close()
        try:
            session = open_client(self.address, self._options.connect_s)
        except zenoh.ZError as error:
            raise DriverLost(f"no ROS 2 router answers at {self.address}: {error}") from error
        namespace = self._options.namespace or ros_name(self.robot)
        self._topics = topics = SessionTopics(session, namespace, self._options, self._messages)
        for (topic, feed), reader in zip(self._feeds.items(), self._readers, strict=True):
            feed.begin()
            topics.subscribe(topic, reader.kind, feed)
        publisher = topics.publisher(self._options.command_topic, TWIST_STAMPED if self._options.stamped else TWIST)
        self._session, self._publisher, self._sensed_feeds = session, publisher, ()
        self._wait_for_base(publisher)
        self._counts["reconnections"] += self._since_ns is not None
        self._since_ns = self.clock.now_ns()
        self._commander = CommandPublisher(lambda command: self._send(publisher, command), self.clock)

    def sense(self, sensors: frozenset[str]) -> dict[str, FloatArray]:
        """Return the readings of the newest messages, without waiting; DriverLost if a topic is silent too long."""
        self._check_link()
        if self._publisher is None or not self._publisher.has_subscribers:
            self.stop()
            raise DriverLost(self._no_base_text())
        self._sensed_feeds = tuple(feed for feed in self._feeds.values() if feed.sensors & sensors)
        fields: dict[str, FloatArray] = {}
        for feed in self._sensed_feeds:
            fields.update(feed.read())
        self._check_silence()
        return {name: value.copy() for name, value in fields.items() if name.split(".")[0] in sensors}

    def act(self, command: Command) -> None:
        """Send a command, and repeat it until the next one or `stop`."""
        commander = self._check_link()
        is_blind = any(feed.is_blind for feed in self._sensed_feeds)
        self._counts["held_back"] += is_blind
        commander.publish(STOP if is_blind else command)

    def stop(self) -> None:
        """Stop the base at once."""
        commander = self._commander
        if commander is not None:
            commander.publish(STOP)

    def counts(self) -> dict[str, int]:
        """Return the numbers of faults so far, by name."""
        counts = Counter(self._counts)
        counts["garbage"] = sum(feed.garbage for feed in self._feeds.values())
        for reader in self._readers:
            counts.update(reader.counts())
        counts["without_attachment"] += 0 if self._topics is None else self._topics.refused
        return dict(counts)

    def close(self) -> None:
        """Stop the base, and disconnect; safe to call more than once."""
        if self._session is None:
            return
        if self._commander is not None:
            self._commander.end()
        self._counts["without_attachment"] += 0 if self._topics is None else self._topics.refused
        close(self._session)
        self._session = self._topics = self._commander = self._publisher = None

    def _wait_for_base(self, publisher: Publisher) -> None:
        """Wait until a base takes commands; after `connect_s` close, and raise DriverLost."""
        deadline_ns = self.clock.now_ns() + to_ns(self._options.connect_s)
        while not publisher.has_subscribers:
            if self.clock.now_ns() >= deadline_ns:
                self.close()
                raise DriverLost(self._no_base_text())
            self.clock.sleep_until(self.clock.now_ns() + POLL_NS)

    def _check_silence(self) -> None:
        """Raise DriverLost if a topic in use is silent for too long; the first message may take `connect_s`."""
        now_ns, since_ns = self.clock.now_ns(), self._since_ns or 0
        for topic, feed in self._feeds.items():
            limit_s = max(self._options.stale_s, self._options.connect_s if feed.is_blind else 0.0)
            if feed in self._sensed_feeds and feed.silent_ns(now_ns, since_ns) > to_ns(limit_s):
                self.stop()
                raise DriverLost(f"nothing on the topic {topic} for {limit_s:g} s")

    def _no_base_text(self) -> str:
        options = self._options
        topic = absolute(options.namespace or ros_name(self.robot), options.command_topic)
        return f"no subscriber for {'TwistStamped' if options.stamped else 'Twist'} on {topic} behind {self.address}"

    def _check_link(self) -> CommandPublisher:
        """Return the commander of a working connection; DriverLost without one."""
        if self._session is None or self._commander is None:
            raise DriverLost(f"not connected to {self.address}")
        if not is_linked(self._session):
            raise DriverLost(f"the connection to {self.address} is cut")
        return self._commander

    def _send(self, publisher: Publisher, command: Command) -> None:
        velocities = self._within_limits(command)
        if not all(map(isfinite, velocities)):
            self._counts["not_finite"] += 1
            velocities = Velocities(0.0, 0.0)
        utc_ns = self.clock.utc_ns()
        stamped = self._options.stamped
        publisher.put(encode_twist_stamped(velocities, utc_ns, FRAME) if stamped else encode_twist(velocities), utc_ns)

    def _within_limits(self, command: Command) -> Velocities:
        """Clip each speed of a command to the body's limit; nan stays nan."""
        linear_mps, angular_radps = self.body.max_linear_mps, self.body.max_angular_radps
        return Velocities(
            _clipped(command.linear_mps, linear_mps),
            _clipped(command.angular_radps, angular_radps),
            _clipped(command.lateral_mps, linear_mps) if isinstance(self.body.drive, Holonomic) else 0.0,
        )


def _clipped(value: float, limit: float) -> float:
    return value if abs(value) <= limit or not isfinite(value) else copysign(limit, value)
