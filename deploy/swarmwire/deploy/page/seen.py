"""What the page tells of the swarm as its observer sees it: where the robots are, and how many packets get through."""

from collections import deque
from collections.abc import Sequence
from typing import Any

import numpy as np

from swarmwire.comms.packets import Fate
from swarmwire.comms.run_views import ObservedTick
from swarmwire.comms.truth import EventRecord, Static
from swarmwire.metrics.run_folder.events import names

NAMED = 5  # robots of an event, at most
MAX_WHO = 200  # events; the status tells of no more either
MAX_PLACES = 500  # robots: of more, the small map shows only some


class Seen:
    """The newest glimpse, in numbers. Written by the thread that draws, read by any other."""

    def __init__(self, static: Static) -> None:
        self._rate_hz = static.rate_hz
        self._second: deque[tuple[int, int, int]] = deque()  # tick, received, in range
        self._every = -(-static.robots // MAX_PLACES)
        self._static = static
        self._who: dict[str, str] = {}
        self.numbers: dict[str, Any] = {"centre": None, "places": [], "link_pdr": None, "who": {}}

    def see(self, glimpse: ObservedTick) -> None:
        """Take one more."""
        truth = glimpse.truth
        places, alive = np.asarray(truth.pose)[:, :2], np.asarray(truth.alive)
        living = places[alive]
        shown = slice(None, None, self._every)
        self.numbers = {
            "centre": living.mean(axis=0).round(3).tolist() if len(living) else None,
            "places": [
                [*place, bool(lives)]
                for place, lives in zip(places[shown].round(2).tolist(), alive[shown], strict=True)
            ],
            "link_pdr": self._link_pdr(glimpse),
            "who": self._whom(truth.events),
        }

    def _whom(self, events: Sequence[EventRecord]) -> dict[str, str]:
        """Whom each event changed when it began, by its number."""
        begun = {str(event.serial): whom(event, self._static) for event in events if not event.ended}
        if begun:  # of those that began before, the newest, as the status tells of no others
            self._who = dict([*self._who.items(), *begun.items()][-MAX_WHO:])
        return self._who

    def _link_pdr(self, glimpse: ObservedTick) -> float | None:
        """Received over in range in the last simulated second; None if none was in range."""
        truth = glimpse.truth
        if truth.tally is not None:
            received, in_range = int(truth.tally.fates[:, Fate.RECEIVED].sum()), int(truth.tally.in_range.sum())
            self._second.append((truth.tick, received, in_range))
        while self._second and self._second[0][0] <= truth.tick - self._rate_hz:
            self._second.popleft()
        reached = sum(in_range for _, _, in_range in self._second)
        return sum(received for _, received, _ in self._second) / reached if reached else None


def whom(event: EventRecord, static: Static) -> str:
    """The robots that an event changed, in words."""
    changed = names(event, static)[0]
    if not changed:
        return "nobody"
    if len(changed) == static.robots:
        return "all"
    more = len(changed) - NAMED
    return ", ".join(changed[:NAMED]) + (f" and {more} more" if more > 0 else "")
