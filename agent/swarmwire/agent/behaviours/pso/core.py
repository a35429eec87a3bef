"""Particle swarm search for a light: the robots are the particles, and the radio is their neighbourhood.

`Particle` is the memory of a robot, with the functions that update it; `ParticleSwarm` is the rule; `ring_neighbours`
is the optional ring topology. `variants.py` measures motion, sends and receives positions, and drives.
"""

from abc import abstractmethod
from collections.abc import Mapping
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np

from swarmwire.agent import portable
from swarmwire.agent.fields import Vectors
from swarmwire.agent.parameters import BadParameter, PerRobot, parameters_of
from swarmwire.agent.robots import Robots
from swarmwire.agent.vector_agent import FloatColumn, IntColumn, Memory, VectorAgent, column
from swarmwire.comms.base.arrays import BoolArray, FloatArray, IntArray
from swarmwire.comms.base.config import parameter
from swarmwire.comms.base.sentinels import NO_ROBOT

DARK = -1.0  # brightness before the first reading or reception, below any light


def ring_neighbours(sender: IntArray, index: IntArray, count: int, width: int) -> BoolArray:
    """Return the mask of senders at most `width` positions from the receiver's `index` on the ring, all (k,)."""
    distance = np.mod(sender - index, count)
    return np.minimum(distance, count - distance) <= width


def check_ring(kind: type, params: Mapping[str, Any], robots: int) -> None:
    """Raise BadParameter unless the robots' indices are on the ring, or there is no ring.

    Defaults are those of the class `kind`.
    """
    declared = parameters_of(kind)
    count, index = (params.get(name, declared[name].default) for name in ("ring_count", "ring_index"))
    is_shared = isinstance(index, int) and robots > 1
    if count > 0 and (is_shared or not np.all((np.array(index) >= 0) & (np.array(index) < count))):
        expected = f"expected a list with the index in the arena of each robot, 0 to {count - 1}"
        raise BadParameter("ring_index", f"{expected}, got {index}")


class Particle(Memory):
    """The memory of a particle; vectors are relative to the robot, in m, along the axes of the compass."""

    steps: IntColumn = column(0)
    personal_brightness: FloatColumn = column(DARK)  # mean of the readings at the personal best
    personal_readings: IntColumn = column(0)  # number of these readings
    personal_x: FloatColumn = column(0.0)
    personal_y: FloatColumn = column(0.0)
    neighbour_brightness: FloatColumn = column(DARK)  # brightest received best
    neighbour_x: FloatColumn = column(0.0)
    neighbour_y: FloatColumn = column(0.0)
    velocity_x: FloatColumn = column(0.0)  # m per update
    velocity_y: FloatColumn = column(0.0)
    target_x: FloatColumn = column(0.0)
    target_y: FloatColumn = column(0.0)


class Bests(NamedTuple):
    """Received bests, (k,) each."""

    row: IntArray  # row of the receiver
    sender: IntArray  # sender's index in the arena
    brightness: FloatArray
    x: FloatArray  # position relative to the receiver, in m, along the axes of the compass
    y: FloatArray

    def select(self, mask: BoolArray) -> "Bests":
        """Return the bests of a mask (k,)."""
        return Bests(self.row[mask], self.sender[mask], self.brightness[mask], self.x[mask], self.y[mask])


def shift(memory: Particle, moved_m: Vectors) -> None:
    """Update relative positions after a motion (n,), along the axes of the compass."""
    memory.personal_x -= moved_m.x
    memory.personal_y -= moved_m.y
    memory.neighbour_x -= moved_m.x
    memory.neighbour_y -= moved_m.y
    memory.target_x -= moved_m.x
    memory.target_y -= moved_m.y


def update_personal_best(memory: Particle, brightness: FloatArray, again_m: float) -> None:
    """Update the personal best by a reading (n,): a brighter position becomes the personal best.

    A reading nearer than `again_m` to the personal best is one more of it: it enters the mean, and the position stays.
    """
    again = (memory.personal_readings > 0) & (portable.hypot(memory.personal_x, memory.personal_y) < again_m)
    memory.personal_readings[again] += 1
    difference = brightness - memory.personal_brightness
    memory.personal_brightness[again] += (difference / np.maximum(memory.personal_readings, 1))[again]
    brighter = ~again & (difference > 0.0)
    memory.personal_brightness[brighter] = brightness[brighter]
    memory.personal_readings[brighter] = 1
    memory.personal_x[brighter] = 0.0
    memory.personal_y[brighter] = 0.0


def update_neighbour_best(memory: Particle, bests: Bests) -> None:
    """Update the neighbours' best by the brightest received best of each row; equal brightness replaces, as newer."""
    order = np.lexsort((bests.brightness, bests.row))
    brightest = order[np.flatnonzero(np.diff(bests.row[order], append=NO_ROBOT))]  # last entry of each row
    brightest = brightest[bests.brightness[brightest] >= memory.neighbour_brightness[bests.row[brightest]]]
    row = bests.row[brightest]
    memory.neighbour_brightness[row] = bests.brightness[brightest]
    memory.neighbour_x[row] = bests.x[brightest]
    memory.neighbour_y[row] = bests.y[brightest]


P = TypeVar("P", bound=Particle)


