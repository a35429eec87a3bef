"""Kept order: packets of a link are heard in the order in which they went on air, whatever their delays.

What counts of the past are receptions that are still to come: they are all among the links that the air keeps, so
that there is no state beside these. A reception that an event has ended holds up nothing.
"""

# pyright: basic, reportUnknownMemberType=false

import numpy as np
from numba import njit

from swarmwire.comms.air.links import HEARD, THE_REST, Links


def wait_for_earlier(links: Links, first: int, rows: int) -> None:
    """Rows of `links` from `first` on become final no sooner than their link's earlier ones; in place.

    `rows` are the robots of all arenas. Those before `first` have waited already, and are not changed.
    """
    heard = np.flatnonzero((links.fate == HEARD) & (links.receiver != THE_REST))
    link = links.sender[heard] * rows + links.receiver[heard]
    # A sender's packets have their numbers in the order in which they go on air.
    order = heard[np.lexsort((links.sequence[heard], link))]
    _wait(links.sender, links.receiver, links.final_at_ns, order, first)


@njit(cache=True)
def _wait(sender, receiver, final_at_ns, order, first):
    for i in range(1, len(order)):
        before, now = order[i - 1], order[i]
        if now >= first and sender[now] == sender[before] and receiver[now] == receiver[before]:
            final_at_ns[now] = max(final_at_ns[now], final_at_ns[before])
