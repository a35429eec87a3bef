"""A finite state machine: a method for each state, which acts and says what the next state is.

Right for missions with phases, where what to do depends on what was done. The state is always one of a few, so it can
be noted, drawn and counted.
"""

from enum import Enum

import numpy as np

from swarmwire.agent import Agent, Message, Robot, f4, parameter


class Call(Message):
    """I am at the lamp."""

    brightness: f4


class Doing(Enum):
    """The states, by the name under which recordings and pictures show them."""

    WANDERING = "wanders"
    TURNING = "turns away"
    COMING = "comes"
    CALLING = "calls"


class Seeker(Agent):
    """Wander until the lamp shines on the robot, then stay and call; come to whoever calls; turn from what is near."""

    needs = ("proximity", "light", "radio.bearing")
    speed_mps: float = 0.1
    turn_radps: float = 2.0
    safe_m: float = parameter(0.03, help="distance to the front below which an object blocks")
    bright: float = parameter(1.2, help="sum over the light sensors at which the robot is at the lamp")
    patience_s: float = parameter(3.0, help="time for which a call is followed")

    def __init__(self) -> None:
        self.doing = Doing.WANDERING
        self.side = 0.0  # to which it turns from what is in the way: 1 left, -1 right
        self.call_rad = 0.0  # where the last call came from
        self.called_until_s = 0.0
        self.acts = {
            Doing.WANDERING: self.wander,
            Doing.TURNING: self.turn,
            Doing.COMING: self.come,
            Doing.CALLING: self.call,
        }

    def step(self, robot: Robot) -> None:
        """Listen, go over to the next state, and act as it says."""
        for packet in robot.radio.received(Call):
            self.call_rad, self.called_until_s = packet.bearing_rad, robot.time_s + self.patience_s
        self.doing = self.next_state(robot)
        robot.note(self.doing.value)
        self.acts[self.doing](robot)

    def next_state(self, robot: Robot) -> Doing:
        """All transitions; the same from every state, but a turn that was begun keeps its side."""
        in_the_way_rad = self.in_the_way_rad(robot)
        if in_the_way_rad is not None and self.doing is not Doing.TURNING:
            self.side = -1.0 if in_the_way_rad > 0.0 else 1.0
        if float(np.sum(robot.light.value)) > self.bright:
            return Doing.CALLING
        if in_the_way_rad is not None:
            return Doing.TURNING
        return Doing.COMING if robot.time_s < self.called_until_s else Doing.WANDERING

    def in_the_way_rad(self, robot: Robot) -> float | None:
        """Direction of what is nearest ahead, None if the way is free."""
        rays = robot.proximity
        distance = np.where(np.abs(rays.angle_rad) < 1.0, rays.distance_m, np.inf)
        nearest = int(np.argmin(distance))
        return None if distance[nearest] > self.safe_m else float(rays.angle_rad[nearest])

    def wander(self, robot: Robot) -> None:
        """Ahead, with turns at random."""
        robot.drive(self.speed_mps, robot.draw.normal("wander"))

    def turn(self, robot: Robot) -> None:
        """On the spot, away from what is in the way."""
        robot.drive(0.0, self.side * self.turn_radps)

    def come(self, robot: Robot) -> None:
        """To where the last call came from; the robot turns that way meanwhile."""
        robot.drive(self.speed_mps, self.call_rad)
        self.call_rad -= self.call_rad * robot.period_s

    def call(self, robot: Robot) -> None:
        """Stay, and tell the others."""
        robot.drive(0.0, 0.0)
        robot.radio.send(Call(brightness=float(np.sum(robot.light.value))))
