"""The e-puck2's protocol at both ends: commands at an emulated robot, answers at a driver, however they are cut."""

from collections import Counter
from typing import Any

import numpy as np

from swarmwire.agent.drivers.driver import DriverLost
from swarmwire.agent.drivers.epuck2.driver import Epuck2Driver
from swarmwire.agent.drivers.epuck2.link import Link
from swarmwire.agent.drivers.epuck2.options import Epuck2Options
from swarmwire.comms.bodies.body import load_body
from swarmwire.comms.robots.epuck2.command import RobotCommand
from swarmwire.comms.robots.epuck2.packets import Request, Settings
from swarmwire.comms.robots.epuck2.streams import Answers
from swarmwire.world.gateways.epuck2 import Epuck2Gateway
from swarmwire.world.gateways.epuck2.emulated_robot import Connection
from swarmwire.world.gateways.epuck2.options import Epuck2GatewayOptions
from tests.tools.fuzz.target import ByteTarget
from tests.tools.fuzz.targets.air import StillClock

PIECES = (1, 7, 21, 64, 1 << 20)  # bytes that come at once
BODY = load_body("epuck2")


class Transport:
    """In place of asyncio's: it keeps what is written."""

    def __init__(self) -> None:
        self.written, self.closed = b"", False

    def write(self, data: bytes) -> None:
        """Keep it."""
        self.written += data

    def abort(self) -> None:
        """Hang up."""
        self.closed = True

    def is_closing(self) -> bool:
        """Whether it was hung up."""
        return self.closed

    def get_write_buffer_size(self) -> int:
        """Everything is taken at once."""
        return 0

    def resume_reading(self) -> None:
        """It reads when it is told to."""

    def pause_reading(self) -> None:
        """It reads when it is told to."""


class Commands(ByteTarget):
    """Commands at an emulated robot."""

    name = "epuck2-robot"

    def make_samples(self) -> list[bytes]:
        """Commands that ask for each answer, alone and one after the other."""
        asked = [RobotCommand(100, -200, request=of).encoded() for of in (Request.NOTHING, Request.SENSORS)]
        steps = RobotCommand(3, 4, request=Request.SENSORS, settings=Settings.SET_STEPS).encoded()
        return [*asked, steps, b"".join(asked) * 2]

    def door(self, case: bytes) -> str | None:
        """The robot behind its connection: what it is told the loop can take, or it hangs up."""
        gateway = Epuck2Gateway(["a-0"], BODY, "", Epuck2GatewayOptions(), StillClock())
        robot, transport = gateway._robot(0), Transport()
        connection: Any = Connection(robot)
        connection.transport = transport
        robot.knock(connection)
        for piece in pieces(case):
            if transport.closed:
                break
            robot.hear(connection, piece)
        robot.miss(connection)
        told = gateway.take()
        if not (np.isfinite(told.linear_mps).all() and np.isfinite(told.angular_radps).all()):
            raise AssertionError("a speed that is none")
        list(Answers().fed(transport.written))
        return "hung up" if transport.closed else None


class Sensed(ByteTarget):
    """Answers at a driver."""

    name = "epuck2-driver"

    def make_samples(self) -> list[bytes]:
        """An empty answer, and sensors."""
        gateway = Epuck2Gateway(["a-0"], BODY, "", Epuck2GatewayOptions(), StillClock())
        return [b"\x03", gateway._answers[0], gateway._answers[0] * 3]

    def door(self, case: bytes) -> str | None:
        """The driver's link, and the readings that an agent gets."""
        driver = Epuck2Driver("127.0.0.1", BODY, Epuck2Options(north_deg=30.0), StillClock())
        link = _link(pieces(case))
        driver._link = link
        became = None
        try:
            for _ in range(link._left):
                link.receive(0.0)
        except DriverLost:
            became = "lost"
        driver._take(link)
        for name, value in driver._readings.of(driver._told_sensors, driver.gives).items():
            if value.dtype != np.float64:
                raise AssertionError(f"{name} of {value.dtype}")
        return became


def pieces(data: bytes) -> list[bytes]:
    """The bytes as a network cuts them, which depends on them alone."""
    size = PIECES[sum(data) % len(PIECES)]
    return [data[at : at + size] for at in range(0, len(data), size)]


def _link(some: list[bytes]) -> Any:
    """A link whose other end sends these."""

    class Sending:
        def recv(self, _most: int) -> bytes:
            return some.pop(0)

        def poll(self, _ms: float) -> bool:
            return bool(some)

    link: Any = object.__new__(Link)
    link._counts, link._answers, link.sent, link.answered, link.newest = Counter(), Answers(), 1, 0, None
    link._socket = link._arriving = Sending()
    link._left = len(some)
    return link
