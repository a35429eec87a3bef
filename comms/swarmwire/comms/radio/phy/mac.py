"""Attempts at a packet: from the access method on air, until it is over or has failed; and answers to it."""

# pyright: basic, reportUnknownMemberType=false

import numpy as np

from swarmwire.comms.kernels import kernel
from swarmwire.comms.packets import Fate, TxResult
from swarmwire.comms.radio.phy import csma, dcf, jamming, reception, results, tx_queue
from swarmwire.comms.radio.phy.event_queue import ENTER, LISTENED, OFF_AIR, SEND, TIMER, cancel, schedule
from swarmwire.comms.radio.phy.state import (
    ACKNOWLEDGEMENT,
    AWAITING,
    BACKING_OFF,
    DATA,
    NOT_LEARNED,
    RECEIVING,
    SENDING,
    SILENT,
    TURNING,
)
from swarmwire.comms.truth import NO_ROBOT

RECEIVED, CHANNEL_BUSY = int(Fate.RECEIVED), int(Fate.CHANNEL_BUSY)
IS_ACKNOWLEDGED, FOUND_BUSY = int(TxResult.ACKNOWLEDGED), int(TxResult.CHANNEL_BUSY)


@kernel()
def timer(rules, state, queue, told, r, now_ns):
    """What the robot waited for has passed."""
    me = state.robot[r]
    if me.stage == BACKING_OFF:
        csma.listen(rules, state, queue, r, now_ns)
    elif me.stage == AWAITING:
        fail(rules, state, queue, told, r, now_ns)
    else:
        tx_queue.serve(rules, state, queue, r, now_ns)


@kernel()
def listened(rules, state, queue, told, r, now_ns):
    """CSMA: the radio has listened whether the medium is free."""
    if not csma.gives_up(rules, state, queue, r, now_ns):
        return
    me = state.robot[r]
    state.packet[me.packet].result = FOUND_BUSY
    if me.attempt == 0:
        results.refuse(state, told, me.packet, CHANNEL_BUSY, now_ns)
    else:
        results.settle(state, told, r, now_ns)
    tx_queue.serve(rules, state, queue, r, now_ns)


@kernel()
def send(rules, state, queue, told, r, now_ns):
    """The packet being served goes on air."""
    me = state.robot[r]
    if me.on_air != SILENT:  # an acknowledgement of its own is still on air
        tx_queue.begin(rules, state, queue, r, now_ns)
        return
    packet = state.packet[me.packet]
    if me.attempt > 0 and state.off[r] != RECEIVED:  # it was on air before: that is what becomes of it
        state.reception[r].is_deaf = 0
        results.settle(state, told, r, now_ns)
        tx_queue.pause(rules, state, queue, r, packet.pause_ns, now_ns)
        return
    packet.on_air_at_ns = now_ns
    me.stage = SENDING
    packet.fate = state.off[r]
    if packet.fate == RECEIVED:
        _take_links(state, r)
    else:
        me.first_link = me.weak_link = me.stop_link = 0
    me.on_air = DATA
    reception.put_on_air(rules, state, queue, r, now_ns, packet.airtime_ns, packet.bits)


@kernel()
def sent(rules, losses, state, queue, told, r, now_ns):
    """What the robot had on air ends."""
    me = state.robot[r]
    kind = me.on_air
    reception.take_off_air(rules, losses, state, queue, r, now_ns)
    if kind == ACKNOWLEDGEMENT:
        _acknowledged(rules, state, queue, told, r, now_ns)
        return
    if me.packet == NO_ROBOT:
        return  # it died meanwhile, and what it sent has been told
    packet = state.packet[me.packet]
    if packet.fate != RECEIVED:
        results.refuse(state, told, me.packet, packet.fate, packet.on_air_at_ns)
        tx_queue.pause(rules, state, queue, r, packet.pause_ns, now_ns)
        return
    results.report(rules, state, queue, told, r, now_ns)
    if packet.to != NO_ROBOT and rules.acknowledged and packet.result != NOT_LEARNED:
        me.stage = AWAITING
        schedule(queue, TIMER, r, now_ns + rules.patience_ns)
        return
    if packet.to != NO_ROBOT and not packet.is_settled:
        results.settle(state, told, r, now_ns)
    packet.is_done = 1
    tx_queue.pause(rules, state, queue, r, packet.pause_ns, now_ns)


@kernel()
def fail(rules, state, queue, told, r, now_ns):
    """No acknowledgement came: once more, or the last attempt's fate is the packet's."""
    me = state.robot[r]
    packet = state.packet[me.packet]
    if me.attempt >= rules.retries:
        results.settle(state, told, r, now_ns)
        tx_queue.pause(rules, state, queue, r, packet.pause_ns, now_ns)
        return
    me.attempt += 1
    if rules.method == dcf.DCF:
        me.exponent += 1
        dcf.wait_after(rules, state, r)
    tx_queue.begin(rules, state, queue, r, now_ns)
    tx_queue.keep_newest(rules, state, queue, told, r, now_ns)


