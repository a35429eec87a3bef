"""Aggregation: approach received neighbours, wait near them, and leave at random."""

from typing import ClassVar

import numpy as np

from swarmwire.agent import portable
from swarmwire.agent.behaviours.random_walk import (
    Walk,
    begin_spells,
    random_turns,
    spell_ended,
    spell_lengths,
    turns_away,
    walk,
)
from swarmwire.agent.robots import Robots
from swarmwire.agent.vector_agent import IntColumn, VectorAgent, column
from swarmwire.comms.base.arrays import BoolArray, FloatArray
from swarmwire.comms.base.config import parameter
from swarmwire.comms.robot.messages import Message

START, APPROACH, WAIT, REPEL = range(4)  # phases of a robot
NOTES = {APPROACH: "approaches", WAIT: "waits", REPEL: "leaves"}


class Beacon(Message):
    """An empty beacon, broadcast in every step; range and bearing come with its reception."""


class Gathering(Walk):
    """The memory of a walker with a phase."""

    phase: IntColumn = column(START)


class Aggregation(VectorAgent[Gathering]):
    """Robots gather: they approach received neighbours, wait near them, and leave at random, seldom in large groups.

    The three phases and two probabilities of Soysal and Şahin (2005), with avoidance by proximity rays:

        approach   a neighbour is received within near_m                            -> wait
        wait       at the rate leave_per_s / (1 + near neighbours)^crowding         -> repel
        repel      at the rate return_per_s                                         -> approach

    In `approach` a robot drives in spells of `approach_m` along the sum of r / |r| over the neighbours received in the
    last step, in `repel` against it; a robot without packets walks at random. In the paper, robots hear the sound of an
    aggregate instead of beacons, and leave regardless of the number of near neighbours (`crowding = 0`). Only the
    paper's abstract was available: weights, lengths and rates are our choice, and so is the dependence on the number of
    neighbours, as in the aggregation of cockroaches (Jeanson et al. 2005).
    """

    needs: ClassVar[tuple[str, ...]] = ("proximity", "radio.range", "radio.bearing")
    speed_mps: float = parameter(0.1, help="straight ahead")
    near_m: float = parameter(0.15, help="range, centre to centre, within which a neighbour is near")
    leave_per_s: float = parameter(
        0.1, help="rate at which a waiting robot without near neighbours leaves", at_least=0.0
    )
    crowding: float = parameter(2.0, help="exponent of the effect of near neighbours on leaving; 0: no effect")
    return_per_s: float = parameter(1.0, help="rate at which a leaving robot turns back", at_least=0.0)
    approach_m: float = parameter(0.1, help="length of a spell towards or away from neighbours", above=0.0)
    spell_m: float = parameter(1.0, help="mean length of a spell without reception, exponential", above=0.0)
    turn_radps: float = parameter(2.0, help="turn rate on the spot", above=0.0)
    detection_threshold: float = parameter(
        0.1, help="least answer of a ray, 0 to 1, that is an obstacle; above the rays' noise", above=0.0
    )

    def step(self, robots: Robots, memory: Gathering) -> None:
        """Change the phase, walk unless waiting, and broadcast a beacon."""
        received = robots.radio.received(Beacon)
        near_neighbours = received.sum((received.range_m <= self.near_m).astype(np.float64))
        self._change_phase(robots, memory, near_neighbours)

        x, y = received.sum(portable.cos(received.bearing_rad)), received.sum(portable.sin(received.bearing_rad))
        direction = portable.atan2(y, x) + np.where(memory.phase == REPEL, np.pi, 0.0)
        self._walk(robots, memory, received.count() > 0, direction)
        robots.radio.send(Beacon)

    def _change_phase(self, robots: Robots, memory: Gathering, near_neighbours: FloatArray) -> None:
        """Change each robot's phase at most once; a change ends the spell."""
        period_s, before = robots.period_s, memory.phase.copy()
        leave_per_s = self.leave_per_s / portable.power(1.0 + near_neighbours, self.crowding)
        leaves = robots.draw.uniform("leave") < -portable.expm1(-leave_per_s * period_s)
        returns = robots.draw.uniform("return") < -portable.expm1(-self.return_per_s * period_s)
        memory.phase[before == START] = APPROACH
        memory.phase[(before <= APPROACH) & (near_neighbours > 0.0)] = WAIT
        memory.phase[(before == WAIT) & leaves] = REPEL
        memory.phase[(before == REPEL) & returns] = APPROACH
        changed = memory.phase != before
        begin_spells(memory, changed, np.zeros(robots.n), 0.0)
        for phase, note in NOTES.items():
            robots.note(note, (memory.phase == phase) & changed)

    def _walk(self, robots: Robots, memory: Gathering, receives: BoolArray, direction: FloatArray) -> None:
        """Walk along `direction` for robots with packets, at random for others; waiting robots stop."""
        turn = np.where(receives, direction, random_turns(robots, 0.0))
        length = np.where(receives, self.approach_m, spell_lengths(robots, self.spell_m))
        moving = memory.phase != WAIT
        begin_spells(memory, moving & spell_ended(memory), turn, length)
        blocked, away = turns_away(robots, self.detection_threshold)
        begin_spells(memory, moving & blocked & (memory.turn_rad == 0.0), away, length)
        walk(robots, memory, self.speed_mps, self.turn_radps, moving)
