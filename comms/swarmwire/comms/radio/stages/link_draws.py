"""Keyed draws of links: one draw per purpose for each packet at each receiver."""

from typing import Any, NamedTuple

from swarmwire.comms.base.arrays import KeyArray
from swarmwire.comms.base.draws_compiled import normal, uniform
from swarmwire.comms.base.kernels import kernel


class LinkDraws(NamedTuple):
    """The keys of draws, as input of kernels."""

    keys: KeyArray  # (arenas,)
    robots: int  # robots per arena


@kernel()
def draw_key(draws: Any, links: Any, i: int):
    """Return the key and the counters of draws of link i: the arena's key, sender and receiver index, sequence."""
    sender = links.sender[i]
    arena = sender // draws.robots
    first = arena * draws.robots
    return draws.keys[arena], sender - first, links.receiver[i] - first, links.sequence[i]


@kernel()
def uniform_of_link(draws: Any, links: Any, i: int, draw_purpose: Any):
    """Draw link i's number in [0, 1) for this purpose."""
    key, s, r, sequence = draw_key(draws, links, i)
    return uniform(key, s, r, sequence, draw_purpose)


@kernel()
def normal_of_link(draws: Any, links: Any, i: int, draw_purpose: Any):
    """Draw link i's standard normal number for this purpose."""
    key, s, r, sequence = draw_key(draws, links, i)
    return normal(key, s, r, sequence, draw_purpose)
