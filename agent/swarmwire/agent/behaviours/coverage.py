"""Coverage: a random walk that leads away from the neighbours heard."""

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from swarmwire.agent.behaviours.limits import check_above_zero
from swarmwire.agent.behaviours.random_walk import spell_lengths, turns_at_random
from swarmwire.agent.behaviours.walking import Walk, begin_spells, ended, turns_away, walk_on
from swarmwire.agent.robots import Robots
from swarmwire.agent.vector_agent import VectorAgent
from swarmwire.comms.messages import Message


class Present(Message):
    """What a covering robot broadcasts in every step: that it is there. Range and bearing tell where."""


class Coverage(VectorAgent[Walk]):
    """Robots spread, and sweep what is between them: a random walk that neighbours heard push away.

    Neighbours push as in the potential field of Howard, Mataric and Sukhatme (2002), which spreads a network of sensors
    over a building and then rests. To go on sweeping, ours turns the directions of a random walk by that push: at the
    end of a spell, the next heading is that of

        u - repulsion_m2 sum of r / |r|^3,    u a unit vector at random, r from the robot to each neighbour heard

    over the packets of the last step alone: there is no memory of who was where. Who hears nobody walks as `RandomWalk`
    does. Walls push by rays instead of by a field: the next heading is uniform over the half circle away from them.
    The source's viscous friction, which ends the motion, is left out.
    """

    needs: ClassVar[tuple[str, ...]] = ("proximity", "radio.range", "radio.bearing")
    speed_mps: float = 0.1  # straight ahead
    spell_m: float = 2.0  # mean length of a spell, exponential
    repulsion_m2: float = 1.0  # a neighbour at the root of this, in m, pushes as much as chance
    nearest_m: float = 0.1  # who is nearer than this pushes as if it were not
    turn_radps: float = 2.0  # turn rate, on the spot
    faint: float = 0.1  # least answer of a ray, 0 to 1, to a thing; above the noise of the bodies' rays

    @classmethod
    def check_parameters(cls, params: Mapping[str, Any], robots: int) -> None:
        """Spells end, turns too, and nobody pushes without bound."""
        check_above_zero(params, "spell_m", "nearest_m", "turn_radps", "faint")

    def step(self, robots: Robots, state: Walk) -> None:
        """On with the spell, or with the turn to the next; and be heard."""
        heard = robots.radio.heard(Present)
        push = self.repulsion_m2 / np.maximum(heard.range_m, self.nearest_m) ** 2
        chance = turns_at_random(robots, 0.0)
        x = np.cos(chance) - heard.sum(push * np.cos(heard.bearing_rad))
        y = np.sin(chance) - heard.sum(push * np.sin(heard.bearing_rad))

        length = spell_lengths(robots, self.spell_m)
        begin_spells(state, ended(state), np.arctan2(y, x), length)
        blocked, away = turns_away(robots, self.faint)
        begin_spells(state, blocked & (state.turn_rad == 0.0), away, length)
        walk_on(robots, state, self.speed_mps, self.turn_radps)
        robots.radio.send(Present)