class ParticleSwarm(VectorAgent[P], Generic[P]):
    """Particle swarm optimization (Kennedy and Eberhart 1995) on robots, as by Pugh and Martinoli (2007).

        v <- w v + a U (personal best - x) + b U (neighbours' best - x),    |v| <= speed x time between updates

    with U uniform in [0, 1), drawn for each term and axis. The personal best is the position of the robot's brightest
    reading; the neighbours' best is the brightest position that it has received or measured. Between two updates the
    robot heads for x + v.

    Neighbours are all robots whose packets are received; with `ring_count` only those next to the robot on a ring of
    indices. A received best counts forever, even if its sender is gone; with `keeps_received = false` until the next
    update, like the query of a neighbourhood in a computer's particle swarm.

    By default the personal best is the brightest reading, so one reading with a large error stays forever. With
    `again_m` the mean of all readings at the personal best counts, as in Pugh's code for noisy fitness (new mean =
    ((k - 1) mean + reading) / k at the k-th reading). A robot can measure only at its own position: any reading within
    `again_m` of the personal best counts as one of it. Sending a best again corrects it at robots that do not keep what
    they received.

    Subclasses measure the motion, send and receive bests, and drive.
    """

    update_every_ticks: int = parameter(100, help="steps between two updates of the velocity", above=0)
    tell_before_ticks: int = parameter(10, help="steps from the broadcast of the personal best to the update")
    inertia: float = parameter(
        0.7298, help="weight w of the velocity; w, a and b are Clerc and Kennedy's constriction for phi = 4.1"
    )
    own_weight: float = parameter(1.4962, help="weight a of the personal best")
    neighbour_weight: float = parameter(1.4962, help="weight b of the neighbours' best")
    speed_mps: float = parameter(0.1, help="straight ahead")
    keeps_received: bool = parameter(True, help="received bests count beyond the next update")
    again_m: float = parameter(
        0.0, help="distance from the personal best within which readings enter its mean; 0: no mean"
    )
    ring_count: int = parameter(
        0, help="robots on the ring; 0: no ring, all received robots are neighbours", at_least=0
    )
    ring_index: PerRobot[int] = parameter(0, help="index of the robot in the arena, its position on the ring")
    ring_width: int = parameter(1, help="neighbours on each side", at_least=1)

    @classmethod
    def check_parameters(cls, params: Mapping[str, Any], robots: int) -> None:
        """Refuse a malformed ring."""
        check_ring(cls, params, robots)

    @abstractmethod
    def moved(self, robots: Robots, memory: P) -> Vectors:
        """Return the motion of each robot since its last step, in m, (n,), along the axes of the compass."""

    @abstractmethod
    def send_best(self, robots: Robots, memory: P, rows: BoolArray) -> None:
        """Broadcast the personal bests of the robots in the mask `rows`."""

    @abstractmethod
    def received_bests(self, robots: Robots) -> Bests:
        """Return all received bests."""

    @abstractmethod
    def head_for_target(self, robots: Robots, memory: P) -> None:
        """Drive towards the target."""

    def step(self, robots: Robots, memory: P) -> None:
        """Update both bests; update the velocity or send the personal best if due; drive towards the target."""
        shift(memory, self.moved(robots, memory))
        update_personal_best(memory, portable.ordered_sum(robots.light.value), self.again_m)
        update_neighbour_best(memory, self._from_neighbours(self.received_bests(robots)))
        self._update(robots, memory, memory.steps % self.update_every_ticks == 0)
        self.send_best(robots, memory, (memory.steps + self.tell_before_ticks) % self.update_every_ticks == 0)
        self.head_for_target(robots, memory)
        memory.steps += 1

    def _from_neighbours(self, bests: Bests) -> Bests:
        """Return the bests of neighbours on the ring, all without a ring."""
        if self.ring_count == 0:
            return bests
        return bests.select(ring_neighbours(bests.sender, self.ring_index[bests.row], self.ring_count, self.ring_width))

    def _update(self, robots: Robots, memory: P, due: BoolArray) -> None:
        """Set a new velocity and target for the robots in the mask `due`."""
        if not due.any():
            return
        max_step_m = self.speed_mps * self.update_every_ticks * robots.period_s
        brighter = memory.neighbour_brightness > memory.personal_brightness
        best_x = np.where(brighter, memory.neighbour_x, memory.personal_x)
        best_y = np.where(brighter, memory.neighbour_y, memory.personal_y)
        x = self._velocity(robots, "x", max_step_m, memory.steps, memory.velocity_x, memory.personal_x, best_x)
        y = self._velocity(robots, "y", max_step_m, memory.steps, memory.velocity_y, memory.personal_y, best_y)
        scale = np.minimum(1.0, max_step_m / np.maximum(portable.hypot(x, y), 1e-9))
        memory.velocity_x[due] = memory.target_x[due] = (x * scale)[due]
        memory.velocity_y[due] = memory.target_y[due] = (y * scale)[due]
        robots.note("to its own best", due & ~brighter)
        robots.note("to the neighbours' best", due & brighter)
        if not self.keeps_received:
            memory.neighbour_brightness[due] = DARK

    def _velocity(
        self,
        robots: Robots,
        axis: str,
        max_step_m: float,
        steps: IntArray,
        velocity: FloatArray,
        personal_best: FloatArray,
        neighbour_best: FloatArray,
    ) -> FloatArray:
        """Apply the rule along one axis; the first velocity is random."""
        attraction = self.own_weight * robots.draw.uniform(f"own {axis}") * personal_best
        attraction += self.neighbour_weight * robots.draw.uniform(f"neighbours {axis}") * neighbour_best
        first = robots.draw.uniform(f"first {axis}", -max_step_m, max_step_m)
        return np.where(steps == 0, first, self.inertia * velocity + attraction)
