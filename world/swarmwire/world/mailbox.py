"""The mailbox: packets, and outcomes of packets, wait here for robots that do not act in every tick."""

import numpy as np

from swarmwire.comms.arrays import BoolArray, IntArray
from swarmwire.comms.packets import NO_OUTCOMES, Heard, Outcomes
from swarmwire.comms.truth import Static


class Mailbox:
    """What robots heard, and learned of their packets, since they last acted.

    Where all act in every tick it passes everything on at no cost.
    """

    def __init__(self, static: Static) -> None:
        self._every: IntArray = np.tile(static.act_every_ticks, static.arenas)  # (rows,)
        self._always = bool((self._every == 1).all())
        self._waiting = Heard.none()
        self._outcomes = NO_OUTCOMES

    def hand_over(self, tick: int, heard: Heard, alive: BoolArray) -> Heard:
        """All that waits for the robots that act in this tick, with what they `heard` since the last tick.

        What waits for a robot that is not `alive` (rows,) is lost with it.
        """
        if self._always:
            return heard
        here = heard.merged(self._waiting) if len(self._waiting) else heard
        acts = (tick % self._every == 0)[here.receiver]
        self._waiting = here.select(np.flatnonzero(~acts & alive[here.receiver])).compacted()
        return here.select(np.flatnonzero(acts))

    def hand_over_outcomes(self, tick: int, outcomes: Outcomes, alive: BoolArray) -> Outcomes:
        """The same of `outcomes`; `alive` is (rows,)."""
        if self._always:
            return outcomes
        here = Outcomes.joined([self._outcomes, outcomes])
        acts = (tick % self._every == 0)[here.row]
        self._outcomes = here.select(np.flatnonzero(~acts & alive[here.row]))
        return here.select(np.flatnonzero(acts))
