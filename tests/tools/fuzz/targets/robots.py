"""Protocols of robots at both ends: the e-puck2's commands and answers, ROS 2's messages."""

import socket
from collections import Counter
from contextlib import closing
from typing import Any, NamedTuple

import numpy as np
from hypothesis.strategies import DrawFn

from swarmwire.agent.drivers.driver import DriverLost
from swarmwire.agent.drivers.epuck2.driver import Epuck2Driver, Epuck2Options
from swarmwire.agent.drivers.epuck2.link import RobotLink
from swarmwire.agent.drivers.ros2.feed import Feed
from swarmwire.agent.drivers.ros2.topics import (
    BatteryReader,
    CliffReader,
    HazardReader,
    ImuReader,
    LaserReader,
    LightReader,
    OdometryReader,
)
from swarmwire.comms.protocols.epuck2.packets import Answers, PacketRequest, RobotCommand, RobotSettingsBits
from swarmwire.comms.protocols.ros2.keys import attachment, publisher_id
from swarmwire.comms.protocols.ros2.links import Subscription
from swarmwire.comms.protocols.ros2.messages import (
    Messages,
    Velocities,
    decode_either,
    encode_twist,
    encode_twist_stamped,
)
from swarmwire.comms.robot.bodies.body import body_from, load_body
from swarmwire.world.gateways.epuck2 import Epuck2Gateway
from swarmwire.world.gateways.epuck2.emulated_robot import UnreadBytes
from swarmwire.world.gateways.epuck2.gateway import Epuck2GatewayOptions
from swarmwire.world.gateways.ros2 import Ros2GatewayOptions
from swarmwire.world.gateways.ros2.base import CommandInbox
from swarmwire.world.gateways.ros2.publishers import broadcasters_of
from tests.support.robots.rigs import AT_START
from tests.tools.fuzz.mutations import mutated_bytes, pick
from tests.tools.fuzz.target import ByteTarget
from tests.tools.fuzz.targets.radio import CLOCK, Payload

MAX_CHUNKS = 100  # that a robot is sent
CHUNK_BYTES = (1, 7, 21, 64, 1 << 20)
EPUCK2 = load_body("epuck2")
UTC_NS = 1_767_225_600_000_000_000


class Epuck2Commands(ByteTarget):
    """Commands to an emulated e-puck2: the loop gets speeds that are numbers, or the robot hangs up."""

    name = "epuck2-robot"

    def make_samples(self) -> list[bytes]:
        requests = PacketRequest.NOTHING, PacketRequest.SENSORS
        one, two = (RobotCommand(100, -200, request=request).encoded() for request in requests)
        steps = RobotCommand(3, 4, request=PacketRequest.SENSORS, settings=RobotSettingsBits.SET_STEPS).encoded()
        return [one, two, steps, one + two + one + two]

    def feed(self, case: bytes) -> str | None:
        gateway = Epuck2Gateway(["a-0"], EPUCK2, "", Epuck2GatewayOptions(), CLOCK)
        robot, answers, hung_up = gateway._robot(0), Answers(), False
        with socket.create_server(("127.0.0.1", 0)) as server:
            client = socket.create_connection(server.getsockname())
            robot.connect(server.accept()[0])
        with client, closing(UnreadBytes()) as unread:
            for chunk in chunks(case)[:MAX_CHUNKS]:
                try:
                    client.sendall(chunk)
                    robot.do_pass(unread)
                    robot.do_pass(unread)
                    list(answers.fed(client.recv(1 << 16, socket.MSG_DONTWAIT)))
                except BlockingIOError:  # it has said nothing
                    continue
                except ConnectionError:
                    hung_up = True
                    break
        robot.hang_up()
        commands = gateway.pop_commands()
        if not (np.isfinite(commands.linear_mps).all() and np.isfinite(commands.angular_radps).all()):
            raise AssertionError("a speed that is not finite")
        return "hung up" if hung_up else None


class Epuck2Answers(ByteTarget):
    """Answers of an e-puck2 to its driver, up to the readings that an agent gets."""

    name = "epuck2-driver"

    def make_samples(self) -> list[bytes]:
        sensors = Epuck2Gateway(["a-0"], EPUCK2, "", Epuck2GatewayOptions(), CLOCK)._answers[0]
        return [b"\x03", sensors, sensors * 3]

    def feed(self, case: bytes) -> str | None:
        driver = Epuck2Driver("127.0.0.1", EPUCK2, Epuck2Options(north_deg=30.0), CLOCK)
        arriving = chunks(case)
        link, refused = link_of(arriving), None
        driver._link = link
        try:
            for _ in range(len(arriving)):
                link.receive(0.0)
        except DriverLost:
            refused = "lost"
        driver._read_newest(link)
        for name, value in driver._readings.read(driver._newest_sensors, driver.measures).items():
            if value.dtype != np.float64:
                raise AssertionError(f"{name} of {value.dtype}")
        return refused