@kernel()
def answer(rules, state, queue, r, now_ns):
    """The robot acknowledges what it received, unless it is about to send."""
    me = state.robot[r]
    if me.on_air != SILENT or me.stage == TURNING or state.off[r] != RECEIVED:
        return
    _take_links(state, r)
    me.on_air = ACKNOWLEDGEMENT
    reception.put_on_air(rules, state, queue, r, now_ns, rules.acknowledgement_ns, rules.acknowledgement_bits)


@kernel()
def _take_links(state, r):
    """What the robot puts on air goes over its links under the poses held."""
    me, places = state.robot[r], state.places
    me.first_link, me.weak_link, me.stop_link, me.hold = places.first[r], places.weak[r], places.stop[r], state.hold


@kernel()
def _acknowledged(rules, state, queue, told, r, now_ns):
    """An acknowledgement ends: its sender's packet is over, if it was received there."""
    me = state.robot[r]
    for i in range(me.first_link, me.weak_link):
        receiver = np.int64(state.link[i].receiver)
        if receiver != me.answers_to or state.link[i].now != RECEIVED:
            continue
        it = state.robot[receiver]
        if it.stage == AWAITING and state.packet[it.packet].to == r:
            cancel(queue, TIMER, receiver)
            state.packet[it.packet].result = IS_ACKNOWLEDGED
            results.settle(state, told, receiver, now_ns)
            tx_queue.pause(rules, state, queue, receiver, state.packet[it.packet].pause_ns, now_ns)
    me.answers_to = NO_ROBOT


# --- The run of events: what is due before a time happens, in order of (time, kind, robot row).


SENDER_DEAD, RECEIVER_DEAD, BLACKOUT = int(Fate.SENDER_DEAD), int(Fate.RECEIVER_DEAD), int(Fate.BLACKOUT)
FEW = 64  # rows that any one event tells beyond a frame's links


@kernel(from_python=True)
def line_up(state, queue, start):
    """Before events run: the packets of robot r are order[start[r]:start[r + 1]], those done taken out."""
    for r in range(len(state.robot)):
        me = state.robot[r]
        at, stop = start[r], start[r + 1]
        me.stop = stop
        me.packet = NO_ROBOT
        if me.stage >= BACKING_OFF:
            me.packet = state.order[at]
            at += 1
        me.next = at
        while at < stop and state.packet[state.order[at]].is_entered:
            at += 1
        me.entry = at
        me.waiting = at - me.next
        if at < stop:
            schedule(queue, ENTER, r, state.packet[state.order[at]].sent_at_ns)


@kernel(from_python=True)
def run_until(rules, losses, state, queue, told, most_links, until_ns):
    """Let happen what is due before `until_ns`; False if `told` has no more room: then take it out and call again.

    No robot has more than `most_links`.
    """
    rows = len(state.robot)
    jam = state.jam
    while queue.size[0] > 0 or jam.next[0] < len(jam.at_ns):
        event = queue.heap[0]
        now_ns = queue.at_ns[event] if queue.size[0] > 0 else until_ns
        if jam.next[0] < len(jam.at_ns) and jam.at_ns[jam.next[0]] <= now_ns:
            jamming.toggle(rules, state, queue)  # all of them are before `until_ns`
            continue
        if now_ns >= until_ns:
            break
        kind, r = event // rows, event % rows
        queued = state.robot[r].stop - state.robot[r].next
        if told.count[0] + most_links + queued + FEW > len(told.packet):
            return False
        cancel(queue, kind, r)
        if kind == OFF_AIR:
            sent(rules, losses, state, queue, told, r, now_ns)
        elif kind == LISTENED:
            listened(rules, state, queue, told, r, now_ns)
        elif kind == TIMER:
            timer(rules, state, queue, told, r, now_ns)
        elif kind == SEND:
            send(rules, state, queue, told, r, now_ns)
        elif kind == ENTER:
            tx_queue.enter(rules, state, queue, told, r, now_ns)
        else:
            answer(rules, state, queue, r, now_ns)
    return True


@kernel(from_python=True)
def stop_the_dead(state, queue, told, alive, now_ns):
    """The queues of robots that are not alive (rows,) end; after `line_up`."""
    for r in range(len(state.robot)):
        if not alive[r]:
            tx_queue.stop(state, queue, told, r, now_ns, SENDER_DEAD)


@kernel(from_python=True)
def cut_off(rules, state, queue, alive, radio_on, now_ns):
    """Robots that are dead (rows,), or whose radio is off, do not hear the frames on air to their end."""
    for s in range(len(state.robot)):
        me = state.robot[s]
        if me.on_air == SILENT:
            continue
        for i in range(me.first_link, me.weak_link):
            r = np.int64(state.link[i].receiver)
            if state.link[i].now == RECEIVING and not (alive[r] and radio_on[r]):
                state.link[i].now = BLACKOUT if alive[r] else RECEIVER_DEAD
                reception.let_go(state.reception[r])
                dcf.sense(rules, state, queue, r, now_ns)
