"""Backlog: packets that wait at a radio while it is off, and go on air when it is on again."""

# pyright: basic, reportUnknownMemberType=false

import numpy as np
from numba import njit

from swarmwire.comms.air.disk.queue import ACCEPTED
from swarmwire.comms.air.transmissions import Transmissions
from swarmwire.comms.arrays import BoolArray, IntArray
from swarmwire.comms.fates import Fate

# When a packet goes on air whose radio is off; airtimes may be added to it.
FAR_NS = 2**62


def held_back(queued: Transmissions, which: BoolArray, free_at_ns: IntArray) -> tuple[Transmissions, IntArray]:
    """The queue in which what waits at radios `which` (rows,) waits for them; and when their last airtime ends.

    `free_at_ns` (rows,) is when all that waits would have been sent.
    """
    held = _held_back(queued.sender, queued.fate, queued.on_air_at_ns, queued.off_air_at_ns, which, free_at_ns)
    on_air_at_ns, off_air_at_ns, free_at_ns = held
    return queued._replace(on_air_at_ns=on_air_at_ns, off_air_at_ns=off_air_at_ns), free_at_ns


def let_go(queued: Transmissions, which: BoolArray, free_at_ns: IntArray, at_ns: int) -> tuple[Transmissions, IntArray]:
    """The queue in which what waited for radios `which` (rows,) goes on air from `at_ns` on, one after the other.

    `free_at_ns` (rows,) is when their last airtime ended; also returned, as it is then.
    """
    gone = _let_go(
        queued.sender, queued.sent_at_ns, queued.on_air_at_ns, queued.off_air_at_ns, which, free_at_ns, at_ns
    )
    on_air_at_ns, off_air_at_ns, free_at_ns = gone
    return queued._replace(on_air_at_ns=on_air_at_ns, off_air_at_ns=off_air_at_ns), free_at_ns


def newest_only(queued: Transmissions, which: BoolArray, at_ns: IntArray) -> Transmissions:
    """The queue in which only the newest packet waits for each radio of `which` (rows,).

    Older ones end as BLACKOUT at `at_ns` (rows,), by sender: it is the radio that is off that they are lost to.
    """
    if not which.any():
        return queued
    waiting = np.flatnonzero((queued.on_air_at_ns >= FAR_NS) & which[queued.sender])
    newest = np.zeros(len(which), np.int64)
    np.maximum.at(newest, queued.sender[waiting], waiting)
    old = waiting[newest[queued.sender[waiting]] != waiting]
    if not len(old):
        return queued
    fate, on_air_at_ns, off_air_at_ns = queued.fate.copy(), queued.on_air_at_ns.copy(), queued.off_air_at_ns.copy()
    fate[old] = Fate.BLACKOUT
    on_air_at_ns[old] = off_air_at_ns[old] = at_ns[queued.sender[old]]
    return queued._replace(fate=fate, on_air_at_ns=on_air_at_ns, off_air_at_ns=off_air_at_ns)


@njit(cache=True)
def _held_back(sender, fate, on_air_at_ns, off_air_at_ns, which, free_at_ns):
    on_air_at_ns, off_air_at_ns, free_at_ns = on_air_at_ns.copy(), off_air_at_ns.copy(), free_at_ns.copy()
    seen = np.zeros(len(which), np.bool_)
    for p in range(len(sender)):
        s = sender[p]
        if not which[s] or fate[p] != ACCEPTED:
            continue
        if not seen[s]:  # the packet before the first that waits has been sent when this one would have begun
            seen[s] = True
            free_at_ns[s] = on_air_at_ns[p]
        off_air_at_ns[p] += FAR_NS - on_air_at_ns[p]
        on_air_at_ns[p] = FAR_NS
    return on_air_at_ns, off_air_at_ns, free_at_ns


@njit(cache=True)
def _let_go(sender, sent_at_ns, on_air_at_ns, off_air_at_ns, which, free_at_ns, at_ns):
    on_air_at_ns, off_air_at_ns, free_at_ns = on_air_at_ns.copy(), off_air_at_ns.copy(), free_at_ns.copy()
    for p in range(len(sender)):
        s = sender[p]
        if not which[s] or on_air_at_ns[p] < FAR_NS:
            continue
        lasts_ns = off_air_at_ns[p] - on_air_at_ns[p]
        on_air_at_ns[p] = max(at_ns, free_at_ns[s], sent_at_ns[p])
        off_air_at_ns[p] = on_air_at_ns[p] + lasts_ns
        free_at_ns[s] = off_air_at_ns[p]
    return on_air_at_ns, off_air_at_ns, free_at_ns
