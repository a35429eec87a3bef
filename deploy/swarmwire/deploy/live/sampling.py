"""Which part of a run is shown: so many ticks a second of wall time, and of large swarms fewer links and sensors.

What adds up from tick to tick (counts of packets, contacts, events) is shown in full with the next tick that is; of the
links that ended, those of that tick alone. Tallies over several ticks are shown as of one, since plots count in ticks.
"""

from dataclasses import dataclass, replace

import numpy as np

from swarmwire.comms.arrays import FloatArray, IntArray
from swarmwire.comms.clock import NS_PER_S
from swarmwire.comms.run_views import ObservedTick, readings_within, truth_of
from swarmwire.comms.truth import PacketCounts, Static, Truth

FRAMES_PER_S = 30
LINKS_PER_S = 5  # in large swarms, where links are most of a frame
FEW = 200  # robots: up to so many, links come with every frame
SMALL = 50  # robots: up to so many, everybody's sensors are shown; of more, those of one
MAX_FINISHED = 2000  # packets that ended in a tick: up to so many are shown, of more none


@dataclass(slots=True)
class Rate:
    """Something that may be done so many times a second."""

    per_s: int
    next_ns: int = 0

    def due(self, now_ns: int) -> bool:
        """Whether it may be done now; if so, the next time is counted from now."""
        if now_ns < self.next_ns:
            return False
        self.next_ns = now_ns + NS_PER_S // self.per_s
        return True


class Since:
    """The ticks since the one that was shown last."""

    def __init__(self) -> None:
        self.ticks = 0
        self._together: Truth | None = None

    def add(self, truth: Truth) -> None:
        """One more."""
        self.ticks += 1
        before = self._together
        if before is None:
            self._together = truth
            return
        tally = before.tally and truth.tally and before.tally + truth.tally
        onsets, events = before.contact_onsets + truth.contact_onsets, before.events + truth.events
        self._together = replace(truth, tally=tally, contact_onsets=onsets, events=events)

    def take(self) -> tuple[Truth, int]:
        """The last of them with what adds up over all, and how many; from here on it is the next ones."""
        together, ticks = self._together, self.ticks
        if together is None:
            raise ValueError("expected a tick")
        self.ticks, self._together = 0, None
        return together, ticks


class Sampling:
    """Glimpses of one arena, out of the ticks of all."""

    def __init__(self, static: Static, arena: int, selected: str) -> None:
        """Show this arena, and of a large swarm the sensors of the robot `selected`."""
        self._static, self._arena = static, arena
        self._serial = 0
        self._links = Rate(LINKS_PER_S)
        self._selected = static.robot_names.index(selected)

    def glimpse(self, truth: Truth, ticks: int, values: FloatArray, now_ns: int) -> ObservedTick:
        """What is shown of a tick; `values` (series, arenas) were measured in it."""
        static = self._static
        links = static.robots <= FEW or self._links.due(now_ns)
        shown = truth_of(truth, static, self._arena)
        few = shown.finished is not None and len(shown.finished.fate) <= MAX_FINISHED
        shown = replace(shown, edges=shown.edges if links else None, finished=shown.finished if few else None)
        if static.robots > SMALL:
            shown = replace(shown, readings=readings_within(shown.readings, slice(self._selected, self._selected + 1)))
        self._serial += 1
        return ObservedTick(shown, self._serial - 1, ticks, values[:, self._arena : self._arena + 1])


class Evened:
    """Mean tallies per tick in whole numbers: what rounding leaves over comes with a later one."""

    def __init__(self) -> None:
        self._owed: FloatArray | None = None

    def per_tick(self, tally: PacketCounts, ticks: int) -> PacketCounts:
        """The tally of one of these ticks."""
        counts: IntArray = np.vstack([tally.sent, tally.intended, tally.in_range, tally.fates.T])
        owed = counts / ticks + (0.0 if self._owed is None else self._owed)
        whole = np.floor(owed + 1e-9).astype(np.int64)  # thirds add up to a little less than one
        self._owed = owed - whole
        return PacketCounts(whole[0], whole[1], whole[2], whole[3:].T)
