"""Minimalist flocking: four sectors, four thresholds, no radio, and no memory but the side of the current turn.

`Sectors` sorts the rays around a body into four sectors of 90 degrees, and into the halves of the body.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from swarmwire.agent.behaviours._common import check_not_negative, check_share
from swarmwire.agent.robots import Robots
from swarmwire.agent.vector_agent import IntColumn, Memory, VectorAgent, column
from swarmwire.comms.base.arrays import BoolArray, FloatArray, IntArray
from swarmwire.comms.robot.sensors.rays import InfraredReading, ProximityReading, RayArraySpec

LEFT, STRAIGHT, RIGHT = 1, 0, -1
EITHER = 2  # a side that is still to be drawn
FRONT_RAD, REAR_RAD = 0.25 * np.pi, 0.75 * np.pi  # half width of the front; where the rear begins, to either side
AXIS = 1e-9  # sine of an angle: nearer to the axis a ray is in neither half


@dataclass(frozen=True)
class Sectors:
    """The rays of n robots by sector, each with its border towards the left.

    Answers are compared, not distances: a nearer object gives a greater answer, and needs no conversion.

    Attributes:
        answer: (rays, n) 0 for nothing, 1 for touching. With a row per ray, the maximum over few rays of many robots is
            many times faster, and as exact.
        front, left, rear, right: (rays,) which rays look there.
        left_half, right_half: (rays,) which look to either side of the body's axis.
    """

    answer: FloatArray
    front: BoolArray
    left: BoolArray
    rear: BoolArray
    right: BoolArray
    left_half: BoolArray
    right_half: BoolArray

    @classmethod
    def of(cls, reading: ProximityReading[FloatArray] | InfraredReading[FloatArray]) -> "Sectors":
        """The sectors of the rays of a sensor."""
        angle_rad = reading.angle_rad
        front = (angle_rad > -FRONT_RAD) & (angle_rad <= FRONT_RAD)
        left = (angle_rad > FRONT_RAD) & (angle_rad <= REAR_RAD)
        right = (angle_rad > -REAR_RAD) & (angle_rad <= -FRONT_RAD)
        across = np.sin(angle_rad)
        answer = np.ascontiguousarray(reading.value.T)
        return cls(answer, front, left, ~(front | left | right), right, across > AXIS, across < -AXIS)

    def weaker_than(self, answer: float) -> "Sectors":
        """The sectors without rays of this answer or more, so with farther objects alone."""
        return replace(self, answer=np.where(self.answer < answer, self.answer, 0.0))

    def strongest(self, rays: BoolArray) -> FloatArray:
        """The greatest answer of these rays, (n,); 0 without such rays."""
        return np.max(self.answer[rays], axis=0, initial=0.0)

    def count(self, rays: BoolArray) -> IntArray:
        """Number of these rays with an answer, (n,)."""
        return np.count_nonzero(self.answer[rays], axis=0)

    def nearer_half(self, rays: BoolArray) -> IntArray:
        """LEFT or RIGHT, the half of these rays with the nearest object, (n,); EITHER where both are equal."""
        return self._half(rays, LEFT, RIGHT)

    def farther_half(self, rays: BoolArray) -> IntArray:
        """The other one, (n,)."""
        return self._half(rays, RIGHT, LEFT)

    def _half(self, rays: BoolArray, if_left: int, if_right: int) -> IntArray:
        left, right = self.strongest(rays & self.left_half), self.strongest(rays & self.right_half)
        return np.where(left > right, if_left, np.where(right > left, if_right, EITHER))


class Turning(Memory):
    """The memory of the last step."""

    side: IntColumn = column(STRAIGHT)  # to which the robot turned


class MinimalistFlocking(VectorAgent[Turning]):
    """Flocking by sector rules, without radio, of Moeslinger, Schmickl and Crailsheim (ECAL 2009).

    Four sectors of 90 degrees: front, left, rear, right. In each step the first rule that applies turns the robot on
    the spot; if none does it drives straight ahead:

        1. avoid: anything in front nearer than `avoid_diameters`: away from the half in which it is nearest;
        2. separation: a robot to the left, in front or to the right, asked in this order, nearer than
           `separation_diameters`: away from it;
        3. lateral cohesion: a robot to the left or right farther than `lateral_diameters`: to the side where more rays
           see such; to neither if as many do;
        4. rear cohesion: a robot behind farther than `rear_diameters`: to the half of the rear in which it is nearest.

    `proximity` sees robots and walls (active infrared), `infrared` robots alone (passive). Distances are from rim to
    surface, in diameters of the body. A turn away from what is in front, and one to the rear, keep the side to which
    the robot turned in the step before; without such, where both halves are equal, and of a robot in front, a draw
    decides. A robot behind turns later than one beside, hence the alignment, of which no rule speaks.

    The paper's own thresholds, speeds and noise are not known to us. Rules and sides are those of ROS2swarm
    (minimalist_flocking_pattern.py), which states that it implements the paper; the thresholds are its values for the
    jackal (1, 1, 2 and 4 m of 5 m), scaled to the 5 diameters of the paper's robot. They keep robots a diameter apart,
    and so out of flocks by a criterion of one diameter. There a robot is distinguished from a wall by the number of
    rays that see it. Speeds are ours; so is `random_turn`, as rule 0, off unless asked for.
    """

    needs: ClassVar[tuple[str, ...]] = ("proximity", "infrared")
    speed_mps: float = 0.1  # straight ahead
    turn_radps: float = 2.0  # turn rate on the spot
    avoid_diameters: float = 1.0  # anything in front is avoided if it is nearer
    separation_diameters: float = 1.0  # robots in front or beside are turned away from if they are nearer
    lateral_diameters: float = 2.0  # robots beside are turned to if they are farther
    rear_diameters: float = 4.0  # robots behind are turned to if they are farther
    random_turn: float = 0.0  # share of the steps, drawn, in which the robot turns to a random side instead

    @classmethod
    def check_parameters(cls, params: Mapping[str, Any], robots: int) -> None:
        """No distance is negative, and a share is one."""
        check_not_negative(params, "avoid_diameters", "separation_diameters", "lateral_diameters", "rear_diameters")
        check_share(params, "random_turn")

    def step(self, robots: Robots, memory: Turning) -> None:
        """Straight ahead, or a turn on the spot."""
        things, mates = Sectors.of(robots.proximity), Sectors.of(robots.infrared)
        diameter_m = 2.0 * robots.body.radius_m
        avoid = _answer_at(robots.proximity.spec, self.avoid_diameters * diameter_m)
        close = _answer_at(robots.infrared.spec, self.separation_diameters * diameter_m)
        astray = mates.weaker_than(_answer_at(robots.infrared.spec, self.lateral_diameters * diameter_m))
        behind = mates.weaker_than(_answer_at(robots.infrared.spec, self.rear_diameters * diameter_m))
        to_left, to_right = astray.count(mates.left), astray.count(mates.right)

        def kept(side: IntArray | int) -> IntArray:
            return np.where(memory.side == STRAIGHT, side, memory.side)

        rules: list[tuple[BoolArray, IntArray | int]] = [
            (things.strongest(things.front) > avoid, kept(things.farther_half(things.front))),
            (mates.strongest(mates.left) > close, RIGHT),
            (mates.strongest(mates.front) > close, kept(EITHER)),
            (mates.strongest(mates.right) > close, LEFT),
            (to_left + to_right > 0, np.sign(to_left - to_right)),
            (behind.strongest(mates.rear) > 0.0, kept(behind.nearer_half(mates.rear))),
        ]
        if self.random_turn > 0.0:
            rules.insert(0, (robots.draw.uniform("whether") < self.random_turn, EITHER))
        side = np.zeros(robots.n, np.int64)
        for applies, turn in reversed(rules):  # so that the first rule prevails
            side = np.where(applies, turn, side)
        if np.any(side == EITHER):  # most steps of a few robots need no draw
            drawn = np.where(robots.draw.uniform("side") < 0.5, LEFT, RIGHT)
            side = np.where(side == EITHER, drawn, side)
        memory.side = side
        linear = np.where(side == STRAIGHT, self.speed_mps, 0.0)
        robots.drive(linear_mps=linear, angular_radps=self.turn_radps * side)


def _answer_at(spec: RayArraySpec, distance_m: float) -> float:
    """The answer of an ideal ray to an object at this distance from the rim."""
    return float(spec.response.value(np.array(distance_m)))
