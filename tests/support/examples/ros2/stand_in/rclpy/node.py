"""What the example takes of rclpy.node."""

import queue
from collections.abc import Callable
from typing import Any

from rclpy.wire import Wire
from swarmwire.comms.clock import NS_PER_S, WallClock


class Publisher:
    def __init__(self, publish: Callable[[Any], None]) -> None:
        self.publish = publish


class Node:
    """A node whose callbacks are called one after the other, as the executor of `rclpy.spin` does."""

    def __init__(self, name: str) -> None:
        assert Wire.opened is not None, "rclpy.init() was not called"
        self._wire = Wire.opened
        self._waiting: queue.SimpleQueue[tuple[Callable[[Any], None], Any]] = queue.SimpleQueue()
        self._timers: list[list[Any]] = []  # period and next time in ns, callback

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
