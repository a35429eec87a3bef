"""Particle swarm search for a light: the robots are the particles, and the radio is their neighbourhood."""

from abc import abstractmethod
from typing import Generic, TypeVar

import numpy as np

from swarmwire.agent.robots import Robots
from swarmwire.agent.vector_agent import FloatColumn, IntColumn, State, VectorAgent, column
from swarmwire.comms.arrays import BoolArray, FloatArray, IntArray

Vectors = tuple[FloatArray, FloatArray]


class Particle(State):
    """What a particle remembers; vectors lead from the robot, in m, along the axes of the compass."""

    steps: IntColumn = column(0)
    own_brightness: FloatColumn = column(-1.0)  # below any light: nothing seen yet
    own_x: FloatColumn = column(0.0)
    own_y: FloatColumn = column(0.0)
    best_brightness: FloatColumn = column(-1.0)  # of the neighbours, as heard
    best_x: FloatColumn = column(0.0)
    best_y: FloatColumn = column(0.0)
    velocity_x: FloatColumn = column(0.0)  # m per update
    velocity_y: FloatColumn = column(0.0)
    target_x: FloatColumn = column(0.0)
    target_y: FloatColumn = column(0.0)


P = TypeVar("P", bound=Particle)


class ParticleSwarm(VectorAgent[P], Generic[P]):
    """The rule of Kennedy and Eberhart (1995), as Pugh and Martinoli (2007) put it on robots.

        v <- w v + a U (own best - x) + b U (neighbours' best - x),    |v| <= speed x time between updates

    with U uniform in [0, 1), drawn anew for each term and axis. Own best is where the robot itself saw the brightest
    light; neighbours' best is the brightest place that it has heard of or seen. Between two updates it drives to x + v
    and keeps away from what is near.

    How a robot knows its motion, and how it speaks of places, is its subclasses' part.
    """

    update_every_ticks: int = 100  # steps between two updates of the velocity
    tell_before_ticks: int = 10  # the own best is broadcast so many steps before an update
    inertia: float = 0.7298  # w; w, a and b are Clerc and Kennedy's constriction for phi = 4.1
    own_weight: float = 1.4962  # a: pull of the own best
    neighbour_weight: float = 1.4962  # b: pull of the neighbours' best
    speed_mps: float = 0.1  # straight ahead
    arrived_m: float = 0.05  # nearer than this to the target the robot waits
    avoidance: float = 2.0  # weight of the rays against the way to the target
    turn_gain_per_s: float = 3.0  # turn rate per angle to the wanted direction

    @abstractmethod
    def moved(self, robots: Robots, state: P) -> Vectors:
        """How far each robot moved since its last step, in m, (n,) each, along the axes of the compass."""

    @abstractmethod
    def tell(self, robots: Robots, state: P, rows: BoolArray) -> None:
        """Broadcast the own best."""

    @abstractmethod
    def told(self, robots: Robots) -> tuple[IntArray, FloatArray, FloatArray, FloatArray]:
        """Row, brightness and vector (from the receiver, in m) of every best that was heard."""

    def step(self, robots: Robots, state: P) -> None:
        """Look, listen, update or tell if it is time, and drive on."""
        _shift(state, *self.moved(robots, state))
        _look(robots, state)
        _listen(state, *self.told(robots))
        self._update(robots, state, state.steps % self.update_every_ticks == 0)
        self.tell(robots, state, (state.steps + self.tell_before_ticks) % self.update_every_ticks == 0)
        self._drive(robots, state)
        state.steps += 1

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

    def _drive(self, robots: Robots, state: P) -> None:
        """To the target, and away from what is near."""
        bearing = np.arctan2(state.target_y, state.target_x) - robots.compass.heading_rad
        pull = np.where(np.hypot(state.target_x, state.target_y) < self.arrived_m, 0.0, 1.0)
        near_x, near_y = robots.proximity.vector_sum()
        x = pull * np.cos(bearing) - self.avoidance * near_x
        y = pull * np.sin(bearing) - self.avoidance * near_y
        angle = np.arctan2(y, x)
        push = np.minimum(np.hypot(x, y), 1.0)
        linear = self.speed_mps * push * np.maximum(np.cos(angle), 0.0)
        robots.drive(linear_mps=linear, angular_radps=self.turn_gain_per_s * push * angle)


def _shift(state: Particle, x: FloatArray, y: FloatArray) -> None:
    """The robots moved, so the places that they remember are elsewhere from them."""
    state.own_x -= x
    state.own_y -= y
    state.best_x -= x
    state.best_y -= y
    state.target_x -= x
    state.target_y -= y


def _look(robots: Robots, state: Particle) -> None:
    """If it is brighter here than ever, here is the own best."""
    brightness = np.add.reduce(robots.light.value, 1)
    brighter = brightness > state.own_brightness
    state.own_brightness[brighter] = brightness[brighter]
    state.own_x[brighter] = 0.0
    state.own_y[brighter] = 0.0


def _listen(state: Particle, row: IntArray, brightness: FloatArray, x: FloatArray, y: FloatArray) -> None:
    """Of all that was heard, keep the brightest of each row; as bright as the one known, it is fresher."""
    order = np.lexsort((brightness, row))
    last = order[np.flatnonzero(np.diff(row[order], append=-1))]  # of each row
    last = last[brightness[last] >= state.best_brightness[row[last]]]
    state.best_brightness[row[last]] = brightness[last]
    state.best_x[row[last]] = x[last]
    state.best_y[row[last]] = y[last]
