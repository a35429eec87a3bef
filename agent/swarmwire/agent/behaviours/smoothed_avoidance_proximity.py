"""Smoothed avoidance by short rays around the body."""

from typing import ClassVar

from swarmwire.agent.behaviours.smoothed_avoidance import SmoothedAvoidance
from swarmwire.agent.fields import Vectors, repulsion_of_rays
from swarmwire.agent.robots import Robots


class SmoothedAvoidanceProximity(SmoothedAvoidance):
    """Smoothed avoidance for bodies that have proximity rays instead of a scanner.

    As SmoothedAvoidance, but that the repulsion is the sum of the rays, each as long as its answer; how far they reach
    is the body's.
    """

    needs: ClassVar[tuple[str, ...]] = ("proximity",)
    strength: float = 2.0  # weight of the repulsion against the way ahead
    speed_mps: float = 0.1  # straight ahead
    turn_gain_per_s: float = 3.0  # turn rate per angle to the wanted direction
    smooth_s: float = 0.1  # time constant of the commands' low-pass

    def repulsion(self, robots: Robots) -> Vectors:
        """Away from what is near, (n,)."""
        return repulsion_of_rays(robots.proximity)
