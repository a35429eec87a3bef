"""Particle swarm search for a light: the robots are the particles, and the radio is their neighbourhood."""

from abc import abstractmethod
from collections.abc import Mapping
from typing import Any, Generic, TypeVar

import numpy as np

from swarmwire.agent.behaviours.limits import check_above_zero
from swarmwire.agent.behaviours.pso.particle import DARK, Bests, Particle, listen, look, shift
from swarmwire.agent.behaviours.pso.ring import check_ring, ring_neighbours
from swarmwire.agent.fields import Vectors
from swarmwire.agent.per_robot import PerRobot, per_robot
from swarmwire.agent.robots import Robots
from swarmwire.agent.vector_agent import VectorAgent
from swarmwire.comms.arrays import BoolArray, FloatArray, IntArray

P = TypeVar("P", bound=Particle)


class ParticleSwarm(VectorAgent[P], Generic[P]):
    """The rule of Kennedy and Eberhart (1995), as Pugh and Martinoli (2007) put it on robots.

        v <- w v + a U (own best - x) + b U (neighbours' best - x),    |v| <= speed x time between updates

    with U uniform in [0, 1), drawn anew for each term and axis. Own best is where the robot itself saw the brightest
    light; neighbours' best is the brightest place that it has heard of or seen. Between two updates it heads for x + v.

    Neighbours are those who are heard: all with a radio that reaches all, else those in its range; with
    `ring_count` only those next to it on a ring of indices, if they are heard. What a neighbour told counts for good,
    also when it is gone; with `keeps_heard = false` up to the next update, which is how a particle swarm in a computer
    asks its neighbourhood.

    By itself the own best is the brightest reading, so a lucky one is believed for ever. With `again_m`
    the own best is measured again, and the mean of all its readings counts, as in Pugh's code for noisy fitness (new
    mean = ((k - 1) mean + reading) / k at the k-th). A robot can measure only where it stands: so a reading counts as
    one of the own best whenever the robot is that near to it, on its way out, when it comes back and while it rests
    there. What was told is corrected by telling anew, for those who do not keep what they heard.

    How a robot knows its motion, speaks of places and moves is its subclasses' part.
    """

    update_every_ticks: int = 100  # steps between two updates of the velocity
    tell_before_ticks: int = 10  # the own best is broadcast so many steps before an update
    inertia: float = 0.7298  # w; w, a and b are Clerc and Kennedy's constriction for phi = 4.1
    own_weight: float = 1.4962  # a: pull of the own best
    neighbour_weight: float = 1.4962  # b: pull of the neighbours' best
    speed_mps: float = 0.1  # straight ahead
    keeps_heard: bool = True  # whether what neighbours told counts for longer than until the next update
    again_m: float = 0.0  # a reading so near to the own best is one more of it; 0: the brightest reading counts
    ring_count: int = 0  # robots on the ring; 0: no ring, all who are heard are neighbours
    ring_index: PerRobot[int] = per_robot(0)  # of the robot in the arena: its place on the ring
    ring_width: int = 1  # neighbours on each side

    @classmethod
    def check_parameters(cls, params: Mapping[str, Any], robots: int) -> None:
        """Updates are some steps apart, and a ring needs the place of each robot."""
        check_above_zero(params, "update_every_ticks")
        check_ring(cls, params, robots)

    @abstractmethod
    def moved(self, robots: Robots, state: P) -> Vectors:
        """How far each robot moved since its last step, in m, (n,) each, along the axes of the compass."""

    @abstractmethod
    def tell(self, robots: Robots, state: P, rows: BoolArray) -> None:
        """Broadcast the own best."""

    @abstractmethod
    def told(self, robots: Robots) -> Bests:
        """Every best that was heard."""

    @abstractmethod
    def head_for_target(self, robots: Robots, state: P) -> None:
        """Drive on."""

    def step(self, robots: Robots, state: P) -> None:
        """Look, listen, update or tell if it is time, and drive on."""
        shift(state, self.moved(robots, state))
        look(state, np.add.reduce(robots.light.value, 1), self.again_m)
        listen(state, self._of_neighbours(self.told(robots)))
        self._update(robots, state, state.steps % self.update_every_ticks == 0)
        self.tell(robots, state, (state.steps + self.tell_before_ticks) % self.update_every_ticks == 0)
        self.head_for_target(robots, state)
        state.steps += 1

    def _of_neighbours(self, bests: Bests) -> Bests:
        if self.ring_count == 0:
            return bests
        return bests.of(ring_neighbours(bests.sender, self.ring_index[bests.row], self.ring_count, self.ring_width))

    def _update(self, robots: Robots, state: P, now: BoolArray) -> None:
        """A new velocity, and with it a new target."""
        if not now.any():
            return
        furthest = self.speed_mps * self.update_every_ticks * robots.period_s
        brighter = state.best_brightness > state.own_brightness
        best_x = np.where(brighter, state.best_x, state.own_x)
        best_y = np.where(brighter, state.best_y, state.own_y)
        x = self._velocity(robots, "x", furthest, state.steps, state.velocity_x, state.own_x, best_x)
        y = self._velocity(robots, "y", furthest, state.steps, state.velocity_y, state.own_y, best_y)
        bounded = np.minimum(1.0, furthest / np.maximum(np.hypot(x, y), 1e-9))
        state.velocity_x[now] = state.target_x[now] = (x * bounded)[now]
        state.velocity_y[now] = state.target_y[now] = (y * bounded)[now]
        robots.note("to its own best", now & ~brighter)
        robots.note("to the neighbours' best", now & brighter)
        if not self.keeps_heard:
            state.best_brightness[now] = DARK

    def _velocity(
        self,
        robots: Robots,
        axis: str,
        furthest: float,
        steps: IntArray,
        velocity: FloatArray,
        own: FloatArray,
        best: FloatArray,
    ) -> FloatArray:
        """The rule along one axis; a velocity at random for the first time."""
        pull = self.own_weight * robots.draw.uniform(f"own {axis}") * own
        pull += self.neighbour_weight * robots.draw.uniform(f"neighbours {axis}") * best
        first = robots.draw.uniform(f"first {axis}", -furthest, furthest)
        return np.where(steps == 0, first, self.inertia * velocity + pull)
