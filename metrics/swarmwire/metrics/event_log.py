"""The events of a run: what happened when, and to which robots."""

from typing import Any

import numpy as np

from swarmwire.comms.interfaces import Observer
from swarmwire.comms.truth import EventRecord, PacketCounts, Static, Truth


class EventLog(Observer):
    """Observer that keeps what happened. Summary part: `events`, in order.

    Each: at_s (of the scenario; of what happens singly, the tick's start), tick (in which it took effect), do, part
    (that fails, else empty), ended (whether it was undone then), singly (each robot at a time of its own) and robots:
    the names of those it changed, a list per arena.
    """

    def begin(self, static: Static) -> None:
        """Start afresh."""
        self._static = static
        self._events: list[dict[str, Any]] = []

    def see(self, truth: Truth) -> None:
        """Add what happened in a tick."""
        for event in truth.events:
            robots = names(event, self._static)
            self._events.append(
                {
                    "at_s": event.at_s,
                    "tick": truth.tick,
                    "do": event.do,
                    "part": event.part,
                    "ended": event.ended,
                    "singly": event.singly,
                    "robots": robots,
                }
            )

    def end(self, last: PacketCounts | None) -> dict[str, Any]:
        """The events so far."""
        return {"events": self._events}


def names(event: EventRecord, static: Static) -> list[list[str]]:
    """The names of the robots that an event changed, a list per arena."""
    changed = event.changed.reshape(static.arenas, static.robots)
    return [[static.robot_names[index] for index in np.flatnonzero(own)] for own in changed]
