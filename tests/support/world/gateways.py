"""Gateways that follow a script, and ROS 2 nodes that listen to them."""

import struct
from collections import deque
from collections.abc import Generator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import zenoh

from swarmwire.comms.base.arrays import BoolArray, FloatArray
from swarmwire.comms.base.config import parameter
from swarmwire.comms.protocols.ros2.links import close, open_client
from swarmwire.comms.robot.bodies.body import Body, body_from
from swarmwire.comms.robot.tick_io import NOTHING_SET, SparseTable
from swarmwire.world.gateways.gateway import FRESH, ForeignCommands, Gateway
from swarmwire.world.gateways.ros2 import Ros2Gateway, Ros2GatewayOptions
from tests.support.clocks import StillClock, until
from tests.support.comms.protocols.ros2.independent import BY_KIND

PROPER = struct.pack("<qqB", 1, 2, 16) + bytes(16)
UTC_NS = 1_700_000_000 * 10**9
TICK_NS = 100_000_000
ALIVE = np.ones(2, np.bool_)
TWIST = "0/flock_1/cmd_vel/geometry_msgs::msg::dds_::Twist_/RIHS01_any"
TWIST_STAMPED = "0/flock_1/cmd_vel/geometry_msgs::msg::dds_::TwistStamped_/RIHS01_any"


@dataclass(frozen=True)
class ScriptedOptions:
    """Options of the gateway."""

    first: int = parameter(1, help="number of the first address", at_least=1)


@dataclass
class Published:
    """One call of `publish`."""

    time_ns: int
    fields: dict[str, FloatArray]
    alive: BoolArray
    ages_ns: Mapping[str, int]


class ScriptedGateway(Gateway):
    """Robots at "scripted:1" and so on, which drive as `drive` says."""

    options: ClassVar[type] = ScriptedOptions
    sensors: ClassVar[frozenset[str]] = frozenset({"proximity", "odometry", "imu"})
    instances: ClassVar[list["ScriptedGateway"]] = []

    def __init__(self, names, body, address, options, clock) -> None:
        super().__init__(names, body, address, options, clock)
        self.published: list[Published] = []
        self.drive: dict[int, tuple[float, float]] = {}  # index: command, until it is popped
        self.leds: SparseTable = NOTHING_SET
        self.faults: dict[str, int] = {}
        self.is_open = False
        ScriptedGateway.instances.append(self)

    def open(self) -> tuple[str, ...]:
        self.is_open = True
        return tuple(f"scripted:{self.option_values.first + at}" for at in range(len(self.names)))

    def publish(self, time_ns, fields, alive, ages_ns=FRESH) -> None:
        self.published.append(Published(time_ns, fields, alive, ages_ns))

    def pop_commands(self) -> ForeignCommands:
        drive, linear, angular = np.zeros(len(self.names), np.bool_), *np.zeros((2, len(self.names)))
        for index, command in self.drive.items():
            drive[index] = True
            linear[index], angular[index] = command
        leds, self.drive, self.leds = self.leds, {}, NOTHING_SET
        return ForeignCommands(drive, linear, angular, np.zeros_like(linear), leds)

    def counts(self) -> dict[str, int]:
        return self.faults

    def close(self) -> None:
        self.is_open = False


class DatedStillClock(StillClock):
    """A clock that the test moves, and that knows a date."""

    def utc_ns(self) -> int:
        return UTC_NS + self.time_ns


def turtlebot() -> Body:
    return body_from({"like": "turtlebot3-burger", "sensors": {"light": {"angles_deg": [0]}}}, "turtlebot.toml")


def readings() -> dict[str, np.ndarray]:
    """Readings of flock-0, all zero, and flock-1."""
    scan_m = np.full((2, 360), np.inf)
    scan_m[1, 90] = 0.5
    pairs = {
        "odometry.left_m": 0.1,
        "odometry.right_m": 0.1,
        "imu.forward_mps2": 1.0,
        "imu.left_mps2": 2.0,
        "imu.turn_radps": 0.3,
        "compass.heading_rad": 0.5,
        "battery.charge": 0.5,
        "battery.voltage_v": 11.0,
    }
    of_both = {name: np.array([0.0, value]) for name, value in pairs.items()}
    return {"scan.range_m": scan_m, "light.value": np.array([[0.0], [0.25]]), **of_both}


class RosNode:
    """A gateway of flock-0 and flock-1, and a client of it."""

    def __init__(self, body: Body | None = None, **options) -> None:
        self.clock = DatedStillClock()
        self.gateway = Ros2Gateway(
            ["flock-0", "flock-1"], body or turtlebot(), "", Ros2GatewayOptions(**options), self.clock
        )
        self.addresses = self.gateway.open()
        self.session = open_client(self.addresses[0], 5.0)
        self.tick, self.ages_ns = -1, FRESH

    def subscribe(self, key: str) -> deque[zenoh.Sample]:
        """Samples on this key, in the order of arrival."""
        samples: deque[zenoh.Sample] = deque()
        self.session.declare_subscriber(key, samples.append)
        return samples

    def publish(self, fields=None, alive=ALIVE) -> None:
        """The next tick of the world, at 10 Hz."""
        self.tick += 1
        self.gateway.publish(self.tick * TICK_NS, readings() if fields is None else fields, alive, self.ages_ns)

    def first(self, samples: deque[zenoh.Sample], fields=None):
        """The first sample that arrives while the world runs."""

        def look():
            if not samples:
                self.publish(fields)
            return samples

        return until(look)[0]

    def message(self, key: str, kind: str, fields=None):
        """The first message on this key, while these are the readings."""
        return BY_KIND[kind].deserialize(self.first(self.subscribe(key), fields).payload.to_bytes())

    def next_command(self):
        """The next command of flock-1: linear, angular."""
        commands = until(self.gateway.pop_commands, lambda commands: commands.drive.any())
        assert commands.drive.tolist() == [False, True]
        return float(commands.linear_mps[1]), float(commands.angular_radps[1])


@contextmanager
def ros_node(body: Body | None = None, **options) -> Generator[RosNode]:
    """A node and its gateway, by default of a TurtleBot3 with a photocell; both are closed at the end."""
    node = RosNode(body, **options)
    try:
        yield node
    finally:
        close(node.session)
        node.gateway.close()
