"""Messages of ROS 2 at both ends: what a base tells its driver, and what programs tell an emulated base."""

from typing import Any, NamedTuple

import numpy as np

from swarmwire.agent.drivers.ros2.feed import Feed
from swarmwire.agent.drivers.ros2.readers import (
    BatteryReader,
    ImuReader,
    LaserReader,
    LightReader,
    OdometryReader,
    Reader,
)
from swarmwire.comms.bodies.body import body_from
from swarmwire.comms.robots.ros2.attachment import attachment, publisher_id
from swarmwire.comms.robots.ros2.inlet import Inlet
from swarmwire.comms.robots.ros2.messages import Messages
from swarmwire.comms.robots.ros2.twist import Velocities, decode_either, encode_twist, encode_twist_stamped
from swarmwire.world.gateways.ros2 import Ros2GatewayOptions
from swarmwire.world.gateways.ros2.command_inbox import CommandInbox
from swarmwire.world.gateways.ros2.tellers import tellers_of
from tests.support.robots.ros2.ros2_rig import AT_START
from tests.tools.fuzz.byte_changes import changed_bytes
from tests.tools.fuzz.dice import Dice
from tests.tools.fuzz.target import ByteTarget
from tests.tools.fuzz.targets.air import StillClock

PROXIMITY = {
    "angles_deg": [0.0, 90.0, 180.0, 270.0],
    "range_m": 0.5,
    "response": {"kind": "quadratic", "a": 298.7, "b": -36.9, "c": 1.08, "reach_m": 0.05},
}
SENSES = {"scan": {"rate_hz": 0.0}, "light": {"angles_deg": [0, 180]}, "proximity": PROXIMITY}


class Message(NamedTuple):
    """A message of a kind."""

    kind: str
    data: bytes


class Told(ByteTarget):
    """What a base tells: laser scans, odometry, IMU, battery, light."""

    name = "ros2-driver"

    def make_samples(self) -> list[Any]:
        """What an emulated base tells, in ticks one after the other."""
        self.messages = messages = Messages("jazzy")
        self.body = body_from({"like": "turtlebot3-burger", "senses": SENSES}, "turtlebot.toml")
        fields = {**AT_START, "proximity.value": np.zeros((1, 4))}
        found: list[Message] = []
        for tick in range(3):
            for teller in tellers_of(self.body, 1, Ros2GatewayOptions(north_deg=30.0)):
                teller.follow(100_000_000 * tick, fields)
                told = teller.message(messages, fields, 0, 1_767_225_600_000_000_000 + tick)
                if told is not None:
                    found.append(Message(teller.kind, messages.encode(teller.kind, told)))
        return found

    def case(self, dice: Dice) -> Any:
        """A message with its bytes changed."""
        sample: Message = dice.pick(self.samples)
        others = [of.data for of in self.samples if of.kind == sample.kind]
        return Message(sample.kind, changed_bytes(dice, sample.data, others))

    def door(self, case: Message) -> str | None:
        """The feed of a topic: readings of the sheet's shapes, also after what is no message."""
        garbage = 0
        for reader in self._readers():
            if reader.kind != case.kind:
                continue
            feed = Feed(reader, self.messages, StillClock())
            shapes = {name: value.shape for name, value in reader.fields.items()}
            feed.take(case.data)
            fields = feed.look()
            if {name: value.shape for name, value in fields.items()} != shapes:
                raise AssertionError("readings of another shape")
            garbage += feed.garbage
        return "garbage" if garbage else None

    def _readers(self) -> tuple[Reader, ...]:
        body = self.body
        return (
            LaserReader(body, 0.0),
            OdometryReader(body.wheels.wheel_base_m, 0.22),
            ImuReader(30.0),
            BatteryReader(body.senses["battery"]),
            LightReader(np.zeros((1, 2)), 0, 1000.0),
        )


class Commanded(ByteTarget):
    """Commands at an emulated base, with the attachment of rmw_zenoh."""

    name = "ros2-base"

    def make_samples(self) -> list[Any]:
        """Both kinds of command."""
        told, attached = Velocities(0.2, -0.5), attachment(7, 1_767_225_600_000_000_000, publisher_id("token"))
        stamped = encode_twist_stamped(told, 1_767_225_600_000_000_000, "base_link")
        return [attached + encode_twist(told), attached + stamped]

    def door(self, case: bytes) -> str | None:
        """The inlet of the topic, and the inbox behind it."""
        inbox = CommandInbox(1_000_000_000, StillClock())
        inlet: Any = object.__new__(Inlet)
        inlet._attached, inlet._refuse = True, inbox.refuse
        inlet._take = lambda payload: inbox.take(payload, decode_either)
        size = len(attachment(0, 0, bytes(16)))
        inlet._receive(_Sample(_Bytes(case[:size]), _Bytes(case[size:])))
        newest, refused = inbox.newest(), sum(inbox.counts().values())
        if (newest is None) != (refused == 1):
            raise AssertionError("neither taken nor counted")
        if newest is not None and not np.isfinite(newest).all():
            raise AssertionError("a speed that is none")
        return next(iter(inbox.counts()), None)


class _Bytes(bytes):
    def to_bytes(self) -> bytes:
        return bytes(self)


class _Sample(NamedTuple):
    attachment: _Bytes
    payload: _Bytes
