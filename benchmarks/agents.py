"""Agents that only benchmarks need."""

from typing import ClassVar

from swarmwire.agent import Agent, Message, Robot, Robots, State, f8
from swarmwire.agent.behaviours import Diffusion


class Ping(Message):
    """Ten bytes on air, as in the range-and-bearing broadcast of the peer's benchmark: a tag and a number."""

    number: f8


class TalkingDiffusion(Diffusion):
    """ARGoS's diffusion rule by a robot that also broadcasts ten bytes in every step, and reads what it hears."""

    needs: ClassVar[tuple[str, ...]] = ("proximity",)

    def step(self, robots: Robots, state: State) -> None:
        """Move, read, broadcast."""
        super().step(robots, state)
        heard = robots.radio.heard(Ping)
        robots.radio.send(Ping, number=heard.sum(heard.message.number * 0.5))


class Listener(Agent):
    """One robot that does nothing of its own: it reads its rays and every packet, and drives."""

    needs: ClassVar[tuple[str, ...]] = ("proximity", "radio.range")

    def step(self, robot: Robot) -> None:
        """Read, and drive."""
        near = robot.proximity.value
        for packet in robot.radio.heard(Ping):
            _ = packet.message.number, packet.range_m
        robot.drive(float(near[0]), 0.0)
