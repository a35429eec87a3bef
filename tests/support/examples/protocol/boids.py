"""The rule of the runner that knows swarmwire by its protocol alone, as an agent of swarmwire."""

import math
from typing import ClassVar

from examples.protocol.runner import steer
from swarmwire.agent import Agent, Message, Robot, f4


class Heading(Message):
    """What a boid broadcasts; of the same name and field, and so of the same tag, as that of Flocking."""

    heading_rad: f4


class Boid(Agent):
    """One robot that steers as the example does."""

    needs: ClassVar[tuple[str, ...]] = ("proximity", "compass", "radio.range", "radio.bearing")

    def step(self, robot: Robot) -> None:
        """Steer, and broadcast the heading."""
        heading, sheet = robot.compass.heading_rad, robot.body.proximity
        assert sheet is not None
        angles = [math.radians(angle) for angle in sheet.angles_deg]
        received = [(p.range_m, p.bearing_rad, p.message.heading_rad) for p in robot.radio.received(Heading)]
        robot.drive(*steer(heading, angles, robot.proximity.value.tolist(), received))
        robot.radio.send(Heading(heading_rad=heading))
