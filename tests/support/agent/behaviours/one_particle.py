"""One particle on one e-puck with positioning that stands where a test puts it, and hears what a test says."""

from typing import Any

import numpy as np

from swarmwire.agent.behaviours import PsoSearchPositioned
from swarmwire.agent.behaviours.pso.core import Particle, ParticleSwarm
from swarmwire.agent.behaviours.pso.variants import BestPlace
from swarmwire.agent.host import agent_group
from swarmwire.comms.messages import Message
from swarmwire.comms.packets import Payloads, ReceivedPackets
from swarmwire.comms.tick_io import Actions, GroupReadings
from tests.support.agent.hosts import group

HERE = (1.0, -2.0)


class One:
    """One particle; every step says what it senses and hears: the first best from robot 1, the next from 2, …"""

    def __init__(self, kind: type[ParticleSwarm[Any]] = PsoSearchPositioned, **params: Any) -> None:
        self.tick, self.place = 0, HERE
        self.wheels_m, self.heading_rad, self.brightness = [5.0, 6.0], 0.0, 0.1
        self.rays = np.zeros(8)
        self._host = agent_group(group("", [0], body="epuck-gps", params=dict(params)), kind)

    def step(self, *bests: Message, range_m: float = 0.0, bearing_rad: float = 0.0) -> Actions:
        k = len(bests)
        zeros = np.zeros(k, np.int64)
        given = {"range_m": np.full(k, range_m), "bearing_rad": np.full(k, bearing_rad)}
        payloads = Payloads.of([best.encode() for best in bests])
        received = ReceivedPackets(zeros, np.arange(1, k + 1), zeros, zeros, given, np.arange(k), payloads)
        fields = {
            "proximity.value": self.rays[None, :],
            "compass.heading_rad": np.array([self.heading_rad]),
            "odometry.left_m": np.array([self.wheels_m[0]]),
            "odometry.right_m": np.array([self.wheels_m[1]]),
            "light.value": np.full((1, 8), self.brightness / 8.0),
            "positioning.x_m": np.array([self.place[0]]),
            "positioning.y_m": np.array([self.place[1]]),
        }
        actions = self._host.act(
            (self.tick, self.tick * 10**8, 10**8), GroupReadings(np.zeros(1, np.int64), fields), received
        )
        self.tick += 1
        return actions

    def steps(self, count: int) -> list[Actions]:
        return [self.step() for _ in range(count)]

    @property
    def memory(self) -> Particle:
        return self._host._state

    def vector(self, name: str) -> tuple[float, float]:
        return float(getattr(self.memory, f"{name}_x")[0]), float(getattr(self.memory, f"{name}_y")[0])


def place(brightness: float, x_m: float, y_m: float) -> BestPlace:
    return BestPlace(brightness=brightness, x_m=x_m, y_m=y_m)
