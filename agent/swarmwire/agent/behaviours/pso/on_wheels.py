"""Particles on wheels: to the target, and away from what is near."""

from typing import Generic, TypeVar

import numpy as np

from swarmwire.agent.behaviours.pso.particle import Particle
from swarmwire.agent.behaviours.pso.particle_swarm import ParticleSwarm
from swarmwire.agent.fields import along, repulsion_of_rays
from swarmwire.agent.robots import Robots

P = TypeVar("P", bound=Particle)


class ParticlesOnWheels(ParticleSwarm[P], Generic[P]):
    """A particle swarm of robots with proximity and compass, which turn to where they drive."""

    arrived_m: float = 0.05  # nearer than this to the target the robot waits
    avoidance: float = 2.0  # weight of the rays against the way to the target
    turn_gain_per_s: float = 3.0  # turn rate per angle to the wanted direction

    def head_for_target(self, robots: Robots, state: P) -> None:
        """To the target, and away from what is near."""
        bearing = np.arctan2(state.target_y, state.target_x) - robots.compass.heading_rad
        pull = np.where(np.hypot(state.target_x, state.target_y) < self.arrived_m, 0.0, 1.0)
        wanted = pull * along(bearing) + self.avoidance * repulsion_of_rays(robots.proximity)
        angle, push = wanted.angle_rad, np.minimum(wanted.length, 1.0)
        linear = self.speed_mps * push * np.maximum(np.cos(angle), 0.0)
        robots.drive(linear_mps=linear, angular_radps=self.turn_gain_per_s * push * angle)
