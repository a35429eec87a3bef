"""Lennard-Jones flocking: neighbours push when they are near and pull when they are far, and a light pulls all."""

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from swarmwire.agent.behaviours._common import check_above_zero, check_order
from swarmwire.agent.robots import Robots
from swarmwire.agent.vector_agent import BoolColumn, Memory, VectorAgent, column
from swarmwire.comms.base.arrays import BoolArray, FloatArray
from swarmwire.comms.robot.messages import Message

NEAREST_M = 0.001  # noise may carry a range to 0 and below, where the force has no value


class Here(Message):
    """A beacon: all that it says is where it came from."""


class WheelHysteresis(Memory):
    """What hysteresis remembers."""

    hard: BoolColumn = column(False)  # whether the last step was a turn on the spot


class LennardJonesFlocking(VectorAgent[WheelHysteresis]):
    """The flocking example of ARGoS (argos3-examples, footbot_flocking), with neighbours by the radio.

    Each beacon received since the last step, from less than `reach` x t away, adds a vector along its bearing, of
    length

        f(d) = -(gain / d) ((t / d)^(2 e) - (t / d)^e)   in m/s,

    with t = `target_m`, e = `exponent`, and d its range in m: negative, so away from the neighbour, if that is nearer
    than t. Their mean is cut to `speed_mps`, and a vector to the light of length `light` x `speed_mps` is added
    wherever the photocells see one (vector sum at least `detection_threshold`). The sum's length, cut again, is the
    wheels' speed v;
    its angle a to the way ahead says how they turn: a hard turn, one wheel back and one ahead at `speed_mps`, begins
    beyond 90 degrees and lasts until 70; no turn within 10 degrees; else a soft one, v (1 - |a| / 90) and
    v (1 + |a| / 90). The gap between 70 and 90 is hysteresis: it keeps a robot from dithering between kinds of turn.

    There neighbours are seen by the camera (beacons lit, aperture 80 degrees: 1.64 m) and none is ever lost; here a
    range and a bearing come with a packet, as they were when it went on air, so loss leaves neighbours out of the mean,
    and latency shows them where they were. ARGoS's gain of 1000 is in cm: 0.1 m²/s. The wheels' limit is the body's.
    """

    needs: ClassVar[tuple[str, ...]] = ("light", "radio.range", "radio.bearing")
    speed_mps: float = 0.1  # of the wheels at most, and of either in a hard turn
    target_m: float = 0.75  # t: distance at which a neighbour neither pulls nor pushes
    gain: float = 0.1  # strength of the force, m²/s
    exponent: float = 2.0  # e: how steep it is
    reach: float = 1.8  # neighbours farther than so many times t do not count
    light: float = 0.25  # length of the vector to the light, in `speed_mps`; 0: no goal
    detection_threshold: float = 0.01  # least length of the photocells' vector sum that counts as a light
    hard_rad: float = 1.5708  # a hard turn begins beyond this angle (90 degrees)
    soft_rad: float = 1.2217  # and ends within this one (70 degrees)
    straight_rad: float = 0.1745  # no turn within this angle (10 degrees)

    @classmethod
    def check_parameters(cls, params: Mapping[str, Any], robots: int) -> None:
        """What is divided by is above 0, and hysteresis has a gap."""
        check_above_zero(params, "speed_mps", "target_m", "exponent", "detection_threshold", "hard_rad")
        check_order(cls, params, "soft_rad", "hard_rad")

    def step(self, robots: Robots, memory: WheelHysteresis) -> None:
        """Roll along the sum of all pulls, and say where one is."""
        received = robots.radio.received(Here)
        counts = received.range_m < self.reach * self.target_m
        force = np.where(counts, self.force(received.range_m), 0.0)
        counted = np.maximum(received.sum(counts.astype(np.float64)), 1.0)
        x = received.sum(force * np.cos(received.bearing_rad)) / counted
        y = received.sum(force * np.sin(received.bearing_rad)) / counted
        x, y = _cut(x, y, self.speed_mps)
        light_x, light_y = self._to_light(robots)
        self._roll(robots, memory, x + light_x, y + light_y)
        robots.radio.send(Here)

    def force(self, distance_m: FloatArray) -> FloatArray:
        """The pull of neighbours at these distances (k,), in m/s; negative: a push."""
        distance_m = np.maximum(distance_m, NEAREST_M)
        ratio = np.power(self.target_m / distance_m, self.exponent)
        return -self.gain / distance_m * (ratio * ratio - ratio)

    def _to_light(self, robots: Robots) -> tuple[FloatArray, FloatArray]:
        x, y = robots.light.vector_sum()
        length = np.hypot(x, y)
        scale = np.where(
            length >= self.detection_threshold,
            self.light * self.speed_mps / np.maximum(length, self.detection_threshold),
            0.0,
        )
        return scale * x, scale * y

    def _roll(self, robots: Robots, memory: WheelHysteresis, x: FloatArray, y: FloatArray) -> None:
        """Wheels that turn towards the vector, (n,) each."""
        angle, speed = np.arctan2(y, x), np.minimum(np.hypot(x, y), self.speed_mps)
        off: FloatArray = np.abs(angle)
        hard: BoolArray = (off > self.hard_rad) | (memory.hard & (off > self.soft_rad))
        memory.hard = hard
        less = np.where(off <= self.straight_rad, 0.0, off / self.hard_rad)
        slow = np.where(hard, -self.speed_mps, speed * (1.0 - less))
        fast = np.where(hard, self.speed_mps, speed * (1.0 + less))
        left = angle > 0.0
        robots.wheels(np.where(left, slow, fast), np.where(left, fast, slow))


def _cut(x: FloatArray, y: FloatArray, longest: float) -> tuple[FloatArray, FloatArray]:
    """Vectors (n,) no longer than `longest`, in the same directions."""
    scale = longest / np.maximum(np.hypot(x, y), longest)
    return scale * x, scale * y