def chunks(data: bytes) -> list[bytes]:
    """The bytes as a network cuts them, which depends on them alone."""
    size = CHUNK_BYTES[sum(data) % len(CHUNK_BYTES)]
    return [data[at : at + size] for at in range(0, len(data), size)]


def link_of(arriving: list[bytes]) -> Any:
    """A link whose other end sends these chunks, and takes them off the list."""

    class Socket:
        def recv(self, _max_bytes: int) -> bytes:
            return arriving.pop(0)

        def poll(self, _timeout_ms: float) -> bool:
            return bool(arriving)

    link: Any = object.__new__(RobotLink)
    link._counts, link._answers, link.sent, link.answered, link.newest = Counter(), Answers(), 1, 0, None
    link._socket = link._arriving = Socket()
    return link


PROXIMITY = {
    "angles_deg": [0.0, 90.0, 180.0, 270.0],
    "range_m": 0.5,
    "response": {"kind": "quadratic", "a": 298.7, "b": -36.9, "c": 1.08, "reach_m": 0.05},
}
SENSORS = {"scan": {"rate_hz": 0.0}, "light": {"angles_deg": [0, 180]}, "proximity": PROXIMITY}


class Ros2Message(NamedTuple):
    """An encoded message, and its kind."""

    kind: str
    data: bytes


class Ros2Sensors(ByteTarget):
    """Messages of a ROS 2 base to its driver: whatever comes, the readings keep their shapes."""

    name = "ros2-driver"

    def make_samples(self) -> list[Any]:
        self.messages = Messages("jazzy")
        self.body = body_from({"like": "turtlebot4", "sensors": SENSORS}, "turtlebot.toml")
        fields = {**AT_START, "proximity.value": np.zeros((1, 4))}
        fields |= {"bumper.pressed": np.ones(1), "ground.shade": np.zeros((1, 4))}
        samples: list[Ros2Message] = []
        for tick in range(3):
            for broadcaster in broadcasters_of(self.body, 1, Ros2GatewayOptions(north_deg=30.0)):
                broadcaster.follow(100_000_000 * tick, fields)
                message = broadcaster.message(self.messages, fields, 0, UTC_NS + tick)
                if message is not None:
                    samples.append(Ros2Message(broadcaster.kind, self.messages.encode(broadcaster.kind, message)))
        return samples

    def mutated(self, draw: DrawFn) -> Any:
        kind, data = pick(draw, self.samples)
        return Ros2Message(kind, mutated_bytes(draw, data, [one.data for one in self.samples if one.kind == kind]))

    def feed(self, case: Ros2Message) -> str | None:
        body, garbage = self.body, 0
        odometry, battery = OdometryReader(body.wheels.wheel_base_m, 0.22), BatteryReader(body.sensors["battery"])
        light, hazards, cliffs = LightReader(np.zeros((1, 2)), 0, 1000.0), HazardReader(), CliffReader(body.ground)
        for reader in (LaserReader(body, 0.0), odometry, ImuReader(30.0), battery, light, hazards, cliffs):
            if reader.kind != case.kind:
                continue
            feed = Feed(reader, self.messages, CLOCK)
            shapes = {name: value.shape for name, value in reader.fields.items()}
            feed.put(case.data)
            if {name: value.shape for name, value in feed.read().items()} != shapes:
                raise AssertionError("readings of another shape")
            garbage += feed.garbage
        return "garbage" if garbage else None


class AttachedSample(NamedTuple):
    """In place of zenoh's."""

    attachment: Payload
    payload: Payload


class Ros2Commands(ByteTarget):
    """Commands to an emulated ROS 2 base, with the attachment of rmw_zenoh: taken or counted, and finite."""

    name = "ros2-base"

    def make_samples(self) -> list[Any]:
        command, attached = Velocities(0.2, -0.5), attachment(7, UTC_NS, publisher_id("token"))
        return [attached + encode_twist(command), attached + encode_twist_stamped(command, UTC_NS, "base_link")]

    def feed(self, case: bytes) -> str | None:
        inbox = CommandInbox(1_000_000_000, CLOCK)
        subscription: Any = object.__new__(Subscription)
        subscription._attached, subscription._on_fault = True, inbox.refuse
        subscription._on_payload = lambda payload: inbox.accept(payload, decode_either)
        size = len(attachment(0, 0, bytes(16)))
        subscription._receive(AttachedSample(Payload(case[:size]), Payload(case[size:])))
        newest, refused = inbox.pop_newest(), sum(inbox.counts().values())
        if (newest is None) != (refused == 1):
            raise AssertionError("neither taken nor counted")
        if newest is not None and not np.isfinite(newest).all():
            raise AssertionError("a speed that is not finite")
        return next(iter(inbox.counts()), None)
