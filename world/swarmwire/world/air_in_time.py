"""The air of a loop whose crew takes its time: packets are put on it, and heard, also in the middle of a tick.

    a tick begins    `begin`      what became final since the last tick, for observers; what of it nobody was handed yet
    it goes on       `send`       packets come: those of a step wait for their robot's turn, others go out at once
                     `advance`    what is heard is handed over when it is due

When which part of a packet's way is asked for changes nothing of it; so a run is repeated from what came in, and when.
"""

from collections.abc import Callable

import numpy as np

from swarmwire.comms.arrays import BoolArray
from swarmwire.comms.clock import tick_start_ns
from swarmwire.comms.interfaces import Put
from swarmwire.comms.packets import Heard, Outcomes, Sent
from swarmwire.comms.radio.medium import Air
from swarmwire.comms.radio.results import News
from swarmwire.comms.truth import Static

NEVER_NS = 2**63 - 1


class AirInTime:
    """An air between `begin` of one tick and that of the next."""

    def __init__(self, air: Air, static: Static, addressable: Callable[[Sent], Sent]) -> None:
        """`addressable` makes packets fit for the air, and counts what was wrong with them."""
        self._air, self._static, self._addressable = air, static, addressable
        self._rows = static.arenas * static.robots
        self._waiting = Sent.none()  # (k,) that were put on the air, each until its robot's turn comes
        self._turn_ns = np.empty(0, np.int64)  # (k,) NEVER_NS: it came
        self._next_ns = NEVER_NS  # the first turn to come
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
        self._release(at_ns)
        sent = self._addressable(put.sent)
        if put.tick is None:
            self._air.send_at(np.full(self._rows, at_ns), sent)
            return
        start_ns = tick_start_ns(put.tick, self._static.rate_hz)
        turn_ns = np.maximum(at_ns, self._air.turns(start_ns, put.tick)[sent.sender])
        waits = np.flatnonzero(self._turn_ns < NEVER_NS)
        self._waiting = Sent.joined([self._waiting.select(waits), sent]) if len(waits) else sent
        self._turn_ns = np.concatenate((self._turn_ns[waits], turn_ns))
        self._next_ns = int(self._turn_ns.min())
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
        while self._next_ns <= until_ns and self._next_ns < NEVER_NS:
            due = self._turn_ns <= min(until_ns, NEVER_NS - 1)
            if arenas is not None:
                due &= arenas[self._waiting.sender // self._static.robots]
            place = np.flatnonzero(due)
            if not len(place):
                return
            sender, turn_ns = self._waiting.sender[place], self._turn_ns[place]
            # A robot's packets stand in the order in which it sent them, which is that of their turns.
            first_ns = np.full(self._rows, NEVER_NS)
            first_ns[sender[::-1]] = turn_ns[::-1]
            going = place[turn_ns == first_ns[sender]]
            self._air.send_at(first_ns, self._waiting.select(going))
            self._turn_ns[going] = NEVER_NS
            self._next_ns = int(self._turn_ns.min())
