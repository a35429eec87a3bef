"""Random walks: straight spells with turns on the spot between them, and turns away from obstacles.

`RandomWalk` draws its turns, `Coverage` also walks away from received neighbours, and `Diffusion` is ARGoS's rule
without draws. `aggregation.py` uses the functions for spells and turns, too.
"""

from typing import ClassVar, TypeVar

import numpy as np

from swarmwire.agent import portable
from swarmwire.agent.robots import Robots
from swarmwire.agent.vector_agent import FloatColumn, Memory, VectorAgent, column
from swarmwire.comms.base.angles import wrap_by_modulo
from swarmwire.comms.base.arrays import BoolArray, FloatArray
from swarmwire.comms.base.config import parameter
from swarmwire.comms.robot.messages import Message


class Walk(Memory):
    """The memory of a walker."""

    remaining_m: FloatColumn = column(0.0)  # remaining length of the spell
    turn_rad: FloatColumn = column(0.0)  # remaining turn before the spell, positive to the left


W = TypeVar("W", bound=Walk)


def begin_spells(memory: Walk, rows: BoolArray, turn_rad: FloatArray, length_m: FloatArray | float) -> None:
    """Let the robots of the mask `rows` turn by `turn_rad`, (n,), and then drive straight for `length_m`."""
    np.copyto(memory.turn_rad, wrap_by_modulo(turn_rad), where=rows)
    np.copyto(memory.remaining_m, length_m, where=rows)


def spell_ended(memory: Walk) -> BoolArray:
    """Return the mask of robots that have completed turn and spell, (n,)."""
    return (memory.remaining_m <= 0.0) & (memory.turn_rad == 0.0)


def turns_away(robots: Robots, detection_threshold: float) -> tuple[BoolArray, FloatArray]:
    """Return the mask of blocked robots, and random turns to the half circle away from the obstacle, (n,) each.

    A robot is blocked if a ray of the front half answers at least `detection_threshold`; the direction of the obstacle
    is that of these rays' vector sum.
    """
    proximity = robots.proximity
    value = np.where(portable.cos(proximity.angle_rad) > 0.0, proximity.value, 0.0)
    blocked = np.max(value, axis=1) >= detection_threshold
    x = portable.ordered_sum(value * portable.cos(proximity.angle_rad))
    y = portable.ordered_sum(value * portable.sin(proximity.angle_rad))
    half_circle = robots.draw.uniform("turn away", -0.5 * np.pi, 0.5 * np.pi)
    return blocked, portable.atan2(y, x) + np.pi + half_circle


def walk(robots: Robots, memory: Walk, speed_mps: float, turn_radps: float, moving: BoolArray | None = None) -> None:
    """Turn on the spot while a turn remains, else drive straight; robots outside the mask `moving` stop."""
    period_s, factor = robots.period_s, 1.0 if moving is None else moving.astype(np.float64)
    turned = factor * np.clip(memory.turn_rad, -turn_radps * period_s, turn_radps * period_s)
    linear = factor * np.where(memory.turn_rad == 0.0, speed_mps, 0.0)
    robots.drive(linear_mps=linear, angular_radps=turned / period_s)
    memory.turn_rad -= turned
    memory.remaining_m -= linear * period_s


class RandomWalk(VectorAgent[Walk]):
    """Straight spells, random turns between them, and a turn away from obstacles.

    The length of a spell is exponential with mean `spell_m`, or constant. The turn is from the wrapped Cauchy
    distribution with the mean cosine `persistence`:

        turn = 2 atan((1 - persistence) / (1 + persistence) tan(pi (U - 1/2))),    U uniform in [0, 1)

    With 0 all directions are equally likely (run and tumble); with 1 a robot never turns. This is the correlated random
    walk of animals (Codling, Plank and Benhamou 2008) and of kilobots (Dimidov, Oriolo and Trianni 2016). An obstacle
    in the rays of the front half ends a spell: the next heading is uniform over the half circle away from it, which is
    our choice.
    """

    needs: ClassVar[tuple[str, ...]] = ("proximity",)
    speed_mps: float = parameter(0.1, help="straight ahead")
    spell_m: float = parameter(1.0, help="mean length of a spell", above=0.0)
    exponential: bool = parameter(True, help="exponential lengths; false: all are `spell_m`")
    persistence: float = parameter(
        0.0, help="mean cosine of the turn between two spells, 0 to 1", at_least=0.0, at_most=1.0
    )
    turn_radps: float = parameter(2.0, help="turn rate on the spot", above=0.0)
    detection_threshold: float = parameter(
        0.1, help="least answer of a ray, 0 to 1, that is an obstacle; above the rays' noise", above=0.0
    )

    def step(self, robots: Robots, memory: Walk) -> None:
        """Continue the spell, or the turn to the next."""
        length = spell_lengths(robots, self.spell_m, self.exponential)
        begin_spells(memory, spell_ended(memory), random_turns(robots, self.persistence), length)
        blocked, away = turns_away(robots, self.detection_threshold)
        begin_spells(memory, blocked & (memory.turn_rad == 0.0), away, length)
        walk(robots, memory, self.speed_mps, self.turn_radps)


