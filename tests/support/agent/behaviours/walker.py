"""One e-puck that walks: every step says what it sees and hears."""

from typing import Any

import numpy as np

from swarmwire.agent.host import agent_group
from swarmwire.agent.vector_agent import VectorAgent
from swarmwire.comms.messages import Message
from swarmwire.comms.packets import Payloads, ReceivedPackets
from swarmwire.comms.tick_io import Actions, GroupReadings
from tests.support.agent.hosts import group

RAYS_RAD = np.deg2rad([17.0, 50.0, 90.0, 150.0, 210.0, 270.0, 310.0, 343.0])


class Walker:
    """An e-puck at 10 Hz; `n` of them differ in their draws alone."""

    def __init__(self, kind: type[VectorAgent[Any]], word: type[Message] | None = None, n: int = 1, **params: Any):
        self._host = agent_group(group("", list(range(n)), body="epuck", params=params), kind)
        self._word, self._n, self._tick = word, n, 0

    @property
    def memory(self) -> Any:
        return self._host._state

    def step(self, *neighbours: tuple[float, float], near_rad: float | None = None) -> Actions:
        """Neighbours, as range in m and bearing in rad, are received by all.

        A thing is near in direction `near_rad`.
        """
        k, n = len(neighbours), self._n
        table = np.tile(np.array(neighbours, np.float64).reshape(-1, 2), (n, 1))
        zeros, receiver = np.zeros(n * k, np.int64), np.repeat(np.arange(n), k)
        given = {"range_m": table[:, 0], "bearing_rad": table[:, 1]}
        payloads = Payloads.of([self._word().encode()] * (n * k) if self._word else [])
        received = ReceivedPackets(receiver, zeros + n, zeros, zeros, given, np.arange(n * k), payloads)
        value = np.zeros((n, 8))
        if near_rad is not None:
            value[:] = np.maximum(np.cos(RAYS_RAD - near_rad), 0.0) ** 4
        time = (self._tick, self._tick * 10**8, 10**8)
        self._tick += 1
        return self._host.act(time, GroupReadings(np.arange(n), {"proximity.value": value}), received)

    def first_turns_rad(self, *neighbours: tuple[float, float], near_rad: float | None = None) -> np.ndarray:
        """How far each turns on the spot before it first goes straight, (n,), positive to the left."""
        turned, turning = np.zeros(self._n), np.ones(self._n, np.bool_)
        for step in range(60):
            actions = self.step(*(neighbours if step == 0 else ()), near_rad=near_rad if step == 0 else None)
            turning &= actions.linear_mps == 0.0
            turned += np.where(turning, 0.1 * actions.angular_radps, 0.0)
        return turned
