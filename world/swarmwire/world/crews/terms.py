"""On what terms runners join a run: what they are offered, whether they may come late, and how many."""

from collections.abc import Mapping
from dataclasses import dataclass

from swarmwire.comms.wire.agent_memory import Layout
from swarmwire.comms.wire.join import LIMITS, Limits, Offer


@dataclass(frozen=True)
class Terms:
    """What a world asks of its runners.

    Attributes:
        offer: what there is to play; None: nothing is told, and no agent is compared.
        open: whether runners come from elsewhere and when they like: nobody is waited for in vain, and who leaves
            before the first tick only frees its robots.
        start_with: robots with an agent that are enough for the first tick; None: all.
        limits: how many runners, how many robots of each, and how long they may take.
        memory: by group, what is kept of its robots for whoever plays them next; None: nothing is.
    """

    offer: Offer | None = None
    open: bool = False
    start_with: int | None = None
    limits: Limits = LIMITS
    memory: Mapping[str, Layout] | None = None


USUAL = Terms()  # of runners that the run starts itself
