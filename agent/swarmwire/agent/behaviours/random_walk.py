"""Random walk: straight spells, and turns at random between them."""

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from swarmwire.agent.behaviours.limits import check_above_zero, check_share
from swarmwire.agent.behaviours.walking import Walk, begin_spells, ended, turns_away, walk_on
from swarmwire.agent.robots import Robots
from swarmwire.agent.vector_agent import VectorAgent
from swarmwire.comms.arrays import FloatArray


class RandomWalk(VectorAgent[Walk]):
    """Straight spells, turns at random between them, and a turn away from what is in the way.

    The length of a spell is exponential of mean `spell_m`, or always that. The turn is from the wrapped Cauchy
    distribution, of which `persistence` is the mean cosine:

        turn = 2 atan((1 - persistence) / (1 + persistence) tan(pi (U - 1/2))),    U uniform in [0, 1)

    0 is run and tumble, each direction as likely as any other; 1 goes on for ever. It is the correlated random walk of
    animals (Codling, Plank and Benhamou 2008) and of kilobots (Dimidov, Oriolo and Trianni 2016). What rays of the
    front half see ends a spell: the next heading is uniform over the half circle away from it, which is our choice.
    """

    needs: ClassVar[tuple[str, ...]] = ("proximity",)
    speed_mps: float = 0.1  # straight ahead
    spell_m: float = 1.0  # mean length of a spell
    exponential: bool = True  # lengths are exponential; false: all are spell_m
    persistence: float = 0.0  # mean cosine of the turn between two spells, 0 to 1
    turn_radps: float = 2.0  # turn rate, on the spot
    faint: float = 0.1  # least answer of a ray, 0 to 1, to a thing; above the noise of the bodies' rays

    @classmethod
    def check_parameters(cls, params: Mapping[str, Any], robots: int) -> None:
        """Spells end, and turns too."""
        check_above_zero(params, "spell_m", "turn_radps", "faint")
        check_share(params, "persistence")

    def step(self, robots: Robots, state: Walk) -> None:
        """On with the spell, or with the turn to the next."""
        length = spell_lengths(robots, self.spell_m, self.exponential)
        begin_spells(state, ended(state), turns_at_random(robots, self.persistence), length)
        blocked, away = turns_away(robots, self.faint)
        begin_spells(state, blocked & (state.turn_rad == 0.0), away, length)
        walk_on(robots, state, self.speed_mps, self.turn_radps)


def spell_lengths(robots: Robots, mean_m: float, exponential: bool = True) -> FloatArray:
    """A length for a new spell of each robot, (n,)."""
    unit = robots.draw.uniform("spell")
    return -mean_m * np.log1p(-unit) if exponential else np.full(robots.n, mean_m)


def turns_at_random(robots: Robots, persistence: float) -> FloatArray:
    """Turns from the wrapped Cauchy distribution of this mean cosine, (n,)."""
    half = robots.draw.uniform("turn", -0.5 * np.pi, 0.5 * np.pi)
    return 2.0 * np.arctan2((1.0 - persistence) * np.sin(half), (1.0 + persistence) * np.cos(half))
