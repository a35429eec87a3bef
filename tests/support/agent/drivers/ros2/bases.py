"""A base as a driver meets it: a router with its topics, which speaks by the independent library alone."""

import struct
import threading
from collections.abc import Generator
from contextlib import contextmanager

import zenoh

from swarmwire.agent.drivers.ros2 import Ros2Driver, Ros2Options
from swarmwire.comms.base.clock import WallClock
from swarmwire.comms.protocols.ros2.links import close, open_router
from swarmwire.comms.robot.bodies.body import Body, body_from
from tests.support.comms.protocols.ros2 import independent

# As in rmw_zenoh's documentation and `ros2 topic info -v`.
HASHES = {
    "geometry_msgs/msg/Twist": "RIHS01_9c45bf16fe0983d80e3cfe750d6835843d265a9a6c46bd2e609fcddde6fb8d2a",
    "geometry_msgs/msg/TwistStamped": "RIHS01_5f0fcd4f81d5d06ad9b4c4c63e3ea51b82d6ae4d0558f1d475229b1121db6f64",
}
PROPER = struct.pack("<qqB", 1, 2, 16) + bytes(16)
SHEET = {
    "like": "turtlebot3-burger",
    "sensors": {
        "proximity": {
            "angles_deg": [0, 90, 180, -90],
            "range_m": 0.4,
            "response": {"kind": "quadratic", "a": 0.0, "b": -2.0, "c": 1.0, "reach_m": 0.5},
        },
        "light": {"angles_deg": [0, 180]},
    },
}


def turtlebot() -> Body:
    return body_from(SHEET, "turtlebot.toml")


class RosBase:
    """One base named flock_1 behind a bridge, or of rmw_zenoh.

    Attributes:
        received: the commands that it got, in order.
        attached: what came with them.
    """

    def __init__(self, transport: str, stamped: bool = False, endpoint: str = "tcp/127.0.0.1:0") -> None:
        self.transport, self.stamped = transport, stamped
        self.session, self.address = open_router(endpoint)
        self.received: list[independent.Twist] = []
        self.attached: list[bytes | None] = []
        self.arrivals = threading.Semaphore(0)
        kind = f"geometry_msgs/msg/Twist{'Stamped' if stamped else ''}"
        self.session.declare_subscriber(self.key("cmd_vel", kind), self._take)

    def key(self, topic: str, kind: str) -> str:
        if self.transport == "bridge":
            return f"flock_1/{topic}"
        name = f"{kind.split('/', maxsplit=1)[0]}::msg::dds_::{kind.split('/')[2]}_"
        return f"0/flock_1/{topic}/{name}/{HASHES.get(kind, 'RIHS01_00')}"

    def publish(self, topic: str, message, payload: bytes | None = None, attachment: bytes | None = PROPER) -> None:
        """Publish a message, or in its place other bytes under its kind."""
        kind = next(kind for kind, message_class in independent.BY_KIND.items() if isinstance(message, message_class))
        attached = None if self.transport == "bridge" else attachment
        self.session.put(
            self.key(topic, kind), message.serialize() if payload is None else payload, attachment=attached
        )

    def command(self) -> tuple[float, float]:
        """The next command: linear and angular."""
        assert self.arrivals.acquire(timeout=20.0)
        command = self.received[-1]
        return command.linear.x, command.angular.z

    def close(self) -> None:
        close(self.session)

    def _take(self, sample: zenoh.Sample) -> None:
        payload = sample.payload.to_bytes()
        kind = independent.TwistStamped if self.stamped else independent.Twist
        message = kind.deserialize(payload)
        self.received.append(message.twist if self.stamped else message)
        self.attached.append(sample.attachment and sample.attachment.to_bytes())
        self.arrivals.release()


@contextmanager
def base_and_driver(transport: str, **options) -> Generator[tuple[RosBase, Ros2Driver]]:
    """A base and the open driver of it, both closed in the end."""
    base = RosBase(transport, options.get("stamped", False))
    driver = Ros2Driver(
        base.address, turtlebot(), Ros2Options(transport=transport, **{"stale_s": 60.0, **options}), WallClock()
    )
    driver.robot = "flock-1"
    try:
        driver.open()
        yield base, driver
    finally:
        driver.close()
        base.close()
