"""Agents that only benchmarks need."""

from typing import ClassVar

import numpy as np

from swarmwire.agent import Agent, Message, Robot, Robots, State, VectorAgent, f8, u1
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


class ScanDiffusion(VectorAgent):
    """Straight on until the laser scan sees something ahead, then turn on the spot, away from the nearer side."""

    needs: ClassVar[tuple[str, ...]] = ("scan",)
    speed_mps: float = 0.05
    turn_radps: float = 0.5
    clear_m: float = 0.3  # from the scanner

    def step(self, robots: Robots, state: State) -> None:
        """Straight, or turn."""
        ahead = np.abs(robots.scan.angle_rad) < 0.5
        left = robots.scan.angle_rad[ahead] > 0.0
        range_m = robots.scan.range_m[:, ahead]
        left_m, right_m = np.min(range_m[:, left], axis=1), np.min(range_m[:, ~left], axis=1)
        blocked = np.minimum(left_m, right_m) < self.clear_m
        turn_radps = np.where(left_m < right_m, -self.turn_radps, self.turn_radps)
        robots.drive(np.where(blocked, 0.0, self.speed_mps), np.where(blocked, turn_radps, 0.0))


class Word(Message):
    """News that is passed on `hops` times more."""

    hops: u1


class Relay(VectorAgent):
    """Drives in circles, and tells news in one step of ten; whoever hears some passes it on at once, if it may."""

    turn_radps: float = 0.5
    hops: int = 1

    def step(self, robots: Robots, state: State) -> None:
        """Drive, pass on what waited, and now and then tell something."""
        self.hear(robots, state)
        robots.drive(0.05, self.turn_radps)
        robots.radio.send(Word, rows=robots.draw.uniform("news") < 0.1, hops=self.hops)

    def hear(self, robots: Robots, state: State) -> None:
        """Pass on the newest of what each robot heard, if it has hops left."""
        heard = robots.radio.heard(Word)
        hops = np.zeros(robots.n, np.int64)
        hops[heard.row] = heard.message.hops
        robots.radio.send(Word, rows=hops > 0, hops=hops - 1)


class Listener(Agent):
    """One robot that does nothing of its own: it reads its rays and every packet, and drives."""

    needs: ClassVar[tuple[str, ...]] = ("proximity", "radio.range")

    def step(self, robot: Robot) -> None:
        """Read, and drive."""
        near = robot.proximity.value
        for packet in robot.radio.heard(Ping):
            _ = packet.message.number, packet.range_m
        robot.drive(float(near[0]), 0.0)
