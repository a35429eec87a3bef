"""Queue and access: when a sender's radio puts its packets on air, and which of them it refuses."""

# pyright: basic, reportUnknownMemberType=false

import numpy as np
from numba import njit

from swarmwire.comms.arrays import BoolArray, IntArray
from swarmwire.comms.fates import Fate

ACCEPTED, QUEUE_FULL, TOO_LARGE = int(Fate.HEARD), int(Fate.QUEUE_FULL), int(Fate.TOO_LARGE)


@njit(cache=True)
def enter(
    sent_at_ns: IntArray,
    free_at_ns: IntArray,
    queued_sender: IntArray,
    queued_on_air_at_ns: IntArray,
    sender: IntArray,
    airtime_ns: IntArray,
    too_large: BoolArray,
    queue_limit: IntArray,
) -> tuple[IntArray, IntArray, IntArray]:
    """First in, first out: `on_air_at = max(sent_at, end of the sender's previous packet)`, all times in ns.

    A packet that must wait is refused while `queue_limit` others of its sender wait (will go on air after `sent_at`).
    That limit, `sent_at_ns` and `free_at_ns` (end of the last airtime) are by robot row, `queued` the packets that may
    still wait.
    Returns on_air_at_ns (k,) (sent_at of a refused packet), fate (k,) and the new free_at_ns (rows,).
    """
    free_at_ns = free_at_ns.copy()
    waiting = np.zeros(len(free_at_ns), np.int64)
    for p in range(len(queued_sender)):
        if queued_on_air_at_ns[p] > sent_at_ns[queued_sender[p]]:
            waiting[queued_sender[p]] += 1
    on_air_at_ns = np.empty(len(sender), np.int64)
    fate = np.full(len(sender), ACCEPTED, np.int64)
    for p in range(len(sender)):
        s = sender[p]
        on_air_at_ns[p] = sent_at_ns[s]
        must_wait = free_at_ns[s] > sent_at_ns[s]
        if too_large[p]:
            fate[p] = TOO_LARGE
        elif must_wait and waiting[s] >= queue_limit[s]:
            fate[p] = QUEUE_FULL
        else:
            on_air_at_ns[p] = max(sent_at_ns[s], free_at_ns[s])
            free_at_ns[s] = on_air_at_ns[p] + airtime_ns[p]
            waiting[s] += must_wait
    return on_air_at_ns, fate, free_at_ns
