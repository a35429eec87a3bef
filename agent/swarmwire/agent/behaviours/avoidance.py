"""Published avoidance rules: turn on the spot, or back off and turn, while an obstacle is near.

`Avoidance` reads proximity rays; `ThresholdRule` reads a laser scan, and `ThresholdRuleProximity` proximity rays.
"""

from typing import ClassVar

import numpy as np

from swarmwire.agent import portable
from swarmwire.agent.robots import Robots
from swarmwire.agent.vector_agent import Memory, VectorAgent
from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.config import parameter


class Avoidance(VectorAgent):
    """The avoidance rule of the paper on swarm algorithms in the ARGoS simulator, by proximity rays.

    The sum of the rays' vectors (value towards angle) is the direction of the obstacle. The robot drives straight if
    the obstacle is behind (beyond `behind_rad`), or ahead (within `ahead_rad`) and farther than `safe_m`. Otherwise the
    robot turns away: to the right of an obstacle to its left, to the left of any other.

    Details that the paper leaves open are our choice: the distance of the obstacle is that of the nearest ray; below
    `detection_threshold` of all rays there is no obstacle, because noise has a sum, too; the turn is on the spot, or on
    an arc with `turn_mps` above 0. Without a memory, a robot may dither between obstacles on both sides.
    """

    needs: ClassVar[tuple[str, ...]] = ("proximity",)
    speed_mps: float = parameter(0.05, help="straight ahead")
    turn_radps: float = parameter(1.5, help="turn rate away from an obstacle")
    turn_mps: float = parameter(0.0, help="forward speed while turning")
    safe_m: float = parameter(0.03, help="distance from the rim beyond which an obstacle ahead is harmless")
    ahead_rad: float = parameter(0.7854, help="half width of the sector ahead (45 degrees)")
    behind_rad: float = parameter(2.618, help="angle to either side beyond which an obstacle is behind (150 degrees)")
    detection_threshold: float = parameter(
        0.1, help="least answer of a ray, 0 to 1, that is an obstacle; above the rays' noise"
    )

    def step(self, robots: Robots, memory: Memory) -> None:
        """Drive straight, or turn away."""
        proximity = robots.proximity
        x, y = proximity.vector_sum()
        angle = portable.atan2(y, x)
        undetected = np.max(proximity.value, axis=1) < self.detection_threshold
        behind = np.abs(angle) > self.behind_rad
        far_ahead = (np.abs(angle) <= self.ahead_rad) & (np.min(proximity.distance_m, axis=1) > self.safe_m)
        harmless = undetected | behind | far_ahead
        turn_away = np.where(angle > 0.0, -self.turn_radps, self.turn_radps)
        linear = np.where(harmless, self.speed_mps, self.turn_mps)
        robots.drive(linear_mps=linear, angular_radps=np.where(harmless, 0.0, turn_away))


class ThresholdRule(VectorAgent):
    """A threshold rule for avoidance, by a laser scan.

    Source: Quizzr, "Testing Decentralized Swarm Logic with ROS2 and ARGoS Simulators" (no author or date),
    https://quizzr.net/concepts/swarm-simulation-ros2-argos.

    While the least of all ranges is below `safe_m`, the robot drives backwards at `back_mps` and turns to the left at
    `turn_radps`; otherwise it drives straight at `speed_mps`. Range and speeds are the article's, and so is the equal
    weight of rays behind and ahead. Without a memory, robots that meet at the threshold drive to and fro, and a robot
    next to a wall drives in a circle of radius back_mps / turn_radps (0.2 m).
    """

    needs: ClassVar[tuple[str, ...]] = ("scan",)
    safe_m: float = parameter(0.5, help="least range at which the robot drives ahead")
    speed_mps: float = parameter(0.2, help="straight ahead")
    back_mps: float = parameter(0.1, help="speed backwards, while an object is nearer")
    turn_radps: float = parameter(0.5, help="turn rate while backing off, positive to the left")

    def step(self, robots: Robots, memory: Memory) -> None:
        """Drive straight, or back off and turn."""
        near = self.nearest_m(robots) < self.safe_m
        robots.drive(np.where(near, -self.back_mps, self.speed_mps), np.where(near, self.turn_radps, 0.0))
        robots.note("backing off", near)
        robots.note("moving", ~near)

    def nearest_m(self, robots: Robots) -> FloatArray:
        """Return the least range of all rays, (n,), from the scanner; inf without an object in reach."""
        return np.min(robots.scan.range_m, axis=1)


class ThresholdRuleProximity(ThresholdRule):
    """The article's threshold rule for bodies that have proximity rays instead of a scanner.

    Distances are from the rim. The article has no numbers for such bodies: the defaults are within the range of the
    rays of a foot-bot and an e-puck.
    """

    needs: ClassVar[tuple[str, ...]] = ("proximity",)
    safe_m: float = parameter(0.04, help="least distance from the rim at which the robot drives ahead")
    speed_mps: float = parameter(0.1, help="straight ahead")
    back_mps: float = parameter(0.05, help="speed backwards, while an object is nearer")
    detection_threshold: float = parameter(
        0.1, help="least answer of a ray, 0 to 1, that is an obstacle; above the rays' noise"
    )

    def nearest_m(self, robots: Robots) -> FloatArray:
        """Return the least distance of all rays with an answer, (n,), from the rim; inf without an answer."""
        proximity = robots.proximity
        return np.min(np.where(proximity.value >= self.detection_threshold, proximity.distance_m, np.inf), axis=1)
