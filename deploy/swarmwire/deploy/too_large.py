"""A packet that can never be sent is the agent's mistake, and people are told of the first."""

from collections.abc import Callable

import numpy as np

from swarmwire.comms.interfaces import Observer
from swarmwire.comms.packets import Fate
from swarmwire.comms.truth import Static, Truth


class TooLarge(Observer):
    """Observer that tells once of a packet above the medium's largest payload."""

    def __init__(self, say: Callable[[str], None]) -> None:
        self._say = say
        self._told = False

    def begin(self, static: Static) -> None:
        """The run is about to start."""
        self._names = static.robot_names

    def see(self, truth: Truth) -> None:
        """Tell of the first one."""
        if self._told or truth.finished is None or truth.tally is None:
            return
        if truth.tally.fates[:, Fate.TOO_LARGE].any():
            finished, self._told = truth.finished, True
            first = np.flatnonzero(finished.fate == Fate.TOO_LARGE)[0]
            who, size_bytes = self._names[finished.sender[first]], finished.size_bytes[first]
            self._say(f"{who} sent {size_bytes} bytes, more than radio.max_payload_bytes: never on air (too_large)")
