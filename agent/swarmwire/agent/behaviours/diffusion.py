"""Diffusion: drive straight until something is near, then turn away on one wheel."""

from typing import ClassVar

import numpy as np

from swarmwire.agent.robots import Robots
from swarmwire.agent.vector_agent import State, VectorAgent


class Diffusion(VectorAgent):
    """ARGoS's diffusion rule (argos3-examples, footbot_diffusion.cpp), by proximity alone.

    The mean of the rays' vectors (value towards angle) says where things are. While it is short and points into the
    go-straight sector the robot drives straight; otherwise one wheel stops, so that it turns away.
    """

    needs: ClassVar[tuple[str, ...]] = ("proximity",)
    speed_mps: float = 0.05  # of a driven wheel
    go_straight_rad: float = 0.1309  # half width of the sector ahead in which a weak reading is ignored (7.5 degrees)
    nearness: float = 0.1  # length of the mean vector above which the way ahead counts as blocked, 0 to 1

    def step(self, robots: Robots, state: State) -> None:
        """Straight, or one wheel."""
        proximity = robots.proximity
        rays = len(proximity.angle_rad)
        x, y = proximity.vector_sum()
        angle = np.arctan2(y, x)
        straight = (np.abs(angle) <= self.go_straight_rad) & (np.hypot(x, y) < self.nearness * rays)
        turn = self.speed_mps / robots.body.wheels.wheel_base_m
        linear = np.where(straight, self.speed_mps, 0.5 * self.speed_mps)
        angular = np.where(straight, 0.0, np.where(angle > 0.0, -turn, turn))
        robots.drive(linear_mps=linear, angular_radps=angular)