def spell_lengths(robots: Robots, mean_m: float, exponential: bool = True) -> FloatArray:
    """Draw the length of a new spell for each robot, (n,)."""
    unit = robots.draw.uniform("spell")
    return -mean_m * portable.log1p(-unit) if exponential else np.full(robots.n, mean_m)


def random_turns(robots: Robots, persistence: float) -> FloatArray:
    """Draw turns from the wrapped Cauchy distribution with the mean cosine `persistence`, (n,)."""
    half = robots.draw.uniform("turn", -0.5 * np.pi, 0.5 * np.pi)
    return 2.0 * portable.atan2((1.0 - persistence) * portable.sin(half), (1.0 + persistence) * portable.cos(half))


class Diffusion(VectorAgent):
    """The diffusion rule of ARGoS (argos3-examples, footbot_diffusion.cpp), by proximity rays.

    The mean of the rays' vectors (value towards angle) is the direction of obstacles. While it is short and within the
    sector straight ahead, the robot drives straight; otherwise one wheel stops, and the robot turns away.
    """

    needs: ClassVar[tuple[str, ...]] = ("proximity",)
    speed_mps: float = parameter(0.05, help="speed of a driven wheel")
    go_straight_rad: float = parameter(
        0.1309, help="half width of the sector ahead in which a weak reading is ignored (7.5 degrees)"
    )
    nearness: float = parameter(
        0.1, help="length of the mean vector above which the way ahead counts as blocked, 0 to 1"
    )

    def step(self, robots: Robots, memory: Memory) -> None:
        """Drive straight, or stop the wheel opposite the obstacle."""
        proximity = robots.proximity
        rays = len(proximity.angle_rad)
        x, y = proximity.vector_sum()
        angle = portable.atan2(y, x)
        straight = (np.abs(angle) <= self.go_straight_rad) & (portable.hypot(x, y) < self.nearness * rays)
        turn_right = angle > 0.0
        robots.wheels(
            np.where(straight | turn_right, self.speed_mps, 0.0), np.where(straight | ~turn_right, self.speed_mps, 0.0)
        )


class Present(Message):
    """An empty beacon, broadcast in every step; range and bearing come with its reception."""


class Coverage(VectorAgent[Walk]):
    """Robots spread over an area and sweep it: a random walk that is repelled by received neighbours.

    The repulsion is that of the potential field of Howard, Matarić and Sukhatme (2002), which spreads a sensor network
    over a building until it rests. Here it biases the directions of a random walk, so that robots keep sweeping: at the
    end of a spell, the next heading is that of

        u - repulsion_m2 sum of r / |r|^3,    u a unit vector at random, r from the robot to each neighbour received

    over the packets of the last step; earlier packets are forgotten. A robot without packets walks as `RandomWalk`.
    Walls are avoided by rays instead of a field: the next heading is uniform over the half circle away from them. The
    viscous friction of the paper, which ends the motion, is left out.
    """

    needs: ClassVar[tuple[str, ...]] = ("proximity", "radio.range", "radio.bearing")
    speed_mps: float = parameter(0.1, help="straight ahead")
    spell_m: float = parameter(2.0, help="mean length of a spell, exponential", above=0.0)
    repulsion_m2: float = parameter(
        1.0, help="square of the range at which a neighbour weighs as much as the random direction"
    )
    nearest_m: float = parameter(0.1, help="lower bound of ranges in the repulsion", above=0.0)
    turn_radps: float = parameter(2.0, help="turn rate on the spot", above=0.0)
    detection_threshold: float = parameter(
        0.1, help="least answer of a ray, 0 to 1, that is an obstacle; above the rays' noise", above=0.0
    )

    def step(self, robots: Robots, memory: Walk) -> None:
        """Continue the spell, or the turn to the next, and broadcast a beacon."""
        received = robots.radio.received(Present)
        repulsion = self.repulsion_m2 / np.maximum(received.range_m, self.nearest_m) ** 2
        direction = random_turns(robots, 0.0)
        x = portable.cos(direction) - received.sum(repulsion * portable.cos(received.bearing_rad))
        y = portable.sin(direction) - received.sum(repulsion * portable.sin(received.bearing_rad))

        length = spell_lengths(robots, self.spell_m)
        begin_spells(memory, spell_ended(memory), portable.atan2(y, x), length)
        blocked, away = turns_away(robots, self.detection_threshold)
        begin_spells(memory, blocked & (memory.turn_rad == 0.0), away, length)
        walk(robots, memory, self.speed_mps, self.turn_radps)
        robots.radio.send(Present)
