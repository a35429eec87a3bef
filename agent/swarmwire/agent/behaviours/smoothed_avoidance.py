"""Smoothed avoidance: a potential field with low-pass and hysteresis, instead of the threshold rule."""

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from swarmwire.agent.behaviours._common import check_order
from swarmwire.agent.fields import Vectors, ahead, hysteresis, low_pass, repulsion_of_ranges, repulsion_of_rays, steered
from swarmwire.agent.robots import Robots
from swarmwire.agent.vector_agent import BoolColumn, FloatColumn, Memory, VectorAgent, column
from swarmwire.comms.base.config import parameter


class Smoothed(Memory):
    """The last command, and the side to which a blocked robot turns."""

    linear_mps: FloatColumn = column(0.0)
    angular_radps: FloatColumn = column(0.0)
    blocked: BoolColumn = column(False)
    side: FloatColumn = column(1.0)  # 1 left, -1 right


class SmoothedAvoidance(VectorAgent[Smoothed]):
    """Smooth avoidance of near objects by a laser scan: the improvement that the article of `ThresholdRule` suggests.

    The sum of a vector ahead, of length 1, and `strength` times the repulsion of objects nearer than `reach_m` (see
    `swarmwire.agent.fields`) has an angle a: the robot drives at the speed `speed_mps` max(cos a, 0), and turns at the
    rate `turn_gain_per_s` a. Two filters prevent flicker:

    - hysteresis: from an angle of `blocked_rad` on, the robot turns to one side, until the angle has fallen to
      `free_rad`, even if noise or a moving neighbour changes the sign meanwhile;
    - a low-pass of speed and turn rate with the time constant `smooth_s`.

    The article has neither formula nor numbers: speed and reach are those of its threshold rule, all else is our
    choice. The robot never drives backwards.
    """

    needs: ClassVar[tuple[str, ...]] = ("scan",)
    reach_m: float = parameter(0.5, help="distance from which on objects do not repel", above=0.0)
    strength: float = parameter(40.0, help="weight of the repulsion, relative to the vector ahead")
    speed_mps: float = parameter(0.2, help="straight ahead")
    turn_gain_per_s: float = parameter(1.5, help="turn rate per angle of the sum")
    blocked_rad: float = parameter(1.5708, help="angle of the sum at which the robot commits to one side (90 degrees)")
    free_rad: float = parameter(0.7854, help="angle of the sum at which the commitment ends (45 degrees)")
    smooth_s: float = parameter(0.3, help="time constant of the commands' low-pass", at_least=0.0)

    @classmethod
    def check_parameters(cls, params: Mapping[str, Any], robots: int) -> None:
        """Refuse a hysteresis in the wrong order."""
        check_order(cls, params, "free_rad", "blocked_rad")

    def step(self, robots: Robots, memory: Smoothed) -> None:
        """Steer along the sum of the fields, with filtered commands."""
        field = ahead(robots.n) + self.strength * self.repulsion(robots)
        field = self._with_side(field, memory)
        linear, angular = steered(field, self.speed_mps, self.turn_gain_per_s)
        memory.linear_mps = low_pass(memory.linear_mps, linear, robots.period_s, self.smooth_s)
        memory.angular_radps = low_pass(memory.angular_radps, angular, robots.period_s, self.smooth_s)
        robots.drive(memory.linear_mps, memory.angular_radps)
        robots.note("turning away", memory.blocked)
        robots.note("moving", ~memory.blocked)

    def repulsion(self, robots: Robots) -> Vectors:
        """Return the repulsion of near objects, (n,)."""
        scan = robots.scan
        return repulsion_of_ranges(scan.range_m, scan.angle_rad, self.reach_m)

    def _with_side(self, field: Vectors, memory: Smoothed) -> Vectors:
        """Return the field, mirrored to the side of the turn if the robot is blocked."""
        side = np.where(field.y < 0.0, -1.0, 1.0)
        memory.side = np.where(memory.blocked, memory.side, side)
        memory.blocked = hysteresis(memory.blocked, np.abs(field.angle_rad), self.blocked_rad, self.free_rad)
        return Vectors(field.x, np.where(memory.blocked, memory.side * np.abs(field.y), field.y))


class SmoothedAvoidanceProximity(SmoothedAvoidance):
    """Smoothed avoidance for bodies that have proximity rays instead of a scanner.

    The repulsion is the sum of the rays' vectors, each as long as its answer; their reach is the body's.
    """

    needs: ClassVar[tuple[str, ...]] = ("proximity",)
    strength: float = parameter(2.0, help="weight of the repulsion, relative to the vector ahead")
    speed_mps: float = parameter(0.1, help="straight ahead")
    turn_gain_per_s: float = parameter(3.0, help="turn rate per angle of the sum")
    smooth_s: float = parameter(0.1, help="time constant of the commands' low-pass", at_least=0.0)

    def repulsion(self, robots: Robots) -> Vectors:
        """Return the repulsion of near objects, (n,)."""
        return repulsion_of_rays(robots.proximity)
