"""Threshold rule: back off and turn while anything is too near, else straight on."""

from typing import ClassVar

import numpy as np

from swarmwire.agent.robots import Robots
from swarmwire.agent.vector_agent import State, VectorAgent
from swarmwire.comms.arrays import FloatArray


class ThresholdRule(VectorAgent):
    """The avoidance rule of the article on testing swarm logic with ROS 2 and ARGoS, by a laser scan.

    While the least of all ranges is below `safe_m` the robot drives backwards at `back_mps` and turns to the left at
    `turn_radps`; else it drives straight on at `speed_mps`. Ranges and speeds are the article's, and so is that the
    rays behind count as those ahead. It has no memory: robots that hold one another on the threshold go to and fro,
    and one that a wall keeps below it drives in a circle of back_mps / turn_radps (0.2 m).
    """

    needs: ClassVar[tuple[str, ...]] = ("scan",)
    safe_m: float = 0.5  # least range at which the robot goes on
    speed_mps: float = 0.2  # straight ahead
    back_mps: float = 0.1  # backwards, while anything is nearer
    turn_radps: float = 0.5  # turn rate meanwhile, positive to the left

    def step(self, robots: Robots, state: State) -> None:
        """On, or back and around."""
        near = self.nearest_m(robots) < self.safe_m
        robots.drive(np.where(near, -self.back_mps, self.speed_mps), np.where(near, self.turn_radps, 0.0))
        robots.note("backing off", near)
        robots.note("going on", ~near)

    def nearest_m(self, robots: Robots) -> FloatArray:
        """The least range of all rays, (n,), from the scanner; inf if none sees anything."""
        return np.min(robots.scan.range_m, axis=1)
