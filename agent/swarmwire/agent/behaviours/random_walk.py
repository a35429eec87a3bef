"""Random walks: straight spells with turns on the spot between them, and turns away from obstacles.

`RandomWalk` draws its turns, `Coverage` also walks away from received neighbours, and `Diffusion` is ARGoS's rule
without draws. The functions for spells and turns also serve `aggregation.py`.
"""

from collections.abc import Mapping
from typing import Any, ClassVar, TypeVar

import numpy as np

from swarmwire.agent.behaviours._common import check_above_zero, check_share
from swarmwire.agent.robots import Robots
from swarmwire.agent.vector_agent import FloatColumn, Memory, VectorAgent, column
from swarmwire.comms.base.angles import wrap_by_modulo
from swarmwire.comms.base.arrays import BoolArray, FloatArray
from swarmwire.comms.robot.messages import Message


class Walk(Memory):
    """The memory of a walker."""

    left_m: FloatColumn = column(0.0)  # remaining length of the spell
    turn_rad: FloatColumn = column(0.0)  # remaining turn before the spell, positive to the left


W = TypeVar("W", bound=Walk)


def begin_spells(memory: Walk, rows: BoolArray, turn_rad: FloatArray, length_m: FloatArray | float) -> None:
    """The robots of the mask `rows` turn by `turn_rad`, (n,), and then go straight for `length_m`."""
    np.copyto(memory.turn_rad, wrap_by_modulo(turn_rad), where=rows)
    np.copyto(memory.left_m, length_m, where=rows)


def ended(memory: Walk) -> BoolArray:
    """Robots whose spell and turn are both complete, (n,)."""
    return (memory.left_m <= 0.0) & (memory.turn_rad == 0.0)


def turns_away(robots: Robots, detection_threshold: float) -> tuple[BoolArray, FloatArray]:
    """Robots with an obstacle ahead, and a turn to a heading uniform over the half circle away from it, (n,) each.

    An obstacle is ahead if a ray of the front half answers at least `detection_threshold`; its direction is that of
    their vector sum.
    """
    near, ahead = robots.proximity, np.cos(robots.proximity.angle_rad) > 0.0
    value = np.where(ahead, near.value, 0.0)
    blocked = np.max(value, axis=1) >= detection_threshold
    x = np.add.reduce(value * np.cos(near.angle_rad), 1)
    y = np.add.reduce(value * np.sin(near.angle_rad), 1)
    half_circle = robots.draw.uniform("turn away", -0.5 * np.pi, 0.5 * np.pi)
    return blocked, np.arctan2(y, x) + np.pi + half_circle


def walk_on(robots: Robots, memory: Walk, speed_mps: float, turn_radps: float, goes: BoolArray | None = None) -> None:
    """Turn on the spot while a turn remains, else go straight; robots outside the mask `goes` stand."""
    period_s, going = robots.period_s, 1.0 if goes is None else goes.astype(np.float64)
    turned = going * np.clip(memory.turn_rad, -turn_radps * period_s, turn_radps * period_s)
    linear = going * np.where(memory.turn_rad == 0.0, speed_mps, 0.0)
    robots.drive(linear_mps=linear, angular_radps=turned / period_s)
    memory.turn_rad -= turned
    memory.left_m -= linear * period_s


class RandomWalk(VectorAgent[Walk]):
    """Straight spells, turns at random between them, and a turn away from obstacles.

    The length of a spell is exponential of mean `spell_m`, or always that. The turn is from the wrapped Cauchy
    distribution, of which `persistence` is the mean cosine:

        turn = 2 atan((1 - persistence) / (1 + persistence) tan(pi (U - 1/2))),    U uniform in [0, 1)

    0 is run and tumble, each direction as likely as any other; 1 never turns. It is the correlated random walk of
    animals (Codling, Plank and Benhamou 2008) and of kilobots (Dimidov, Oriolo and Trianni 2016). What rays of the
    front half see ends a spell: the next heading is uniform over the half circle away from it, which is our choice.
    """

    needs: ClassVar[tuple[str, ...]] = ("proximity",)
    speed_mps: float = 0.1  # straight ahead
    spell_m: float = 1.0  # mean length of a spell
    exponential: bool = True  # lengths are exponential; false: all are spell_m
    persistence: float = 0.0  # mean cosine of the turn between two spells, 0 to 1
    turn_radps: float = 2.0  # turn rate, on the spot
    detection_threshold: float = (
        0.1  # detection threshold of a ray's answer, 0 to 1; above the noise of the bodies' rays
    )

    @classmethod
    def check_parameters(cls, params: Mapping[str, Any], robots: int) -> None:
        """Spells and turns end."""
        check_above_zero(params, "spell_m", "turn_radps", "detection_threshold")
        check_share(params, "persistence")

    def step(self, robots: Robots, memory: Walk) -> None:
        """On with the spell, or with the turn to the next."""
        length = spell_lengths(robots, self.spell_m, self.exponential)
        begin_spells(memory, ended(memory), turns_at_random(robots, self.persistence), length)
        blocked, away = turns_away(robots, self.detection_threshold)
        begin_spells(memory, blocked & (memory.turn_rad == 0.0), away, length)
        walk_on(robots, memory, self.speed_mps, self.turn_radps)


