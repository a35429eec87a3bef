"""Minimalist flocking: four sectors and four thresholds, without radio; the memory is the side of the current turn.

`Sectors` groups the rays around a body into four sectors of 90 degrees, and into the halves of the body.
"""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from swarmwire.agent import portable
from swarmwire.agent.robots import Robots
from swarmwire.agent.vector_agent import IntColumn, Memory, VectorAgent, column
from swarmwire.comms.base.arrays import BoolArray, FloatArray, IntArray
from swarmwire.comms.base.config import parameter
from swarmwire.comms.robot.sensors.rays import InfraredReading, ProximityReading, RayArraySpec

LEFT, STRAIGHT, RIGHT = 1, 0, -1
EITHER = 2  # a side that is drawn later
FRONT_RAD, REAR_RAD = 0.25 * np.pi, 0.75 * np.pi  # half width of the front; start of the rear on either side
MIN_SINE = 1e-9  # sine of the angle to the body's axis up to which a ray is in neither half


@dataclass(frozen=True)
class Sectors:
    """The rays of n robots by sector; a ray on a border belongs to the sector on its clockwise side.

    The rules compare answers, not distances: nearer objects have greater answers, without a conversion.

    Attributes:
        answer: (rays, n), 0 without an object, 1 at contact. With a row per ray, the maximum over few rays of many
            robots is many times faster.
        front, left, rear, right: masks of the rays in each sector, (rays,).
        left_half, right_half: masks of the rays on either side of the body's axis, (rays,).
    """

    answer: FloatArray
    front: BoolArray
    left: BoolArray
    rear: BoolArray
    right: BoolArray
    left_half: BoolArray
    right_half: BoolArray

    @classmethod
    def from_reading(cls, reading: ProximityReading[FloatArray] | InfraredReading[FloatArray]) -> "Sectors":
        """Group the rays of a sensor."""
        angle_rad = reading.angle_rad
        front = (angle_rad > -FRONT_RAD) & (angle_rad <= FRONT_RAD)
        left = (angle_rad > FRONT_RAD) & (angle_rad <= REAR_RAD)
        right = (angle_rad > -REAR_RAD) & (angle_rad <= -FRONT_RAD)
        sine = portable.sin(angle_rad)
        answer = np.ascontiguousarray(reading.value.T)
        return cls(answer, front, left, ~(front | left | right), right, sine > MIN_SINE, sine < -MIN_SINE)

    def weaker_than(self, answer: float) -> "Sectors":
        """Return the sectors without answers of this value or more, that is with farther objects only."""
        return replace(self, answer=np.where(self.answer < answer, self.answer, 0.0))

    def strongest(self, rays: BoolArray) -> FloatArray:
        """Return the greatest answer of these rays, (n,); 0 without rays."""
        return np.max(self.answer[rays], axis=0, initial=0.0)

    def count(self, rays: BoolArray) -> IntArray:
        """Count the rays with an answer among these, (n,)."""
        return np.count_nonzero(self.answer[rays], axis=0)

    def nearer_half(self, rays: BoolArray) -> IntArray:
        """Return the half of these rays with the nearest object, (n,): LEFT or RIGHT, or EITHER if both are equal."""
        return self._half(rays, LEFT, RIGHT)

    def farther_half(self, rays: BoolArray) -> IntArray:
        """Return the half opposite `nearer_half`, (n,)."""
        return self._half(rays, RIGHT, LEFT)

    def _half(self, rays: BoolArray, if_left: int, if_right: int) -> IntArray:
        """Return `if_left` or `if_right` by the half with the greater answer; EITHER if both are equal."""
        left, right = self.strongest(rays & self.left_half), self.strongest(rays & self.right_half)
        return np.where(left > right, if_left, np.where(right > left, if_right, EITHER))


class Turning(Memory):
    """The memory of the last step."""

    side: IntColumn = column(STRAIGHT)  # side of the robot's turn


