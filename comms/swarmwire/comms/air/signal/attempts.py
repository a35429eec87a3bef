"""Attempts at a packet: from the access method on air, until it is over or has failed; and answers to it."""

# pyright: basic, reportUnknownMemberType=false

import numpy as np

from swarmwire.comms.air.signal import csma, dcf, on_air, sender_queue, telling
from swarmwire.comms.air.signal.event_queue import TIMER, cancel, schedule
from swarmwire.comms.air.signal.tables import (
    ACKNOWLEDGEMENT,
    AWAITING,
    BACKING_OFF,
    DATA,
    NOT_LEARNED,
    SENDING,
    SILENT,
    TURNING,
)
from swarmwire.comms.borrowing import borrowing
from swarmwire.comms.fates import Fate
from swarmwire.comms.outcomes import SendResult
from swarmwire.comms.truth import NOBODY

HEARD, CHANNEL_BUSY = int(Fate.HEARD), int(Fate.CHANNEL_BUSY)
IS_ACKNOWLEDGED, FOUND_BUSY = int(SendResult.ACKNOWLEDGED), int(SendResult.CHANNEL_BUSY)


@borrowing()
def timer(rules, state, queue, told, r, now_ns):
    """What the robot waited for has passed."""
    me = state.robot[r]
    if me.stage == BACKING_OFF:
        csma.listen(rules, state, queue, r, now_ns)
    elif me.stage == AWAITING:
        fail(rules, state, queue, told, r, now_ns)
    else:
        sender_queue.serve(rules, state, queue, r, now_ns)


@borrowing()
def listened(rules, state, queue, told, r, now_ns):
    """CSMA: the radio has listened whether the air is free."""
    if not csma.gives_up(rules, state, queue, r, now_ns):
        return
    me = state.robot[r]
    state.packet[me.packet].result = FOUND_BUSY
    if me.attempt == 0:
        telling.refuse(state, told, me.packet, CHANNEL_BUSY, now_ns)
    else:
        telling.settle(state, told, r, now_ns)
    sender_queue.serve(rules, state, queue, r, now_ns)


@borrowing()
def send(rules, state, queue, told, r, now_ns):
    """The packet being served goes on air."""
    me = state.robot[r]
    if me.on_air != SILENT:  # an acknowledgement of its own is still on air
        sender_queue.begin(rules, state, queue, r, now_ns)
        return
    packet = state.packet[me.packet]
    if me.attempt > 0 and state.off[r] != HEARD:  # it was on air before: that is what becomes of it
        state.reception[r].is_deaf = 0
        telling.settle(state, told, r, now_ns)
        sender_queue.pause(rules, state, queue, r, packet.pause_ns, now_ns)
        return
    packet.on_air_at_ns = now_ns
    me.stage = SENDING
    packet.fate = state.off[r]
    if packet.fate == HEARD:
        _take_links(state, r)
    else:
        me.first_link = me.weak_link = me.stop_link = 0
    me.on_air = DATA
    on_air.put_on_air(rules, state, queue, r, now_ns, packet.airtime_ns, packet.bits)


@borrowing()
def sent(rules, losses, state, queue, told, r, now_ns):
    """What the robot had on air ends."""
    me = state.robot[r]
    kind = me.on_air
    on_air.take_off_air(rules, losses, state, queue, r, now_ns)
    if kind == ACKNOWLEDGEMENT:
        _acknowledged(rules, state, queue, told, r, now_ns)
        return
    if me.packet == NOBODY:
        return  # it died meanwhile, and what it sent has been told
    packet = state.packet[me.packet]
    if packet.fate != HEARD:
        telling.refuse(state, told, me.packet, packet.fate, packet.on_air_at_ns)
        sender_queue.pause(rules, state, queue, r, packet.pause_ns, now_ns)
        return
    telling.report(rules, state, queue, told, r, now_ns)
    if packet.to != NOBODY and rules.acknowledged and packet.result != NOT_LEARNED:
        me.stage = AWAITING
        schedule(queue, TIMER, r, now_ns + rules.patience_ns)
        return
    if packet.to != NOBODY and not packet.is_settled:
        telling.settle(state, told, r, now_ns)
    packet.is_done = 1
    sender_queue.pause(rules, state, queue, r, packet.pause_ns, now_ns)


@borrowing()
def fail(rules, state, queue, told, r, now_ns):
    """No acknowledgement came: once more, or the last attempt's fate is the packet's."""
    me = state.robot[r]
    packet = state.packet[me.packet]
    if me.attempt >= rules.retries:
        telling.settle(state, told, r, now_ns)
        sender_queue.pause(rules, state, queue, r, packet.pause_ns, now_ns)
        return
    me.attempt += 1
    if rules.method == dcf.DCF:
        me.exponent += 1
        dcf.wait_after(rules, state, r)
    sender_queue.begin(rules, state, queue, r, now_ns)
    sender_queue.keep_newest(rules, state, queue, told, r, now_ns)


@borrowing()
def answer(rules, state, queue, r, now_ns):
    """The robot acknowledges what it heard, unless it is about to send."""
    me = state.robot[r]
    if me.on_air != SILENT or me.stage == TURNING or state.off[r] != HEARD:
        return
    _take_links(state, r)
    me.on_air = ACKNOWLEDGEMENT
    on_air.put_on_air(rules, state, queue, r, now_ns, rules.acknowledgement_ns, rules.acknowledgement_bits)


@borrowing()
def _take_links(state, r):
    """What the robot puts on air goes over its links under the poses held."""
    me, places = state.robot[r], state.places
    me.first_link, me.weak_link, me.stop_link, me.hold = places.first[r], places.weak[r], places.stop[r], state.hold


@borrowing()
def _acknowledged(rules, state, queue, told, r, now_ns):
    """An acknowledgement ends: its sender's packet is over, if it was heard there."""
    me = state.robot[r]
    for i in range(me.first_link, me.weak_link):
        receiver = np.int64(state.link[i].receiver)
        if receiver != me.answers_to or state.link[i].now != HEARD:
            continue
        it = state.robot[receiver]
        if it.stage == AWAITING and state.packet[it.packet].to == r:
            cancel(queue, TIMER, receiver)
            state.packet[it.packet].result = IS_ACKNOWLEDGED
            telling.settle(state, told, receiver, now_ns)
            sender_queue.pause(rules, state, queue, receiver, state.packet[it.packet].pause_ns, now_ns)
    me.answers_to = NOBODY
