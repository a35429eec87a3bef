"""Smoothed avoidance: a potential field with low-pass and hysteresis, in place of the threshold rule."""

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from swarmwire.agent.behaviours._common import check_above_zero, check_not_negative, check_order
from swarmwire.agent.fields import Vectors, ahead, hysteresis, low_pass, repulsion_of_ranges, repulsion_of_rays, steered
from swarmwire.agent.robots import Robots
from swarmwire.agent.vector_agent import BoolColumn, FloatColumn, Memory, VectorAgent, column


class Smoothed(Memory):
    """The last command, and to which side the robot is turning from what blocks its way."""

    linear_mps: FloatColumn = column(0.0)
    angular_radps: FloatColumn = column(0.0)
    blocked: BoolColumn = column(False)
    side: FloatColumn = column(1.0)  # 1 left, -1 right


class SmoothedAvoidance(VectorAgent[Smoothed]):
    """Smooth avoidance of near objects by a laser scan: the article's suggested improvement of its threshold rule.

    The way ahead, of length 1, and `strength` times the repulsion of objects nearer than `reach_m` (see
    `swarmwire.agent.fields`) add up to where the robot wants to go, at an angle a: it drives at `speed_mps` cos a, 0 if
    that is negative, and turns at `turn_gain_per_s` a. Two things keep that from flickering:

    - hysteresis: once a has grown to `blocked_rad` the robot keeps turning to the side to which it turns then, until
      a has fallen to `free_rad`, wherever noise or a moving neighbour puts it meanwhile;
    - a low-pass of speed and turn rate with the time constant `smooth_s`.

    The article gives neither formula nor numbers; the speed and the reach are those of its threshold rule, the rest is
    our choice. It never drives backwards.
    """

    needs: ClassVar[tuple[str, ...]] = ("scan",)
    reach_m: float = 0.5  # farther objects do not push
    strength: float = 40.0  # weight of the repulsion against the way ahead
    speed_mps: float = 0.2  # straight ahead
    turn_gain_per_s: float = 1.5  # turn rate per angle to the wanted direction
    blocked_rad: float = 1.5708  # from this angle of the field's sum on, the side is kept (90 degrees)
    free_rad: float = 0.7854  # until it has fallen to this (45 degrees)
    smooth_s: float = 0.3  # time constant of the commands' low-pass

    @classmethod
    def check_parameters(cls, params: Mapping[str, Any], robots: int) -> None:
        """What is divided by is above 0, and hysteresis has a gap."""
        check_above_zero(params, "reach_m")
        check_not_negative(params, "smooth_s")
        check_order(cls, params, "free_rad", "blocked_rad")

    def step(self, robots: Robots, memory: Smoothed) -> None:
        """Along the sum of the fields, by a command that changes gently."""
        wanted = ahead(robots.n) + self.strength * self.repulsion(robots)
        wanted = self._keep_side(wanted, memory)
        linear, angular = steered(wanted, self.speed_mps, self.turn_gain_per_s)
        memory.linear_mps = low_pass(memory.linear_mps, linear, robots.period_s, self.smooth_s)
        memory.angular_radps = low_pass(memory.angular_radps, angular, robots.period_s, self.smooth_s)
        robots.drive(memory.linear_mps, memory.angular_radps)
        robots.note("turning away", memory.blocked)
        robots.note("moving", ~memory.blocked)

    def repulsion(self, robots: Robots) -> Vectors:
        """Away from near objects, (n,)."""
        scan = robots.scan
        return repulsion_of_ranges(scan.range_m, scan.angle_rad, self.reach_m)

    def _keep_side(self, wanted: Vectors, memory: Smoothed) -> Vectors:
        """The wanted vector, mirrored to the side to which a blocked robot already turns."""
        side = np.where(wanted.y < 0.0, -1.0, 1.0)
        memory.side = np.where(memory.blocked, memory.side, side)
        memory.blocked = hysteresis(memory.blocked, np.abs(wanted.angle_rad), self.blocked_rad, self.free_rad)
        return Vectors(wanted.x, np.where(memory.blocked, memory.side * np.abs(wanted.y), wanted.y))


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
        """Away from near objects, (n,)."""
        return repulsion_of_rays(robots.proximity)