class MinimalistFlocking(VectorAgent[Turning]):
    """The flocking of Moeslinger, Schmickl and Crailsheim (ECAL 2009), by rules for sectors, without radio.

    The sectors front, left, rear and right have 90 degrees each. In each step, the first rule that applies turns the
    robot on the spot; without one it drives straight ahead:

        1. avoidance: an object in front nearer than `avoid_diameters`: turn away from the half in which it is nearest;
        2. separation: a robot to the left, in front or to the right, checked in this order, nearer than
           `separation_diameters`: turn away from it;
        3. lateral cohesion: a robot to the left or right farther than `lateral_diameters`: turn to the side where more
           rays see one, to neither if both have the same number;
        4. rear cohesion: a robot behind farther than `rear_diameters`: turn to the half in which it is nearest.

    `proximity` sees robots and walls (active infrared), `infrared` only robots (passive). Distances are from rim to
    surface, in diameters of the body. Turns away from the front and turns to the rear continue a turn of the step
    before; otherwise a draw decides between equal halves, and for a robot in front. Robots align without a rule for it,
    because a robot behind turns later than one to the side.

    The thresholds, speeds and noise of the paper were not available to us. Rules and sides are those of ROS2swarm
    (minimalist_flocking_pattern.py), which states that it implements the paper; the thresholds are its values for the
    jackal (1, 1, 2 and 4 m of 5 m), scaled to the 5 diameters of the paper's robot. They keep robots a diameter apart,
    and so out of flocks by a criterion of one diameter. ROS2swarm distinguishes a robot from a wall by the number of
    rays that see it. The speeds are our choice, and so is `random_turn`, a rule before the others, off by default.
    """

    needs: ClassVar[tuple[str, ...]] = ("proximity", "infrared")
    speed_mps: float = parameter(0.1, help="straight ahead")
    turn_radps: float = parameter(2.0, help="turn rate on the spot")
    avoid_diameters: float = parameter(
        1.0, help="distance of objects in front below which the robot turns away", at_least=0.0
    )
    separation_diameters: float = parameter(
        1.0, help="distance of robots in front or to the side below which it turns away", at_least=0.0
    )
    lateral_diameters: float = parameter(
        2.0, help="distance of robots to the side above which it turns to them", at_least=0.0
    )
    rear_diameters: float = parameter(4.0, help="distance of robots behind above which it turns to them", at_least=0.0)
    random_turn: float = parameter(
        0.0, help="probability per step of a turn to a random side, before all rules", at_least=0.0, at_most=1.0
    )

    def step(self, robots: Robots, memory: Turning) -> None:
        """Drive straight ahead, or turn on the spot."""
        objects, mates = Sectors.from_reading(robots.proximity), Sectors.from_reading(robots.infrared)
        diameter_m = 2.0 * robots.body.radius_m
        avoid = _answer_at(robots.proximity.spec, self.avoid_diameters * diameter_m)
        close = _answer_at(robots.infrared.spec, self.separation_diameters * diameter_m)
        lateral = mates.weaker_than(_answer_at(robots.infrared.spec, self.lateral_diameters * diameter_m))
        rear = mates.weaker_than(_answer_at(robots.infrared.spec, self.rear_diameters * diameter_m))
        left_rays, right_rays = lateral.count(mates.left), lateral.count(mates.right)

        def continued(side: IntArray | int) -> IntArray:
            return np.where(memory.side == STRAIGHT, side, memory.side)

        rules: list[tuple[BoolArray, IntArray | int]] = [
            (objects.strongest(objects.front) > avoid, continued(objects.farther_half(objects.front))),
            (mates.strongest(mates.left) > close, RIGHT),
            (mates.strongest(mates.front) > close, continued(EITHER)),
            (mates.strongest(mates.right) > close, LEFT),
            (left_rays + right_rays > 0, np.sign(left_rays - right_rays)),
            (rear.strongest(mates.rear) > 0.0, continued(rear.nearer_half(mates.rear))),
        ]
        if self.random_turn > 0.0:
            rules.insert(0, (robots.draw.uniform("whether") < self.random_turn, EITHER))
        side = np.zeros(robots.n, np.int64)
        for applies, turn in reversed(rules):  # the first rule prevails
            side = np.where(applies, turn, side)
        if np.any(side == EITHER):  # rare, and the draw costs time
            drawn = np.where(robots.draw.uniform("side") < 0.5, LEFT, RIGHT)
            side = np.where(side == EITHER, drawn, side)
        memory.side = side
        linear = np.where(side == STRAIGHT, self.speed_mps, 0.0)
        robots.drive(linear_mps=linear, angular_radps=self.turn_radps * side)


def _answer_at(spec: RayArraySpec, distance_m: float) -> float:
    """Return the answer of an ideal ray to an object at this distance from the rim."""
    return float(spec.response.value(np.array(distance_m)))
