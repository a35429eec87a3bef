"""Backlog: what a radio that is off should send waits for it, or gives way to what is newer."""

# pyright: basic, reportUnknownMemberType=false

import numpy as np

from swarmwire.comms.air.disruption import ALL, NEWEST, Disruption
from swarmwire.comms.air.signal import sender_queue
from swarmwire.comms.air.signal.event_queue import LISTENED, SEND, TIMER, cancel
from swarmwire.comms.air.signal.tables import BACKING_OFF, HELD, KEPT_ALL, KEPT_NEWEST, SILENT, TURNING
from swarmwire.comms.arrays import IntArray
from swarmwire.comms.borrowing import borrowing
from swarmwire.comms.fates import Fate


def fate_of_sending(held: Disruption) -> IntArray:
    """What becomes of what each robot should send, (rows,): HEARD if its radio is on."""
    if not held.anyone_out:
        return np.full(len(held.alive), int(Fate.HEARD))
    off = np.select([held.backlog == ALL, held.backlog == NEWEST], [KEPT_ALL, KEPT_NEWEST], int(Fate.BLACKOUT))
    return np.where(held.alive, np.where(held.radio_on, int(Fate.HEARD), off), int(Fate.SENDER_DEAD))


@borrowing(from_python=True)
def switch(rules, state, queue, told, now_ns):
    """Radios are off or on from now on, as `state.off` says; after `line_up`.

    A packet whose turn it was goes back to the start: what its radio had listened to is long past when it is on again.
    """
    for r in range(len(state.robot)):
        me = state.robot[r]
        if state.off[r] <= KEPT_ALL:
            _hold_back(state, queue, r)
            sender_queue.keep_newest(rules, state, queue, told, r, now_ns)
        elif me.stage == HELD:
            sender_queue.begin(rules, state, queue, r, now_ns)


@borrowing()
def _hold_back(state, queue, r):
    me = state.robot[r]
    if BACKING_OFF <= me.stage <= TURNING:
        cancel(queue, TIMER, r)
        cancel(queue, LISTENED, r)
        cancel(queue, SEND, r)
        me.stage = HELD
        state.reception[r].is_deaf = me.on_air != SILENT
