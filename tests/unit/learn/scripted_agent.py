"""A rule on the observations of policies, as a function and as an agent that runs it without an environment."""

from typing import ClassVar

import numpy as np

from swarmwire.agent.policy_io import Float32Array, PolicyLayout
from swarmwire.agent.robots import Robots
from swarmwire.agent.vector_agent import Memory, VectorAgent
from tests.support.agent.policies import FLOCKING


def rule(observation: Float32Array) -> Float32Array:
    """Some action (…, 4) that depends on all numbers of an observation (…, numbers)."""
    weights = np.sin(np.arange(4 * observation.shape[-1], dtype=np.float32)).reshape(observation.shape[-1], 4)
    return np.tanh((observation[..., None] * weights).sum(axis=-2))


class Scripted(VectorAgent):
    """The rule."""

    needs: ClassVar[tuple[str, ...]] = FLOCKING.needs

    def step(self, robots: Robots, memory: Memory) -> None:
        """Observe and act as an environment does."""
        layout = PolicyLayout(FLOCKING, robots.body)
        layout.act(robots, rule(layout.observe(robots)))