def spell_lengths(robots: Robots, mean_m: float, exponential: bool = True) -> FloatArray:
    """A length for a new spell of each robot, (n,)."""
    unit = robots.draw.uniform("spell")
    return -mean_m * np.log1p(-unit) if exponential else np.full(robots.n, mean_m)


def turns_at_random(robots: Robots, persistence: float) -> FloatArray:
    """Turns from the wrapped Cauchy distribution of this mean cosine, (n,)."""
    half = robots.draw.uniform("turn", -0.5 * np.pi, 0.5 * np.pi)
    return 2.0 * np.arctan2((1.0 - persistence) * np.sin(half), (1.0 + persistence) * np.cos(half))


class Diffusion(VectorAgent):
    """ARGoS's diffusion rule (argos3-examples, footbot_diffusion.cpp), by proximity alone.

    The mean of the rays' vectors (value towards angle) gives the direction of obstacles. While it is short and points
    into the go-straight sector the robot drives straight; otherwise one wheel stops, so that it turns away.
    """

    needs: ClassVar[tuple[str, ...]] = ("proximity",)
    speed_mps: float = 0.05  # of a driven wheel
    go_straight_rad: float = 0.1309  # half width of the sector ahead in which a weak reading is ignored (7.5 degrees)
    nearness: float = 0.1  # length of the mean vector above which the way ahead counts as blocked, 0 to 1

    def step(self, robots: Robots, memory: Memory) -> None:
        """Straight, or one wheel."""
        proximity = robots.proximity
        rays = len(proximity.angle_rad)
        x, y = proximity.vector_sum()
        angle = np.arctan2(y, x)
        straight = (np.abs(angle) <= self.go_straight_rad) & (np.hypot(x, y) < self.nearness * rays)
        is_left = angle > 0.0
        robots.wheels(
            np.where(straight | is_left, self.speed_mps, 0.0), np.where(straight | ~is_left, self.speed_mps, 0.0)
        )


class Present(Message):
    """What a covering robot broadcasts in every step: its presence. Range and bearing give its place."""


class Coverage(VectorAgent[Walk]):
    """Robots spread, and sweep the space between them: a random walk that received neighbours push away.

    Neighbours push as in the potential field of Howard, Mataric and Sukhatme (2002), which spreads a network of sensors
    over a building and then rests. To keep sweeping, ours turns the directions of a random walk by that push: at the
    end of a spell, the next heading is that of

        u - repulsion_m2 sum of r / |r|^3,    u a unit vector at random, r from the robot to each neighbour received

    over the packets of the last step alone: there is no memory of earlier ones. A robot without packets walks as
    `RandomWalk`. Walls push by rays instead of by a field: the next heading is uniform over the half circle away from
    them. The source's viscous friction, which ends the motion, is left out.
    """

    needs: ClassVar[tuple[str, ...]] = ("proximity", "radio.range", "radio.bearing")
    speed_mps: float = 0.1  # straight ahead
    spell_m: float = 2.0  # mean length of a spell, exponential
    repulsion_m2: float = 1.0  # a neighbour at the root of this, in m, pushes as much as chance
    nearest_m: float = 0.1  # a nearer neighbour pushes as at this range
    turn_radps: float = 2.0  # turn rate, on the spot
    detection_threshold: float = (
        0.1  # detection threshold of a ray's answer, 0 to 1; above the noise of the bodies' rays
    )

    @classmethod
    def check_parameters(cls, params: Mapping[str, Any], robots: int) -> None:
        """Spells and turns end, and every push is bounded."""
        check_above_zero(params, "spell_m", "nearest_m", "turn_radps", "detection_threshold")

    def step(self, robots: Robots, memory: Walk) -> None:
        """On with the spell, or with the turn to the next; and be received."""
        received = robots.radio.received(Present)
        push = self.repulsion_m2 / np.maximum(received.range_m, self.nearest_m) ** 2
        chance = turns_at_random(robots, 0.0)
        x = np.cos(chance) - received.sum(push * np.cos(received.bearing_rad))
        y = np.sin(chance) - received.sum(push * np.sin(received.bearing_rad))

        length = spell_lengths(robots, self.spell_m)
        begin_spells(memory, ended(memory), np.arctan2(y, x), length)
        blocked, away = turns_away(robots, self.detection_threshold)
        begin_spells(memory, blocked & (memory.turn_rad == 0.0), away, length)
        walk_on(robots, memory, self.speed_mps, self.turn_radps)
        robots.radio.send(Present)
