"""The air of a loop whose crew takes its time: packets are put on it, and heard, also in the middle of a tick.

    a tick begins    `begin`      what became final since the last tick, for observers; what of it nobody was handed yet
    it goes on       `send`       packets come: those of a step wait for their robot's turn, others go out at once
                     `advance`    what is heard is handed over when it is due

When which part of a packet's way is asked for changes nothing of it; so a run is repeated from what came in, and when.
"""

from collections.abc import Callable

import numpy as np

from swarmwire.comms.air.air import Air
from swarmwire.comms.air.news import News
from swarmwire.comms.arrays import BoolArray
from swarmwire.comms.clock import tick_start_ns
from swarmwire.comms.in_time import Put
from swarmwire.comms.outcomes import Outcomes
from swarmwire.comms.packets import Heard, Sent
from swarmwire.comms.truth import Static

NEVER_NS = 2**63 - 1


class AirInTime:
    """An air between `begin` of one tick and that of the next."""

    def __init__(self, air: Air, static: Static, addressable: Callable[[Sent], Sent]) -> None:
        """`addressable` makes packets fit for the air, and counts what was wrong with them."""
        self._air, self._static, self._addressable = air, static, addressable
        self._waiting, self._turn_ns = Sent.none(), np.empty(0, np.int64)  # (k,) until their robots' turn comes
        self._now_ns = 0

    def begin(self, start_ns: int) -> tuple[News, Heard, Outcomes]:
        """Let the tick end that is under way; what became final in it, and what of that was not handed over."""
        self._release(start_ns)
        self._now_ns = start_ns
        # What has been heard by now was heard, also by who dies now: as if it had been handed over in the tick.
        heard, outcomes = self._air.advance_within(start_ns)
        return self._air.advance(start_ns), heard, outcomes

    def send(self, put: Put) -> None:
        """Take packets that came no sooner than those before them, and within the tick."""
        if not len(put.sent):
            return
        at_ns = max(put.at_ns, self._now_ns)
        sent = self._addressable(put.sent)
        turn_ns = np.full(len(sent), at_ns)
        if put.tick is not None:
            start_ns = tick_start_ns(put.tick, self._static.rate_hz)
            turn_ns = np.maximum(turn_ns, self._air.turns(start_ns, put.tick)[sent.sender])
        self._waiting = Sent.joined([self._waiting, sent]) if len(self._waiting) else sent
        self._turn_ns = np.concatenate((self._turn_ns, turn_ns))
        self._release(at_ns)

    def advance(self, until_ns: int) -> tuple[Heard, Outcomes]:
        """Let time pass; what robots heard, and learned of their packets, that nobody was handed before."""
        self._release(until_ns)
        self._now_ns = until_ns
        return self._air.advance_within(until_ns)

    def leave(self, over: BoolArray) -> None:
        """The arenas (arenas,) are over: what waits there for a turn is the air's to end."""
        self._release(NEVER_NS, over)

    def end(self) -> None:
        """The run is over: what waits for a turn is the air's to end."""
        self._release(NEVER_NS)

    def _release(self, until_ns: int, arenas: BoolArray | None = None) -> None:
        """Hand to the radios what robots, of these arenas (arenas,), send until then, in the order of their turns."""
        while (due := np.flatnonzero(self._turn_ns <= until_ns)).size:
            if arenas is not None:
                due = due[arenas[self._waiting.sender[due] // self._static.robots]]
                if not due.size:
                    return
            sender, turn_ns = self._waiting.sender[due], self._turn_ns[due]
            first_ns = np.full(self._static.arenas * self._static.robots, NEVER_NS)
            np.minimum.at(first_ns, sender, turn_ns)
            going = due[turn_ns == first_ns[sender]]
            self._air.send_at(first_ns, self._waiting.select(going))
            staying = np.setdiff1d(np.arange(len(self._turn_ns)), going, assume_unique=True)
            self._waiting, self._turn_ns = self._waiting.select(staying), self._turn_ns[staying]
