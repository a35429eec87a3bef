"""Latencies of packets: until they were received, and until the agents that they were for could act on them."""

# pyright: basic, reportUnknownMemberType=false

import numpy as np

from swarmwire.comms.arrays import IntArray
from swarmwire.comms.clock import NS_PER_S
from swarmwire.comms.kernels import njit
from swarmwire.comms.packets import Fate
from swarmwire.comms.truth import ReceptionRecords, Static

RECEIVED = int(Fate.RECEIVED)


class Latencies:
    """Tells the two latencies of each packet received.

    On air: from sending to hearing. To the agent: from sending to the start of the first tick, of those that begin
    when it was known to be received or later, at which the receiver acts.
    """

    def __init__(self, static: Static) -> None:
        self._rate_hz, self._act_every_ticks = static.rate_hz, static.act_every_ticks

    def of(self, finished: ReceptionRecords, tick: int) -> tuple[IntArray, IntArray, IntArray]:
        """Of the links that a tick received: the arena, the latency on air and to the agent in ns, each (k,)."""
        acts_at_ns = -(-tick // self._act_every_ticks) * self._act_every_ticks * NS_PER_S // self._rate_hz
        ended = finished.fate, finished.receiver, finished.sent_at_ns, finished.final_at_ns
        received, air_ns, agent_ns = _latencies_ns(*ended, acts_at_ns)
        return finished.arena.take(received), air_ns, agent_ns


@njit()
def _latencies_ns(fate, receiver, sent_at_ns, final_at_ns, acts_at_ns):
    """Of the links received: their rows, how long until they were, and until their receivers act, (k,)."""
    received, air_ns, agent_ns = np.empty_like(fate), np.empty_like(fate), np.empty_like(fate)
    found = 0
    for row in range(len(fate)):
        if fate[row] == RECEIVED:
            received[found], air_ns[found] = row, final_at_ns[row] - sent_at_ns[row]
            agent_ns[found] = acts_at_ns[receiver[row]] - sent_at_ns[row]
            found += 1
    return received[:found], air_ns[:found], agent_ns[:found]
