"""DCF of IEEE 802.11: who wants to send waits until the medium was free for DIFS, then for its slots of free air.

A robot that finds the medium free sends after DIFS, as in ns-3; the standard lets it do so at once. Each frame on air
is followed by new slots; those that are left when the medium becomes busy count on when it is free again. After a frame
that was not understood the medium counts as free only EIFS later (IEEE 802.11-2007, 9.2.3.4 and 9.2.5).
"""

# pyright: basic, reportUnknownMemberType=false

import numpy as np

from swarmwire.comms.draws import purpose
from swarmwire.comms.draws_compiled import uniform
from swarmwire.comms.kernels import kernel
from swarmwire.comms.radio.config.phy import METHODS
from swarmwire.comms.radio.phy.event_queue import SEND, cancel, due_ns, schedule
from swarmwire.comms.radio.phy.state import BACKING_OFF
from swarmwire.comms.truth import NO_ROBOT

DCF = METHODS.index("dcf")
SLOTS, SLOTS_BEFORE = purpose("dcf slots"), purpose("dcf slots before sending")


@kernel()
def want(rules, state, queue, r, now_ns):
    """The robot wants to send the packet that it serves."""
    me = state.robot[r]
    me.stage = BACKING_OFF
    if state.reception[r].is_busy:
        _wait_if_none_left(rules, state, r)
        return
    counted_ns = me.free_from_ns + me.slots * rules.slot_ns
    schedule(queue, SEND, r, max(now_ns, counted_ns) + rules.difs_ns)


@kernel(inline="always")
def sense(rules, state, queue, r, now_ns):
    """What is on air at the robot may have changed; nothing to other methods."""
    if rules.method == DCF:
        it = state.reception[r]
        is_busy = it.is_deaf or it.locked_to != NO_ROBOT or it.power_mw + it.jam_mw >= rules.busy_mw
        if is_busy != (it.is_busy != 0):
            _change(rules, state, queue, r, now_ns)


@kernel()
def _change(rules, state, queue, r, now_ns):
    """The medium at the robot has become busy, or free."""
    me, reception = state.robot[r], state.reception[r]
    reception.is_busy = not reception.is_busy
    if reception.is_busy:
        counted = (now_ns - me.free_from_ns - rules.difs_ns) // rules.slot_ns
        me.slots = max(me.slots - max(counted, 0), 0)
        # Who sends at this very moment cannot have received the other.
        if me.stage == BACKING_OFF and due_ns(queue, SEND, r) > now_ns:
            cancel(queue, SEND, r)
    else:
        me.free_from_ns = max(now_ns, me.trust_from_ns)
        if me.stage == BACKING_OFF:
            schedule(queue, SEND, r, me.free_from_ns + rules.difs_ns + me.slots * rules.slot_ns)


@kernel()
def wait_after(rules, state, r):
    """The robot's frame is off air: new slots, keyed by (robot, sequence, attempt)."""
    me = state.robot[r]
    me.slots = _slots(rules, state, r, SLOTS)


@kernel()
def _wait_if_none_left(rules, state, r):
    me = state.robot[r]
    if me.slots == 0:
        me.slots = _slots(rules, state, r, SLOTS_BEFORE)


@kernel()
def _slots(rules, state, r, what_for):
    me = state.robot[r]
    packet = state.packet[me.packet]
    window = min((rules.least_window + 1) * 2**me.exponent, rules.most_window + 1)
    u = uniform(state.keys[r // rules.robots], r % rules.robots, packet.sequence, me.attempt, what_for)
    return np.int64(u * window)
