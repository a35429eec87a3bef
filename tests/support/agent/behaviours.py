"""Behaviours in a world of one robot."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from swarmwire.agent.agent_group import agent_group
from swarmwire.agent.behaviours import PsoSearchPositioned
from swarmwire.agent.behaviours.pso.core import ParticleSwarm
from swarmwire.agent.behaviours.pso.variants import BestPlace
from swarmwire.agent.vector_agent import VectorAgent
from swarmwire.comms.robot.messages import Message
from swarmwire.comms.robot.packets import Payloads, ReceivedPackets
from swarmwire.comms.robot.tick_io import Actions, GroupReadings
from tests.support.agent.hosts import group

START = (1.0, -2.0)
RAYS_RAD = np.deg2rad([17.0, 50.0, 90.0, 150.0, 210.0, 270.0, 310.0, 343.0])


class OneRobot:
    """A robot of this body alone, whose tests say what it reads and receives in each step."""

    def __init__(self, kind: type[VectorAgent[Any]], body: str, period_ns: int = 10**8, **params: Any) -> None:
        self.tick, self._period_ns = 0, period_ns
        self._agents = agent_group(group("", [0], body=body, params=params), kind)

    def act(
        self,
        readings: Mapping[str, Any],
        messages: Sequence[Message] = (),
        at: Sequence[tuple[float, float]] = (),
        late_ns: int = 0,
    ) -> Actions:
        """Step with readings by sensor and field, and messages of robots 1, 2, … at ranges in m and bearings in rad."""
        k, now_ns = len(messages), self.tick * self._period_ns
        zeros, places = np.zeros(k, np.int64), np.array(at or [(0.0, 0.0)] * k, np.float64).reshape(-1, 2)
        measured = {"range_m": places[:, 0], "bearing_rad": places[:, 1]}
        payloads = Payloads.from_rows([message.encode() for message in messages])
        received = ReceivedPackets(
            zeros, np.arange(1, k + 1), zeros + self.tick, zeros + now_ns - late_ns, measured, np.arange(k), payloads
        )
        fields = {name: np.array(value, np.float64)[None] for name, value in readings.items()}
        actions = self._agents.act(
            (self.tick, now_ns, self._period_ns), GroupReadings(np.zeros(1, np.int64), fields), received
        )
        self.tick += 1
        return actions

    def command(self, *seen: Any, **more: Any) -> tuple[float, float]:
        """Forward speed and turn rate of a step, which `act` describes."""
        actions = self.act(*seen, **more)
        return float(actions.linear_mps[0]), float(actions.angular_radps[0])

    @property
    def memory(self) -> Any:
        return self._agents._memory


class SingleParticle(OneRobot):
    """A particle; each step has readings and received bests: the first from robot 1, the next from 2, …"""

    def __init__(self, kind: type[ParticleSwarm[Any]] = PsoSearchPositioned, **params: Any) -> None:
        super().__init__(kind, "epuck-gps", **params)
        self.position, self.wheels_m, self.heading_rad, self.brightness = START, [5.0, 6.0], 0.0, 0.1
        self.rays = np.zeros(8)

    def step(self, *bests: Message, range_m: float = 0.0, bearing_rad: float = 0.0) -> Actions:
        readings = {
            "proximity.value": self.rays,
            "compass.heading_rad": self.heading_rad,
            "odometry.left_m": self.wheels_m[0],
            "odometry.right_m": self.wheels_m[1],
            "light.value": np.full(8, self.brightness / 8.0),
            "positioning.x_m": self.position[0],
            "positioning.y_m": self.position[1],
        }
        return self.act(readings, bests, [(range_m, bearing_rad)] * len(bests))

    def steps(self, count: int) -> list[Actions]:
        return [self.step() for _ in range(count)]

    def vector(self, name: str) -> tuple[float, float]:
        return float(getattr(self.memory, f"{name}_x")[0]), float(getattr(self.memory, f"{name}_y")[0])


def best_at(brightness: float, x_m: float, y_m: float) -> BestPlace:
    return BestPlace(brightness=brightness, x_m=x_m, y_m=y_m)


class Walker:
    """An e-puck at 10 Hz; `n` of them differ in their draws alone."""

    def __init__(self, kind: type[VectorAgent[Any]], word: type[Message] | None = None, n: int = 1, **params: Any):
        self._agents = agent_group(group("", list(range(n)), body="epuck", params=params), kind)
        self._word, self._n, self._tick = word, n, 0

    @property
    def memory(self) -> Any:
        return self._agents._memory

    def step(self, *neighbours: tuple[float, float], near_rad: float | None = None) -> Actions:
        """Neighbours, as range in m and bearing in rad, are received by all.

        A thing is near in direction `near_rad`.
        """
        k, n = len(neighbours), self._n
        table = np.tile(np.array(neighbours, np.float64).reshape(-1, 2), (n, 1))
        zeros, receiver = np.zeros(n * k, np.int64), np.repeat(np.arange(n), k)
        measured = {"range_m": table[:, 0], "bearing_rad": table[:, 1]}
        payloads = Payloads.from_rows([self._word().encode()] * (n * k) if self._word else [])
        received = ReceivedPackets(receiver, zeros + n, zeros, zeros, measured, np.arange(n * k), payloads)
        value = np.zeros((n, 8))
        if near_rad is not None:
            value[:] = np.maximum(np.cos(RAYS_RAD - near_rad), 0.0) ** 4
        time = (self._tick, self._tick * 10**8, 10**8)
        self._tick += 1
        return self._agents.act(time, GroupReadings(np.arange(n), {"proximity.value": value}), received)

    def first_turns_rad(self, *neighbours: tuple[float, float], near_rad: float | None = None) -> np.ndarray:
        """Turn of each robot on the spot before it first drives straight, (n,), positive to the left."""
        turned, turning = np.zeros(self._n), np.ones(self._n, np.bool_)
        for step in range(60):
            actions = self.step(*(neighbours if step == 0 else ()), near_rad=near_rad if step == 0 else None)
            turning &= actions.linear_mps == 0.0
            turned += np.where(turning, 0.1 * actions.angular_radps, 0.0)
        return turned
