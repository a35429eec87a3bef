"""Threshold rule by short rays around the body."""

from typing import ClassVar

import numpy as np

from swarmwire.agent.behaviours.threshold_rule import ThresholdRule
from swarmwire.agent.robots import Robots
from swarmwire.comms.arrays import FloatArray


class ThresholdRuleProximity(ThresholdRule):
    """The article's threshold rule for bodies that have proximity rays instead of a scanner.

    As ThresholdRule, with distances from the rim. What they should be for such bodies the article does not say: the
    defaults here are within the reach of a foot-bot's rays, and of an e-puck's.
    """

    needs: ClassVar[tuple[str, ...]] = ("proximity",)
    safe_m: float = 0.04  # least distance from the rim at which the robot goes on
    speed_mps: float = 0.1  # straight ahead
    back_mps: float = 0.05  # backwards, while anything is nearer
    faint: float = 0.1  # least answer of a ray, 0 to 1, to a thing; above the noise of the bodies' rays

    def nearest_m(self, robots: Robots) -> FloatArray:
        """The least distance of all rays that see something, (n,), from the rim; inf if none does."""
        proximity = robots.proximity
        return np.min(np.where(proximity.value >= self.faint, proximity.distance_m, np.inf), axis=1)
