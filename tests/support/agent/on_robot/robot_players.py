"""Agents that run on scripted robots: each shows one thing that the loop does."""

import ctypes
import os
from typing import ClassVar

from swarmwire.agent import Agent, Memory, Message, PerRobot, Robot, Robots, VectorAgent, i2, parameter


class Count(Message):
    number: i2


class Driving(Agent):
    """Drives the same way in every step."""

    linear_mps: float = 0.03
    angular_radps: float = 0.5
    lateral_mps: float = 0.0

    def step(self, robot: Robot) -> None:
        robot.drive(self.linear_mps, self.angular_radps, self.lateral_mps)


class Once(Agent):
    """Drives in its first step alone, and gives nan in its third."""

    def __init__(self) -> None:
        self.steps = 0

    def step(self, robot: Robot) -> None:
        if self.steps == 0:
            robot.drive(0.02, 0.0)
        if self.steps == 2:
            robot.drive(float("nan"), 0.1)
        self.steps += 1


class Telling(Agent):
    """Names its step, switches an LED in the first, sends how many packets it received."""

    def __init__(self) -> None:
        self.steps = 0

    def step(self, robot: Robot) -> None:
        if self.steps == 0:
            robot.led(1.0, 0.0, 0.0, index=2)
            robot.note("first", value=1.5)
        robot.drive(0.01, 0.0)
        robot.radio.send(Count(number=len(robot.radio.received(Count))), to=1)
        self.steps += 1


class Knowing(Agent):
    """Drives as far as it reads: its position, its heading."""

    needs = ("positioning", "compass")

    def step(self, robot: Robot) -> None:
        robot.note("seen" if robot.positioning.x_m == robot.positioning.x_m else "unseen")
        robot.drive(0.01 * robot.positioning.x_m, robot.compass.heading_rad)


class Doomed(Agent):
    """Drives until its fourth step, in which it comes to its end."""

    last_step: ClassVar[int] = 4

    def __init__(self) -> None:
        self.steps = 0

    def step(self, robot: Robot) -> None:
        robot.drive(0.03, 0.0)
        self.steps += 1
        if self.steps == self.last_step:
            self.end()

    def end(self) -> None:
        """Action of the last step."""
        raise RuntimeError("the fourth step")


class Failing(Doomed):
    """Raises in its third step."""

    last_step: ClassVar[int] = 3

    def end(self) -> None:
        raise RuntimeError("the third step")


class Drawing(Agent):
    """Drives as it draws."""

    def step(self, robot: Robot) -> None:
        robot.drive(0.05 * robot.draw.uniform("speed"), 0.0)


class Holding(Doomed):
    """Holds the interpreter forever in its fourth step, as native code can."""

    def end(self) -> None:
        ctypes.PyDLL(None).pause()


class Painting(Agent):
    """Sets an actuator of its user's own."""

    def step(self, robot: Robot) -> None:
        robot.actuate("arm", [1.0, 2.0, 3.0])


class Forking(Doomed):
    """Forks in its fourth step a process that keeps its files open, and dies."""

    def end(self) -> None:
        if os.fork() == 0:
            ctypes.CDLL(None).pause()
        os._exit(0)


class Scribbling(Agent):
    """Writes to what it reads."""

    needs = ("proximity",)

    def step(self, robot: Robot) -> None:
        robot.proximity.value[0] = 1.0


class Laned(VectorAgent):
    """Drives as fast as its lane says."""

    lane: PerRobot[int] = parameter(0, help="its lane")

    def step(self, robots: Robots, memory: Memory) -> None:
        robots.drive(0.01 * self.lane, 0.0)


class Ranging(Agent):
    """Drives as far as whom it hears is away."""

    needs = ("radio.range",)

    def step(self, robot: Robot) -> None:
        robot.drive(sum(packet.range_m for packet in robot.radio.received(Count)), 0.0)
