"""Particle swarm search for a light: the robots are the particles, and the radio is their neighbourhood.

`ring_neighbours` is the optional ring topology, neighbours by index. `Particle` is the memory of a robot, with the
functions that update it; `ParticleSwarm` is the rule. How a robot measures its motion, sends places and drives is in
`variants.py`.
"""

from abc import abstractmethod
from collections.abc import Mapping
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np

from swarmwire.agent.behaviours._common import check_above_zero
from swarmwire.agent.fields import Vectors
from swarmwire.agent.parameters import BadParameter, parameters_of
from swarmwire.agent.robots import Robots
from swarmwire.agent.vector_agent import FloatColumn, IntColumn, Memory, PerRobot, VectorAgent, column, per_robot
from swarmwire.comms.base.arrays import BoolArray, FloatArray, IntArray

DARK = -1.0  # below any light: nothing seen or received yet


def ring_neighbours(sender: IntArray, index: IntArray, count: int, width: int) -> BoolArray:
    """Mask (k,) of senders at most `width` places from the index (k,) of the receiving robot."""
    apart = np.mod(sender - index, count)
    return np.minimum(apart, count - apart) <= width


def check_ring(kind: type, params: Mapping[str, Any], robots: int) -> None:
    """BadParameter unless count, width and indices of so many robots can be a ring, or there is none.

    One that is not given has the default of the class `kind`.
    """
    declared = parameters_of(kind)
    count, width, index = (
        params.get(name, declared[name].default) for name in ("ring_count", "ring_width", "ring_index")
    )
    if count < 0:
        raise BadParameter("ring_count", f"expected 0 (no ring) or how many robots are on the ring, got {count}")
    if width < 1:
        raise BadParameter("ring_width", f"expected at least 1 neighbour on each side, got {width}")
    for_all = isinstance(index, int) and robots > 1
    if count > 0 and (for_all or not np.all((np.array(index) >= 0) & (np.array(index) < count))):
        expected = f"expected a list with the index in the arena of each robot, 0 to {count - 1}"
        raise BadParameter("ring_index", f"{expected}, got {index}")


class Particle(Memory):
    """The memory of a particle; vectors lead from the robot, in m, along the axes of the compass."""

    steps: IntColumn = column(0)
    own_brightness: FloatColumn = column(DARK)
    own_readings: IntColumn = column(0)  # of which the own brightness is the mean
    own_x: FloatColumn = column(0.0)
    own_y: FloatColumn = column(0.0)
    best_brightness: FloatColumn = column(DARK)  # of the neighbours, as received
    best_x: FloatColumn = column(0.0)
    best_y: FloatColumn = column(0.0)
    velocity_x: FloatColumn = column(0.0)  # m per update
    velocity_y: FloatColumn = column(0.0)
    target_x: FloatColumn = column(0.0)
    target_y: FloatColumn = column(0.0)


class Bests(NamedTuple):
    """Bests that were received, (k,) each."""

    row: IntArray  # of the robot that received it
    sender: IntArray  # index in the arena
    brightness: FloatArray
    x: FloatArray  # from the robot that received it, in m, along the axes of the compass
    y: FloatArray

    def of(self, which: BoolArray) -> "Bests":
        """Those of the mask (k,)."""
        return Bests(self.row[which], self.sender[which], self.brightness[which], self.x[which], self.y[which])


def shift(memory: Particle, by_m: Vectors) -> None:
    """The robots moved by so much (n,), along the axes of the compass: places they remember are elsewhere from them."""
    memory.own_x -= by_m.x
    memory.own_y -= by_m.y
    memory.best_x -= by_m.x
    memory.best_y -= by_m.y
    memory.target_x -= by_m.x
    memory.target_y -= by_m.y


def look(memory: Particle, brightness: FloatArray, again_m: float) -> None:
    """Where it is brighter (n,) than at the own best, here is the own best.

    Nearer than `again_m` to the own best it is one more reading of it: their mean counts, and the place stays.
    """
    again = (memory.own_readings > 0) & (np.hypot(memory.own_x, memory.own_y) < again_m)
    memory.own_readings[again] += 1
    surprise = brightness - memory.own_brightness
    memory.own_brightness[again] += (surprise / np.maximum(memory.own_readings, 1))[again]
    brighter = ~again & (surprise > 0.0)
    memory.own_brightness[brighter] = brightness[brighter]
    memory.own_readings[brighter] = 1
    memory.own_x[brighter] = 0.0
    memory.own_y[brighter] = 0.0


def listen(memory: Particle, bests: Bests) -> None:
    """Keep the brightest received best of each row; one as bright as the known best replaces it, as it is newer."""
    order = np.lexsort((bests.brightness, bests.row))
    last = order[np.flatnonzero(np.diff(bests.row[order], append=-1))]  # of each row
    last = last[bests.brightness[last] >= memory.best_brightness[bests.row[last]]]
    row = bests.row[last]
    memory.best_brightness[row] = bests.brightness[last]
    memory.best_x[row] = bests.x[last]
    memory.best_y[row] = bests.y[last]


