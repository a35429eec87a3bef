"""Agents whose step is one function."""

from collections.abc import Callable
from typing import Any

from swarmwire.agent import Agent, Memory, Robot, Robots, VectorAgent


def agent_doing(deed: Callable[[Robot], object], *declared: str) -> type[Agent]:
    class Doing(Agent):
        needs = declared

        def step(self, robot: Robot) -> None:
            deed(robot)

    return Doing


def vector_agent_doing(deed: Callable[[Robots], object], *declared: str) -> type[Any]:
    class Doing(VectorAgent):
        needs = declared

        def step(self, robots: Robots, memory: Memory) -> None:
            deed(robots)

    return Doing
