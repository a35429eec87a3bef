"""What the example takes of rclpy.node, and its network.

That is a session as rmw_zenoh opens one, with keys and attachments written out by hand.
"""

import json
import queue
import struct
from collections.abc import Callable
from typing import Any, ClassVar

import zenoh

from swarmwire.comms.base.clock import NS_PER_S, WallClock

HASHES = {
    "geometry_msgs/msg/Twist": "RIHS01_9c45bf16fe0983d80e3cfe750d6835843d265a9a6c46bd2e609fcddde6fb8d2a",
    "std_msgs/msg/UInt8MultiArray": "RIHS01_5687e861b8d307a5e48b7515467ae7a5fc2daf805bd0ce6d8e9e604bade9f385",
    "sensor_msgs/msg/LaserScan": "RIHS01_64c191398013af96509d518dac71d5164f9382553fce5c1f8cca5be7924bd828",
}


class Wire:
    """Topics of one namespace. rmw_zenoh's sessions are peers that connect to a router and listen themselves."""

    opened: ClassVar["Wire | None"] = None

    def __init__(self, transport: str, endpoint: str, namespace: str) -> None:
        self._is_rmw, self._namespace = transport == "rmw", namespace.strip("/")
        config = {
            "mode": "peer",
            "connect": {"endpoints": [endpoint]},
            "listen": {"endpoints": ["tcp/localhost:0"]},
            "scouting": {"delay": 1, "multicast": {"enabled": False}, "gossip": {"enabled": True}},
        }
        self._session = zenoh.open(zenoh.Config.from_json5(json.dumps(config)))

    def publisher(self, kind: type[Any], topic: str) -> Callable[[Any], None]:
        """What publishes a message."""
        publisher, sent = self._session.declare_publisher(self._key(kind, topic)), 0

        def publish(message: Any) -> None:
            nonlocal sent
            sent += 1
            stamp = struct.pack("<qqB", sent, WallClock().utc_ns(), 16) + b"gid of 16 bytes."
            publisher.put(message.serialize(), attachment=stamp if self._is_rmw else None)

        return publish

    def subscribe(self, kind: type[Any], topic: str, take: Callable[[Any], None]) -> None:
        """`take` gets each message, in a thread of the network; without an attachment rmw_zenoh drops it."""

        def came(sample: zenoh.Sample) -> None:
            if not self._is_rmw or (sample.attachment is not None and len(sample.attachment.to_bytes()) == 33):
                take(kind.deserialize(sample.payload.to_bytes()))

        self._session.declare_subscriber(self._key(kind, topic), came)

    def close(self) -> None:
        """Hang up."""
        self._session.close()

    def _key(self, kind: type[Any], topic: str) -> str:
        name = f"{self._namespace}/{topic}".strip("/")
        if not self._is_rmw:
            return name
        typename = kind.__idl__.idl_transformed_typename.replace("::", "/")
        package, _, short = typename.split("/")
        return f"0/{name}/{package}::msg::dds_::{short}_/{HASHES[typename]}"


class Publisher:
    def __init__(self, publish: Callable[[Any], None]) -> None:
        self.publish = publish


class Logger:
    def info(self, text: str) -> None:
        print(text, flush=True)


class Parameter:
    def __init__(self, value: float) -> None:
        self.value = value


class Node:
    """A node whose callbacks are called one after the other, as the executor of `rclpy.spin` does."""

    parameters: ClassVar[dict[str, str]] = {}  # parameters of the command line

    def __init__(self, name: str) -> None:
        assert Wire.opened is not None, "rclpy.init() was not called"
        self._wire = Wire.opened
        self._waiting: queue.SimpleQueue[tuple[Callable[[Any], None], Any]] = queue.SimpleQueue()
        self._timers: list[list[Any]] = []  # period and next time in ns, callback

    def declare_parameter(self, name: str, default: float) -> Parameter:
        return Parameter(float(self.parameters.get(name, default)))

    def get_logger(self) -> Logger:
        return Logger()

    def create_publisher(self, kind: type[Any], topic: str, qos: object) -> Publisher:
        return Publisher(self._wire.publisher(kind, topic))

    def create_subscription(self, kind: type[Any], topic: str, callback: Callable[[Any], None], qos: object) -> None:
        self._wire.subscribe(kind, topic, lambda message: self._waiting.put((callback, message)))

    def create_timer(self, period_s: float, callback: Callable[[], None]) -> None:
        period_ns = round(period_s * NS_PER_S)
        self._timers.append([period_ns, WallClock().now_ns() + period_ns, callback])

    def destroy_node(self) -> None:
        self._timers.clear()

    def spin(self) -> None:
        while True:
            due_ns = min(timer[1] for timer in self._timers)
            try:
                callback, message = self._waiting.get(timeout=max(0.0, (due_ns - WallClock().now_ns()) / NS_PER_S))
                callback(message)
            except queue.Empty:
                self._tick()

    def _tick(self) -> None:
        for timer in self._timers:
            if WallClock().now_ns() >= timer[1]:
                timer[1] += timer[0]
                timer[2]()
