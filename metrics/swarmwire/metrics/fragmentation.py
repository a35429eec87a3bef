"""Fragmentation: when the radio graph of a swarm falls apart, and when it is whole again.

    whole     components > 1      -> split    (since this tick)
    split     components = 1      -> whole
    split     for hold_s          -> event    (counted once, in this tick)
    event     components = 1      -> whole    (re-joined: its length is known)

A swarm that starts in pieces has not fallen apart: it is no event until it was whole once. While no robot is alive
nothing changes, and without a radio there are no events at all.
"""

from dataclasses import dataclass, field

import numpy as np

from swarmwire.comms.arrays import BoolArray, FloatArray, IntArray
from swarmwire.comms.clock import NS_PER_S, to_ns
from swarmwire.comms.parameters import parameter
from swarmwire.comms.truth import Static
from swarmwire.metrics.metric import Metric
from swarmwire.metrics.moment import Moment

NEVER = -1


@dataclass(frozen=True)
class OfFragmentation(Metric):
    """A metric of fragmentation events."""

    hold_s: float = parameter(1.0, help="a shorter split is no event", unit="s", at_least=0.0)


@dataclass
class Fragmentation:
    """The events of each arena so far. `see` must be called once per tick."""

    static: Static
    hold_s: float
    rejoined_s: list[list[float]] = field(init=False)  # by arena: length of each event that is over, in order
    started: IntArray = field(init=False)  # (arenas,) events counted so far

    def __post_init__(self) -> None:
        arenas = self.static.arenas
        self.rejoined_s = [[] for _ in range(arenas)]
        self.started = np.zeros(arenas, np.int64)
        self._was_whole: BoolArray = np.zeros(arenas, np.bool_)
        self._since_ns: IntArray = np.full(arenas, NEVER, np.int64)  # start of the present split
        self._event: BoolArray = np.zeros(arenas, np.bool_)  # it was counted

    def see(self, moment: Moment) -> BoolArray:
        """In which arenas an event is counted in this tick, (arenas,)."""
        found, now_ns = moment.components, moment.truth.time_ns
        if found is None:
            return np.zeros_like(self._event)
        pieces = np.bincount(found.arena, minlength=self.static.arenas)
        for arena in np.flatnonzero(self._event & (pieces == 1)).tolist():
            self.rejoined_s[arena].append((now_ns - int(self._since_ns[arena])) / NS_PER_S)
        self._was_whole |= pieces == 1
        self._event &= pieces != 1
        self._since_ns[pieces == 1] = NEVER
        self._since_ns[(pieces > 1) & self._was_whole & (self._since_ns == NEVER)] = now_ns
        held = (self._since_ns != NEVER) & (now_ns - self._since_ns >= to_ns(self.hold_s))
        counted = held & ~self._event & (pieces > 1)
        self._event |= counted
        self.started += counted
        return counted

    def of_rejoined(self, statistic: str) -> FloatArray:
        """The median or max of the lengths in s of each arena's events that are over, NaN before the first."""
        pick = {"median": np.median, "max": np.max}[statistic]
        return np.array([pick(lengths) if lengths else np.nan for lengths in self.rejoined_s], np.float64)
