"""Avoidance: drive straight, and turn on the spot from whatever is in the way."""

from typing import ClassVar

import numpy as np

from swarmwire.agent.robots import Robots
from swarmwire.agent.vector_agent import State, VectorAgent


class Avoidance(VectorAgent):
    """The avoidance rule of the paper on swarm algorithms in the ARGoS simulator, by proximity alone.

    The sum of the rays' vectors (value towards angle) says in which direction the obstacle is. It is harmless if it is
    behind (further round than `behind_rad`), or if it is ahead (within `ahead_rad`) and farther than `safe_m`: then the
    robot drives straight. From any other the robot turns away: to the right of one to its left, and the other way
    round; one dead ahead counts as to the right.

    Where the paper is silent this is our reading: the obstacle's distance is that of the nearest ray; while
    no ray answers at least `faint` there is none, since noise alone has a sum too; the turn is on the spot, or on an
    arc with `turn_mps` above 0. There is no memory: between obstacles to both sides a robot may dither.
    """

    needs: ClassVar[tuple[str, ...]] = ("proximity",)
    speed_mps: float = 0.05  # straight ahead
    turn_radps: float = 1.5  # turn rate away from an obstacle
    turn_mps: float = 0.0  # forward speed while turning
    safe_m: float = 0.03  # an obstacle ahead is harmless if its nearest point is farther than this from the rim
    ahead_rad: float = 0.7854  # half width of the sector ahead (45 degrees)
    behind_rad: float = 2.618  # an obstacle is behind beyond this angle to either side (150 degrees)
    faint: float = 0.1  # least answer of a ray, 0 to 1, to a thing; above the noise of the bodies' rays

    def step(self, robots: Robots, state: State) -> None:
        """Straight, or turning."""
        proximity = robots.proximity
        x, y = proximity.vector_sum()
        angle = np.arctan2(y, x)
        nothing = np.max(proximity.value, axis=1) < self.faint
        behind = np.abs(angle) > self.behind_rad
        far_ahead = (np.abs(angle) <= self.ahead_rad) & (np.min(proximity.distance_m, axis=1) > self.safe_m)
        harmless = nothing | behind | far_ahead
        away = np.where(angle > 0.0, -self.turn_radps, self.turn_radps)
        linear = np.where(harmless, self.speed_mps, self.turn_mps)
        robots.drive(linear_mps=linear, angular_radps=np.where(harmless, 0.0, away))
