"""Agents that only benchmarks need."""

import math
import time
from typing import ClassVar

import numpy as np

from swarmwire.agent import Agent, Memory, Message, Robot, Robots, VectorAgent, f4, f8, u1
from swarmwire.agent.behaviours import Diffusion


class Ping(Message):
    """Ten bytes on air, as in the range-and-bearing broadcast of the peer's benchmark: a tag and a number."""

    number: f8


class TalkingDiffusion(Diffusion):
    """ARGoS's diffusion rule by a robot that also broadcasts ten bytes in every step, and reads what it hears."""

    needs: ClassVar[tuple[str, ...]] = ("proximity",)

    def step(self, robots: Robots, memory: Memory) -> None:
        """Move, read, broadcast."""
        super().step(robots, memory)
        received = robots.radio.received(Ping)
        robots.radio.send(Ping, number=received.sum(received.message.number * 0.5))


class ScanDiffusion(VectorAgent):
    """Straight on until the laser scan sees something ahead, then turn on the spot, away from the nearer side."""

    needs: ClassVar[tuple[str, ...]] = ("scan",)
    speed_mps: float = 0.05
    turn_radps: float = 0.5
    clear_m: float = 0.3  # from the scanner

    def step(self, robots: Robots, memory: Memory) -> None:
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
    """Drives in circles, and sends news in one step of ten; receivers pass it on at once, if they may."""

    turn_radps: float = 0.5
    hops: int = 1

    def step(self, robots: Robots, memory: Memory) -> None:
        """Drive, pass on what waited, and now and then send news."""
        self.on_receive(robots, memory)
        robots.drive(0.05, self.turn_radps)
        robots.radio.send(Word, rows=robots.draw.uniform("news") < 0.1, hops=self.hops)

    def on_receive(self, robots: Robots, memory: Memory) -> None:
        """Pass on the newest of what each robot received, if it has hops left."""
        received = robots.radio.received(Word)
        hops = np.zeros(robots.n, np.int64)
        hops[received.row] = received.message.hops
        robots.radio.send(Word, rows=hops > 0, hops=hops - 1)


class Listener(Agent):
    """One robot that does nothing of its own: it reads its rays and every packet, and drives."""

    needs: ClassVar[tuple[str, ...]] = ("proximity", "radio.range")

    def step(self, robot: Robot) -> None:
        """Read, and drive."""
        near = robot.proximity.value
        for packet in robot.radio.received(Ping):
            _ = packet.message.number, packet.range_m
        robot.drive(float(near[0]), 0.0)


class Beacon(Message):
    """What a boid broadcasts in every step."""

    heading_rad: f4


class Boid(Agent):
    """One robot that flocks by Reynolds's rules, in plain Python: attraction, repulsion, alignment, rays."""

    needs: ClassVar[tuple[str, ...]] = ("proximity", "compass", "radio.range", "radio.bearing")
    speed_mps: float = 0.1
    separation_m: float = 0.4

    def step(self, robot: Robot) -> None:
        """Steer to the sum of all pulls, and broadcast the heading."""
        heading, received = robot.compass.heading_rad, robot.radio.received(Beacon)
        x = y = 0.0
        for packet in received:
            bearing, turn = packet.bearing_rad, packet.message.heading_rad - heading
            pull = 0.6 * min((packet.range_m - self.separation_m) / self.separation_m, 1.0)
            x += pull * math.cos(bearing) + math.cos(turn)
            y += pull * math.sin(bearing) + math.sin(turn)
        near_x, near_y = robot.proximity.vector_sum()
        x, y = 0.3 + x / max(len(received), 1) - 3.0 * near_x, y / max(len(received), 1) - 3.0 * near_y
        angle = math.atan2(y, x)
        robot.drive(self.speed_mps * max(math.cos(angle), 0.0), 2.0 * angle)
        robot.radio.send(Beacon(heading_rad=heading))


class TimedBoid(Boid):
    """A boid that reports how much processor time each of its steps took."""

    def step(self, robot: Robot) -> None:
        """Step, and report."""
        start_ns = time.thread_time_ns()
        super().step(robot)
        robot.note(value=(time.thread_time_ns() - start_ns) * 1e-9)
