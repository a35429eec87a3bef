"""Lennard-Jones flocking: near neighbours repel, far ones attract, and a light attracts all robots."""

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from swarmwire.agent import portable
from swarmwire.agent.behaviours._common import check_order
from swarmwire.agent.robots import Robots
from swarmwire.agent.vector_agent import BoolColumn, Memory, VectorAgent, column
from swarmwire.comms.base.arrays import BoolArray, FloatArray
from swarmwire.comms.base.config import parameter
from swarmwire.comms.robot.messages import Message

NEAREST_M = 0.001  # lower bound of ranges, which noise may make 0 or negative


class Here(Message):
    """An empty beacon, broadcast in every step; range and bearing come with its reception."""


class WheelHysteresis(Memory):
    """The state of the turn's hysteresis."""

    hard: BoolColumn = column(False)  # True after a step with a turn on the spot


class LennardJonesFlocking(VectorAgent[WheelHysteresis]):
    """The flocking example of ARGoS (argos3-examples, footbot_flocking), with neighbours by radio.

    Each beacon received since the last step, from a range d below `reach` x t, adds a vector along its bearing, of
    length

        f(d) = -(gain / d) ((t / d)^(2 e) - (t / d)^e)   in m/s,

    with t = `target_m` and e = `exponent`. Below t the length is negative: the neighbour repels. The mean of these
    vectors is cut to `speed_mps`. If the photocells detect a light (vector sum of at least `detection_threshold`), a
    vector towards it of length `light` x `speed_mps` is added. The length of the sum, cut again, is the speed v of the
    wheels. Its angle a from the heading determines the turn:

        |a| up to 10 degrees          no turn      v and v
        up to 90 degrees              soft turn    v (1 - |a| / 90) and v (1 + |a| / 90)
        beyond 90 degrees, until 70   hard turn    -speed_mps and speed_mps, on the spot

    The hysteresis between 70 and 90 degrees keeps a robot from dithering between two kinds of turn.

    In ARGoS, robots see neighbours by camera (lit beacons, aperture 80 degrees: 1.64 m), and none is lost. Here, range
    and bearing come with a packet, and are those of the time when it went on air: loss removes neighbours from the
    mean, and latency shows them at earlier positions. ARGoS's gain of 1000 is in cm, hence 0.1 m²/s. The wheels' limit
    is the body's.
    """

    needs: ClassVar[tuple[str, ...]] = ("light", "radio.range", "radio.bearing")
    speed_mps: float = parameter(0.1, help="highest speed of a wheel, and the speed of both in a hard turn", above=0.0)
    target_m: float = parameter(0.75, help="distance t at which a neighbour neither attracts nor repels", above=0.0)
    gain: float = parameter(0.1, help="strength of the force, m²/s")
    exponent: float = parameter(2.0, help="steepness e of the force", above=0.0)
    reach: float = parameter(1.8, help="distance from which on neighbours do not count, in multiples of t")
    light: float = parameter(0.25, help="length of the vector to the light, in multiples of `speed_mps`; 0: no goal")
    detection_threshold: float = parameter(
        0.01, help="least length of the photocells' vector sum that counts as a light", above=0.0
    )
    hard_rad: float = parameter(1.5708, help="angle beyond which a hard turn begins (90 degrees)", above=0.0)
    soft_rad: float = parameter(1.2217, help="angle at which a hard turn ends (70 degrees)")
    straight_rad: float = parameter(0.1745, help="angle up to which the robot drives straight (10 degrees)")

    @classmethod
    def check_parameters(cls, params: Mapping[str, Any], robots: int) -> None:
        """Refuse a hysteresis in the wrong order."""
        check_order(cls, params, "soft_rad", "hard_rad")

    def step(self, robots: Robots, memory: WheelHysteresis) -> None:
        """Drive along the sum of all forces, and broadcast a beacon."""
        received = robots.radio.received(Here)
        in_reach = received.range_m < self.reach * self.target_m
        force = np.where(in_reach, self.force(received.range_m), 0.0)
        neighbours = np.maximum(received.sum(in_reach.astype(np.float64)), 1.0)
        x = received.sum(force * portable.cos(received.bearing_rad)) / neighbours
        y = received.sum(force * portable.sin(received.bearing_rad)) / neighbours
        x, y = _cut(x, y, self.speed_mps)
        light_x, light_y = self._to_light(robots)
        self._drive(robots, memory, x + light_x, y + light_y)
        robots.radio.send(Here)

    def force(self, distance_m: FloatArray) -> FloatArray:
        """Return the force of neighbours at these distances (k,), in m/s; negative ones repel."""
        distance_m = np.maximum(distance_m, NEAREST_M)
        ratio = portable.power(self.target_m / distance_m, self.exponent)
        return -self.gain / distance_m * (ratio * ratio - ratio)

    def _to_light(self, robots: Robots) -> tuple[FloatArray, FloatArray]:
        """Return x and y of the vectors to the light, (n,) each; 0 without a light."""
        x, y = robots.light.vector_sum()
        length = portable.hypot(x, y)
        scale = np.where(
            length >= self.detection_threshold,
            self.light * self.speed_mps / np.maximum(length, self.detection_threshold),
            0.0,
        )
        return scale * x, scale * y

    def _drive(self, robots: Robots, memory: WheelHysteresis, x: FloatArray, y: FloatArray) -> None:
        """Turn the wheels such that the robots drive towards the vectors (x, y), (n,) each."""
        angle, speed = portable.atan2(y, x), np.minimum(portable.hypot(x, y), self.speed_mps)
        deviation: FloatArray = np.abs(angle)
        hard: BoolArray = (deviation > self.hard_rad) | (memory.hard & (deviation > self.soft_rad))
        memory.hard = hard
        difference = np.where(deviation <= self.straight_rad, 0.0, deviation / self.hard_rad)
        inner = np.where(hard, -self.speed_mps, speed * (1.0 - difference))
        outer = np.where(hard, self.speed_mps, speed * (1.0 + difference))
        turns_left = angle > 0.0
        robots.wheels(np.where(turns_left, inner, outer), np.where(turns_left, outer, inner))


def _cut(x: FloatArray, y: FloatArray, longest: float) -> tuple[FloatArray, FloatArray]:
    """Cut vectors (n,) to the length `longest`, in the same directions."""
    scale = longest / np.maximum(portable.hypot(x, y), longest)
    return scale * x, scale * y
