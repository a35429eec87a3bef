"""Aggregation: approach received neighbours, wait next to them, and leave again by chance."""

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from swarmwire.agent.behaviours._common import check_above_zero, check_not_negative
from swarmwire.agent.behaviours.random_walk import (
    Walk,
    begin_spells,
    ended,
    spell_lengths,
    turns_at_random,
    turns_away,
    walk_on,
)
from swarmwire.agent.robots import Robots
from swarmwire.agent.vector_agent import IntColumn, VectorAgent, column
from swarmwire.comms.base.arrays import BoolArray, FloatArray
from swarmwire.comms.robot.messages import Message

START, APPROACH, WAIT, REPEL = range(4)
NAMES = {APPROACH: "approaches", WAIT: "waits", REPEL: "leaves"}


class Beacon(Message):
    """What an aggregating robot broadcasts in every step: its presence. Range and bearing give its place."""


class Gathering(Walk):
    """A walker, and its state."""

    at: IntColumn = column(START)


class Aggregation(VectorAgent[Gathering]):
    """Robots gather: they approach received neighbours, wait when near, and leave by chance, less with more near.

    The three states and two probabilities of Soysal and Sahin (2005), beside avoidance by rays:

        approach   a neighbour is received within near_m                               -> wait
        wait       with probability leave_per_s / (1 + neighbours near)^crowding    -> repel    (per second)
        repel      with probability return_per_s                                    -> approach (per second)

    Approaching, a robot goes in spells of `approach_m` along the sum of r / |r| over the neighbours received in the
    last step, repelled against it; a robot without packets walks at random. The source's robots hear an aggregate's
    sound where ours receive beacons, and they leave regardless of the number near: that is `crowding = 0`. We had only
    its abstract at hand: weights, lengths and rates are our choice, and so is the number, of which the leaving of
    cockroaches depends (Jeanson et al. 2005).
    """

    needs: ClassVar[tuple[str, ...]] = ("proximity", "radio.range", "radio.bearing")
    speed_mps: float = 0.1  # straight ahead
    near_m: float = 0.15  # a neighbour received from so near, centre to centre, is company to wait with
    leave_per_s: float = 0.1  # rate at which a waiting robot without near neighbours leaves
    crowding: float = 2.0  # effect of near neighbours on leaving: 0 none
    return_per_s: float = 1.0  # rate at which a robot that leaves turns back
    approach_m: float = 0.1  # length of a spell towards or away from neighbours
    spell_m: float = 1.0  # mean length of a spell without reception, exponential
    turn_radps: float = 2.0  # turn rate, on the spot
    detection_threshold: float = (
        0.1  # detection threshold of a ray's answer, 0 to 1; above the noise of the bodies' rays
    )

    @classmethod
    def check_parameters(cls, params: Mapping[str, Any], robots: int) -> None:
        """Spells and turns end, and no rate is negative."""
        check_above_zero(params, "spell_m", "approach_m", "turn_radps", "detection_threshold")
        check_not_negative(params, "leave_per_s", "return_per_s")

    def step(self, robots: Robots, memory: Gathering) -> None:
        """Change the state, walk unless waiting, and broadcast."""
        received = robots.radio.received(Beacon)
        near = received.sum((received.range_m <= self.near_m).astype(np.float64))
        self._change(robots, memory, near)

        x, y = received.sum(np.cos(received.bearing_rad)), received.sum(np.sin(received.bearing_rad))
        towards = np.arctan2(y, x) + np.where(memory.at == REPEL, np.pi, 0.0)
        self._walk(robots, memory, received.count() > 0, towards)
        robots.radio.send(Beacon)

    def _change(self, robots: Robots, memory: Gathering, near: FloatArray) -> None:
        """Change states by those at the start of the step; a change ends the spell."""
        period_s, before = robots.period_s, memory.at.copy()
        leave = self.leave_per_s / (1.0 + near) ** self.crowding
        leaves = robots.draw.uniform("leave") < -np.expm1(-leave * period_s)
        returns = robots.draw.uniform("return") < -np.expm1(-self.return_per_s * period_s)
        memory.at[before == START] = APPROACH
        memory.at[(before <= APPROACH) & (near > 0.0)] = WAIT
        memory.at[(before == WAIT) & leaves] = REPEL
        memory.at[(before == REPEL) & returns] = APPROACH
        begin_spells(memory, memory.at != before, np.zeros(robots.n), 0.0)
        for at, name in NAMES.items():
            robots.note(name, (memory.at == at) & (memory.at != before))

    def _walk(self, robots: Robots, memory: Gathering, receives: BoolArray, towards: FloatArray) -> None:
        """A spell along `towards` for robots with packets, at random for others; waiting robots stand."""
        turn = np.where(receives, towards, turns_at_random(robots, 0.0))
        length = np.where(receives, self.approach_m, spell_lengths(robots, self.spell_m))
        walks = memory.at != WAIT
        begin_spells(memory, walks & ended(memory), turn, length)
        blocked, away = turns_away(robots, self.detection_threshold)
        begin_spells(memory, walks & blocked & (memory.turn_rad == 0.0), away, length)
        walk_on(robots, memory, self.speed_mps, self.turn_radps, walks)
