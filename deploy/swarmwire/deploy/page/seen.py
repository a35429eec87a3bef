"""What the page tells of the swarm as its observer sees it: where the robots are, and how many packets get through."""

from collections import deque
from typing import Any

import numpy as np

from swarmwire.comms.fates import Fate
from swarmwire.comms.glimpse import Glimpse
from swarmwire.comms.truth import Static

MOST_PLACES = 500  # robots: of more, the small map shows only some


class Seen:
    """The newest glimpse, in numbers. Written by the thread that draws, read by any other."""

    def __init__(self, static: Static) -> None:
        self._rate_hz = static.rate_hz
        self._second: deque[tuple[int, int, int]] = deque()  # tick, heard, in range
        self._every = -(-static.robots // MOST_PLACES)
        self.numbers: dict[str, Any] = {"centre": None, "places": [], "pdr": None}

    def see(self, glimpse: Glimpse) -> None:
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
            "pdr": self._pdr(glimpse),
        }

    def _pdr(self, glimpse: Glimpse) -> float | None:
        """Heard over in range in the last simulated second; None if none was in range."""
        truth = glimpse.truth
        if truth.tally is not None:
            heard, in_range = int(truth.tally.fates[:, Fate.HEARD].sum()), int(truth.tally.in_range.sum())
            self._second.append((truth.tick, heard, in_range))
        while self._second and self._second[0][0] <= truth.tick - self._rate_hz:
            self._second.popleft()
        reached = sum(in_range for _, _, in_range in self._second)
        return sum(heard for _, heard, _ in self._second) / reached if reached else None