P = TypeVar("P", bound=Particle)


class ParticleSwarm(VectorAgent[P], Generic[P]):
    """The rule of Kennedy and Eberhart (1995), as Pugh and Martinoli (2007) put it on robots.

        v <- w v + a U (own best - x) + b U (neighbours' best - x),    |v| <= speed x time between updates

    with U uniform in [0, 1), drawn again for each term and axis. Own best is where the robot itself saw the brightest
    light; neighbours' best is the brightest place that it has received of or seen. Between two updates it heads for x +
    v.

    Neighbours are those who are received: all with a radio that reaches all, else those in its range; with
    `ring_count` only those next to it on a ring of indices, if they are received. What a neighbour sent counts for
    good, also when it is gone; with `keeps_received = false` up to the next update, which is how a particle swarm in a
    computer asks its neighbourhood.

    By itself the own best is the brightest reading, so a lucky one is believed for ever. With `again_m`
    the own best is measured again, and the mean of all its readings counts, as in Pugh's code for noisy fitness (new
    mean = ((k - 1) mean + reading) / k at the k-th). A robot can measure only where it stands: so a reading counts as
    one of the own best whenever the robot is that near to it, on its way out, when it comes back and while it rests
    there. A best that was sent is corrected by sending it again, for robots that do not keep what they received.

    How a robot knows its motion, speaks of places and moves is its subclasses' part.
    """

    update_every_ticks: int = 100  # steps between two updates of the velocity
    tell_before_ticks: int = 10  # the own best is broadcast so many steps before an update
    inertia: float = 0.7298  # w; w, a and b are Clerc and Kennedy's constriction for phi = 4.1
    own_weight: float = 1.4962  # a: pull of the own best
    neighbour_weight: float = 1.4962  # b: pull of the neighbours' best
    speed_mps: float = 0.1  # straight ahead
    keeps_received: bool = True  # whether received bests count beyond the next update
    again_m: float = 0.0  # a reading so near to the own best is one more of it; 0: the brightest reading counts
    ring_count: int = 0  # robots on the ring; 0: no ring, all who are received are neighbours
    ring_index: PerRobot[int] = per_robot(0)  # of the robot in the arena: its place on the ring
    ring_width: int = 1  # neighbours on each side

    @classmethod
    def check_parameters(cls, params: Mapping[str, Any], robots: int) -> None:
        """Updates are some steps apart, and a ring needs the place of each robot."""
        check_above_zero(params, "update_every_ticks")
        check_ring(cls, params, robots)

    @abstractmethod
    def moved(self, robots: Robots, memory: P) -> Vectors:
        """How far each robot moved since its last step, in m, (n,) each, along the axes of the compass."""

    @abstractmethod
    def send_best(self, robots: Robots, memory: P, rows: BoolArray) -> None:
        """Broadcast the own best."""

    @abstractmethod
    def received_bests(self, robots: Robots) -> Bests:
        """Every best that was received."""

    @abstractmethod
    def head_for_target(self, robots: Robots, memory: P) -> None:
        """Drive on."""

    def step(self, robots: Robots, memory: P) -> None:
        """Look, listen, update or send the best if it is time, and drive on."""
        shift(memory, self.moved(robots, memory))
        look(memory, np.add.reduce(robots.light.value, 1), self.again_m)
        listen(memory, self._of_neighbours(self.received_bests(robots)))
        self._update(robots, memory, memory.steps % self.update_every_ticks == 0)
        self.send_best(robots, memory, (memory.steps + self.tell_before_ticks) % self.update_every_ticks == 0)
        self.head_for_target(robots, memory)
        memory.steps += 1

    def _of_neighbours(self, bests: Bests) -> Bests:
        if self.ring_count == 0:
            return bests
        return bests.of(ring_neighbours(bests.sender, self.ring_index[bests.row], self.ring_count, self.ring_width))

    def _update(self, robots: Robots, memory: P, now: BoolArray) -> None:
        """A new velocity, and with it a new target."""
        if not now.any():
            return
        furthest = self.speed_mps * self.update_every_ticks * robots.period_s
        brighter = memory.best_brightness > memory.own_brightness
        best_x = np.where(brighter, memory.best_x, memory.own_x)
        best_y = np.where(brighter, memory.best_y, memory.own_y)
        x = self._velocity(robots, "x", furthest, memory.steps, memory.velocity_x, memory.own_x, best_x)
        y = self._velocity(robots, "y", furthest, memory.steps, memory.velocity_y, memory.own_y, best_y)
        bounded = np.minimum(1.0, furthest / np.maximum(np.hypot(x, y), 1e-9))
        memory.velocity_x[now] = memory.target_x[now] = (x * bounded)[now]
        memory.velocity_y[now] = memory.target_y[now] = (y * bounded)[now]
        robots.note("to its own best", now & ~brighter)
        robots.note("to the neighbours' best", now & brighter)
        if not self.keeps_received:
            memory.best_brightness[now] = DARK

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
