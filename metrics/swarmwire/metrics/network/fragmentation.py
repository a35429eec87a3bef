"""Fragmentation: when the radio graph of a swarm falls apart, and when it is whole again.

    whole     components > 1      -> split    (since this tick)
    split     components = 1      -> whole
    split     for hold_s          -> event    (counted once, in this tick)
    event     components = 1      -> whole    (re-joined: its length is known)

A swarm that starts in pieces has not fallen apart: it is no event until it was whole once. While no robot is alive
nothing changes, and without a radio there are no events at all.
"""

# pyright: basic, reportUnknownMemberType=false

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.arrays import BoolArray, IntArray
from swarmwire.comms.clock import NS_PER_S, to_ns
from swarmwire.comms.config import parameter
from swarmwire.comms.kernels import njit
from swarmwire.comms.truth import Static
from swarmwire.metrics.metric import Metric
from swarmwire.metrics.moment import Moment

NEVER = -1


@dataclass(frozen=True)
class OfFragmentation(Metric):
    """A metric of fragmentation events."""

    hold_s: float = parameter(1.0, help="a shorter split is no event", unit="s", at_least=0.0)


class Fragmentation:
    """The events of each arena so far. `see` must be called once per tick.

    Attributes:
        started: (arenas,) events counted so far.
        rejoined: (arenas,) of these, that are over.
        rejoined_s: by arena, how long each event lasted that is over, in order.
        rejoined_now: the arenas of which an event was over in the last tick.
    """

    def __init__(self, static: Static, hold_s: float) -> None:
        arenas = static.arenas
        self._hold_ns = to_ns(hold_s)
        self.started: IntArray = np.zeros(arenas, np.int64)
        self.rejoined: IntArray = np.zeros(arenas, np.int64)
        self.rejoined_s: list[list[float]] = [[] for _ in range(arenas)]
        self.rejoined_now: list[int] = []
        self._was_whole: BoolArray = np.zeros(arenas, np.bool_)
        self._since_ns: IntArray = np.full(arenas, NEVER, np.int64)  # start of the present split
        self._event: BoolArray = np.zeros(arenas, np.bool_)  # it was counted

    def see(self, moment: Moment) -> IntArray | None:
        """How many events, 0 or 1, are counted in this tick, (arenas,); None without a radio."""
        self.rejoined_now, found = [], moment.components
        if found is None:
            return None
        counted, lasted_ns = np.zeros_like(self.started), np.full_like(self.started, NEVER)
        state = self._was_whole, self._since_ns, self._event
        if _follow(found.pieces, moment.truth.time_ns, self._hold_ns, *state, counted, lasted_ns):
            self.rejoined_now = np.flatnonzero(lasted_ns != NEVER).tolist()
            self.rejoined[self.rejoined_now] += 1
            for arena in self.rejoined_now:
                self.rejoined_s[arena].append(int(lasted_ns[arena]) / NS_PER_S)
        self.started += counted
        return counted


@njit()
def _follow(pieces, now_ns, hold_ns, was_whole, since_ns, event, counted, lasted_ns):
    """The table above for each arena: sets `counted`, and `lasted_ns` where an event is over; whether any is."""
    any_over = False
    for arena in range(len(pieces)):
        if pieces[arena] == 1:
            if event[arena]:
                lasted_ns[arena] = now_ns - since_ns[arena]
                any_over = True
            was_whole[arena], since_ns[arena], event[arena] = True, NEVER, False
        elif pieces[arena] > 1 and was_whole[arena]:
            if since_ns[arena] == NEVER:
                since_ns[arena] = now_ns
            if not event[arena] and now_ns - since_ns[arena] >= hold_ns:
                event[arena], counted[arena] = True, 1
    return any_over
