"""Published avoidance rules: turn on the spot, or back off and turn, while an obstacle is near.

`Avoidance` reads proximity rays; `ThresholdRule` reads a laser scan, and `ThresholdRuleProximity` proximity rays.
"""

from typing import ClassVar

import numpy as np

from swarmwire.agent.robots import Robots
from swarmwire.agent.vector_agent import Memory, VectorAgent
from swarmwire.comms.base.arrays import FloatArray


class Avoidance(VectorAgent):
    """The avoidance rule of the paper on swarm algorithms in the ARGoS simulator, by proximity alone.

    The sum of the rays' vectors (value towards angle) gives the direction of the obstacle. It is harmless if it is
    behind (further round than `behind_rad`), or if it is ahead (within `ahead_rad`) and farther than `safe_m`: then the
    robot drives straight. From any other the robot turns away: to the right of one to its left, and the other way
    round; one dead ahead counts as to the right.

    Where the paper is silent this is our reading: the obstacle's distance is that of the nearest ray; while
    no ray answers at least `detection_threshold` there is none, since noise alone has a sum too; the turn is on the
    spot, or on an arc with `turn_mps` above 0. There is no memory: between obstacles to both sides a robot may dither.
    """

    needs: ClassVar[tuple[str, ...]] = ("proximity",)
    speed_mps: float = 0.05  # straight ahead
    turn_radps: float = 1.5  # turn rate away from an obstacle
    turn_mps: float = 0.0  # forward speed while turning
    safe_m: float = 0.03  # an obstacle ahead is harmless if its nearest point is farther than this from the rim
    ahead_rad: float = 0.7854  # half width of the sector ahead (45 degrees)
    behind_rad: float = 2.618  # an obstacle is behind beyond this angle to either side (150 degrees)
    detection_threshold: float = (
        0.1  # detection threshold of a ray's answer, 0 to 1; above the noise of the bodies' rays
    )

    def step(self, robots: Robots, memory: Memory) -> None:
        """Straight, or turning."""
        proximity = robots.proximity
        x, y = proximity.vector_sum()
        angle = np.arctan2(y, x)
        nothing = np.max(proximity.value, axis=1) < self.detection_threshold
        behind = np.abs(angle) > self.behind_rad
        far_ahead = (np.abs(angle) <= self.ahead_rad) & (np.min(proximity.distance_m, axis=1) > self.safe_m)
        harmless = nothing | behind | far_ahead
        away = np.where(angle > 0.0, -self.turn_radps, self.turn_radps)
        linear = np.where(harmless, self.speed_mps, self.turn_mps)
        robots.drive(linear_mps=linear, angular_radps=np.where(harmless, 0.0, away))


class ThresholdRule(VectorAgent):
    """A threshold rule for avoidance, by a laser scan.

    Source: Quizzr, "Testing Decentralized Swarm Logic with ROS2 and ARGoS Simulators" (no author or date),
    https://quizzr.net/concepts/swarm-simulation-ros2-argos.

    While the least of all ranges is below `safe_m` the robot drives backwards at `back_mps` and turns to the left at
    `turn_radps`; otherwise it drives straight on at `speed_mps`. Ranges and speeds are the article's, and so is that
    rays behind count as much as those ahead. The rule has no memory: robots that meet on the threshold drive to and
    fro, and one next to a wall, always below it, drives in a circle of back_mps / turn_radps (0.2 m).
    """

    needs: ClassVar[tuple[str, ...]] = ("scan",)
    safe_m: float = 0.5  # least range at which the robot drives on
    speed_mps: float = 0.2  # straight ahead
    back_mps: float = 0.1  # backwards, while anything is nearer
    turn_radps: float = 0.5  # turn rate meanwhile, positive to the left

    def step(self, robots: Robots, memory: Memory) -> None:
        """On, or back and around."""
        near = self.nearest_m(robots) < self.safe_m
        robots.drive(np.where(near, -self.back_mps, self.speed_mps), np.where(near, self.turn_radps, 0.0))
        robots.note("backing off", near)
        robots.note("moving", ~near)

    def nearest_m(self, robots: Robots) -> FloatArray:
        """The least range of all rays, (n,), from the scanner; inf if none sees anything."""
        return np.min(robots.scan.range_m, axis=1)


class ThresholdRuleProximity(ThresholdRule):
    """The article's threshold rule for bodies that have proximity rays instead of a scanner.

    As ThresholdRule, with distances from the rim. The article gives none for such bodies: the defaults here are within
    the range of the rays of a foot-bot and an e-puck.
    """

    needs: ClassVar[tuple[str, ...]] = ("proximity",)
    safe_m: float = 0.04  # least distance from the rim at which the robot drives on
    speed_mps: float = 0.1  # straight ahead
    back_mps: float = 0.05  # backwards, while anything is nearer
    detection_threshold: float = (
        0.1  # detection threshold of a ray's answer, 0 to 1; above the noise of the bodies' rays
    )

    def nearest_m(self, robots: Robots) -> FloatArray:
        """The least distance of all rays with an answer, (n,), from the rim; inf if none has one."""
        proximity = robots.proximity
        return np.min(np.where(proximity.value >= self.detection_threshold, proximity.distance_m, np.inf), axis=1)
