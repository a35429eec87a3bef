"""The queue at each sender's radio: what is handed over waits, is taken up one by one, and ends with its robot."""

# pyright: basic, reportUnknownMemberType=false

import numpy as np

from swarmwire.comms.arrays import IntArray
from swarmwire.comms.kernels import kernel
from swarmwire.comms.packets import Fate, TxResult
from swarmwire.comms.radio.config.phy import METHODS
from swarmwire.comms.radio.disruption import ALL, NEWEST, Disruption
from swarmwire.comms.radio.phy import csma, dcf, results
from swarmwire.comms.radio.phy.event_queue import ANSWER, ENTER, LISTENED, SEND, TIMER, cancel, schedule
from swarmwire.comms.radio.phy.state import (
    AWAITING,
    BACKING_OFF,
    HELD,
    KEPT_ALL,
    KEPT_NEWEST,
    NOT_LEARNED,
    NOTHING,
    PAUSING,
    SENDING,
    SILENT,
    TURNING,
)
from swarmwire.comms.truth import NO_ROBOT

QUEUE_FULL, FOUND_FULL = int(Fate.QUEUE_FULL), int(TxResult.QUEUE_FULL)
CSMA = METHODS.index("csma-802154")


@kernel()
def enter(rules, state, queue, told, r, now_ns):
    """The robot's radio is handed what was sent by now: it waits, or is refused."""
    me = state.robot[r]
    while me.entry < me.stop and state.packet[state.order[me.entry]].sent_at_ns <= now_ns:
        index = state.order[me.entry]
        packet = state.packet[index]
        packet.is_entered = 1
        me.entry += 1
        if packet.refused:
            results.refuse(state, told, index, packet.refused, now_ns)
        elif state.off[r] != KEPT_NEWEST and _is_full(rules, state, r):
            packet.result = FOUND_FULL
            results.refuse(state, told, index, QUEUE_FULL, now_ns)
        else:
            if state.off[r] == KEPT_NEWEST:
                results.give_up_older(state, told, r, me.entry - 1, now_ns)
            me.waiting += 1
            if me.stage == NOTHING:
                serve(rules, state, queue, r, now_ns)
    if me.entry < me.stop:
        schedule(queue, ENTER, r, state.packet[state.order[me.entry]].sent_at_ns)


@kernel()
def _is_full(rules, state, r):
    """Whether no packet more may wait at the robot's radio."""
    me = state.robot[r]
    if state.off[r] == KEPT_ALL:
        return me.waiting + (me.stage == HELD) >= rules.queue_limit
    return me.stage != NOTHING and me.waiting >= rules.queue_limit


@kernel()
def serve(rules, state, queue, r, now_ns):
    """The robot's radio is free: it takes up the next packet, if one waits."""
    me = state.robot[r]
    me.stage, me.packet = NOTHING, NO_ROBOT
    while me.next < me.entry and state.packet[state.order[me.next]].is_done:
        me.next += 1
    if me.next == me.entry:
        return
    me.packet = state.order[me.next]
    me.next += 1
    me.waiting -= 1
    me.attempt = me.exponent = 0
    me.last_fate = NO_ROBOT
    begin(rules, state, queue, r, now_ns)


@kernel()
def begin(rules, state, queue, r, now_ns):
    """An attempt at the packet being served, unless the radio is off and keeps it back."""
    me = state.robot[r]
    if state.off[r] <= KEPT_ALL:
        me.stage = HELD
    elif rules.method == CSMA:
        csma.want(rules, state, queue, r, now_ns)
    elif rules.method == dcf.DCF:
        dcf.want(rules, state, queue, r, now_ns)
    else:
        me.stage = BACKING_OFF
        schedule(queue, SEND, r, now_ns)


@kernel()
def pause(rules, state, queue, r, pause_ns, now_ns):
    """A packet is over: silence, or new slots, then the next one."""
    me = state.robot[r]
    if rules.method == dcf.DCF:
        me.exponent = 0
        dcf.wait_after(rules, state, r)
    if pause_ns == 0:
        serve(rules, state, queue, r, now_ns)
        return
    me.stage, me.packet = PAUSING, NO_ROBOT
    schedule(queue, TIMER, r, now_ns + pause_ns)


@kernel()
def keep_newest(rules, state, queue, told, r, now_ns):
    """If the robot's radio is off and keeps the newest packet alone: what waits before it ends."""
    me = state.robot[r]
    if state.off[r] == KEPT_NEWEST and me.waiting > 0:
        results.give_up_older(state, told, r, me.entry - 1, now_ns)
        me.waiting = 1
        if me.stage == NOTHING:
            serve(rules, state, queue, r, now_ns)


@kernel()
def stop(state, queue, told, r, now_ns, fate):
    """The robot died: its queue ends; what it has on air stays there."""
    me = state.robot[r]
    for kind in (TIMER, LISTENED, SEND, ANSWER, ENTER):
        cancel(queue, kind, r)
    sending = me.stage == SENDING
    if sending:
        state.packet[me.packet].result = NOT_LEARNED
    elif me.stage >= BACKING_OFF and (me.stage == AWAITING or me.attempt > 0):  # it was on air
        results.settle(state, told, r, now_ns)
    first = me.next - (me.stage >= BACKING_OFF)
    for at in range(first, me.stop):
        index = state.order[at]
        packet = state.packet[index]
        if not packet.is_done and not (sending and index == me.packet):
            results.refuse(state, told, index, packet.refused if packet.refused else fate, now_ns)
    me.next = me.entry = me.stop
    me.waiting = 0
    if not sending:
        me.stage, me.packet = NOTHING, NO_ROBOT
        state.reception[r].is_deaf = me.on_air != SILENT


# --- Backlog: what a radio that is off should send waits for it, or gives way to what is newer.


def fate_of_sending(held: Disruption) -> IntArray:
    """What becomes of what each robot should send, (rows,): RECEIVED if its radio is on."""
    if not held.anyone_out:
        return np.full(len(held.alive), int(Fate.RECEIVED))
    off = np.select([held.backlog == ALL, held.backlog == NEWEST], [KEPT_ALL, KEPT_NEWEST], int(Fate.BLACKOUT))
    return np.where(held.alive, np.where(held.radio_on, int(Fate.RECEIVED), off), int(Fate.SENDER_DEAD))


@kernel(from_python=True)
def switch(rules, state, queue, told, now_ns):
    """Radios are off or on from now on, as `state.off` says; after `line_up`.

    A packet whose turn it was goes back to the start: what its radio had listened to is long past when it is on again.
    """
    for r in range(len(state.robot)):
        me = state.robot[r]
        if state.off[r] <= KEPT_ALL:
            _hold_back(state, queue, r)
            keep_newest(rules, state, queue, told, r, now_ns)
        elif me.stage == HELD:
            begin(rules, state, queue, r, now_ns)


@kernel()
def _hold_back(state, queue, r):
    me = state.robot[r]
    if BACKING_OFF <= me.stage <= TURNING:
        cancel(queue, TIMER, r)
        cancel(queue, LISTENED, r)
        cancel(queue, SEND, r)
        me.stage = HELD
        state.reception[r].is_deaf = me.on_air != SILENT
