"""Serving packets: from the sender's queue through the access method on air."""

# pyright: basic, reportUnknownMemberType=false

from swarmwire.comms.air.signal import csma, dcf, on_air, telling
from swarmwire.comms.air.signal.event_queue import ANSWER, ENTER, LISTENED, SEND, TIMER, cancel, schedule
from swarmwire.comms.air.signal.parameters import METHODS
from swarmwire.comms.air.signal.tables import (
    ACKNOWLEDGEMENT,
    AWAITING,
    BACKING_OFF,
    DATA,
    HELD,
    KEPT_ALL,
    KEPT_NEWEST,
    NOBODY,
    NOT_LEARNED,
    NOTHING,
    PAUSING,
    SENDING,
    SILENT,
    TURNING,
)
from swarmwire.comms.borrowing import borrowing
from swarmwire.comms.fates import Fate
from swarmwire.comms.outcomes import SendResult

HEARD, QUEUE_FULL, CHANNEL_BUSY = int(Fate.HEARD), int(Fate.QUEUE_FULL), int(Fate.CHANNEL_BUSY)
IS_ACKNOWLEDGED, FOUND_BUSY = int(SendResult.ACKNOWLEDGED), int(SendResult.CHANNEL_BUSY)
FOUND_FULL = int(SendResult.QUEUE_FULL)
CSMA = METHODS.index("csma-802154")


@borrowing()
def enter(rules, state, queue, told, r, now_ns):
    """The robot's radio is handed what was sent by now: it waits, or is refused."""
    me = state.robot[r]
    while me.entry < me.stop and state.packet[state.order[me.entry]].sent_at_ns <= now_ns:
        index = state.order[me.entry]
        packet = state.packet[index]
        packet.is_entered = 1
        me.entry += 1
        if packet.refused:
            telling.refuse(state, told, index, packet.refused, now_ns)
        elif state.off[r] != KEPT_NEWEST and _is_full(rules, state, r):
            packet.result = FOUND_FULL
            telling.refuse(state, told, index, QUEUE_FULL, now_ns)
        else:
            if state.off[r] == KEPT_NEWEST:
                telling.give_up_older(state, told, r, me.entry - 1, now_ns)
            me.waiting += 1
            if me.stage == NOTHING:
                serve(rules, state, queue, r, now_ns)
    if me.entry < me.stop:
        schedule(queue, ENTER, r, state.packet[state.order[me.entry]].sent_at_ns)


@borrowing()
def _is_full(rules, state, r):
    """Whether no packet more may wait at the robot's radio."""
    me = state.robot[r]
    if state.off[r] == KEPT_ALL:
        return me.waiting + (me.stage == HELD) >= rules.queue_limit
    return me.stage != NOTHING and me.waiting >= rules.queue_limit


@borrowing()
def serve(rules, state, queue, r, now_ns):
    """The robot's radio is free: it takes up the next packet, if one waits."""
    me = state.robot[r]
    me.stage, me.packet = NOTHING, NOBODY
    while me.next < me.entry and state.packet[state.order[me.next]].is_done:
        me.next += 1
    if me.next == me.entry:
        return
    me.packet = state.order[me.next]
    me.next += 1
    me.waiting -= 1
    me.attempt = me.exponent = 0
    me.last_fate = NOBODY
    begin(rules, state, queue, r, now_ns)


@borrowing()
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


@borrowing()
def timer(rules, state, queue, told, r, now_ns):
    """What the robot waited for has passed."""
    me = state.robot[r]
    if me.stage == BACKING_OFF:
        csma.listen(rules, state, queue, r, now_ns)
    elif me.stage == AWAITING:
        fail(rules, state, queue, told, r, now_ns)
    else:
        serve(rules, state, queue, r, now_ns)


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
    serve(rules, state, queue, r, now_ns)


@borrowing()
def send(rules, state, queue, told, r, now_ns):
    """The packet being served goes on air."""
    me = state.robot[r]
    if me.on_air != SILENT:  # an acknowledgement of its own is still on air
        begin(rules, state, queue, r, now_ns)
        return
    packet = state.packet[me.packet]
    if me.attempt > 0 and state.off[r] != HEARD:  # it was on air before: that is what becomes of it
        state.reception[r].is_deaf = 0
        telling.settle(state, told, r, now_ns)
        pause(rules, state, queue, r, packet.pause_ns, now_ns)
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
def sent(rules, bursts, state, queue, told, r, now_ns):
    """What the robot had on air ends."""
    me = state.robot[r]
    kind = me.on_air
    on_air.take_off_air(rules, bursts, state, queue, r, now_ns)
    if kind == ACKNOWLEDGEMENT:
        _acknowledged(rules, state, queue, told, r, now_ns)
        return
    if me.packet == NOBODY:
        return  # it died meanwhile, and what it sent has been told
    packet = state.packet[me.packet]
    if packet.fate != HEARD:
        telling.refuse(state, told, me.packet, packet.fate, packet.on_air_at_ns)
        pause(rules, state, queue, r, packet.pause_ns, now_ns)
        return
    telling.report(rules, state, queue, told, r, now_ns)
    if packet.to != NOBODY and rules.acknowledged and packet.result != NOT_LEARNED:
        me.stage = AWAITING
        schedule(queue, TIMER, r, now_ns + rules.patience_ns)
        return
    if packet.to != NOBODY and not packet.is_settled:
        telling.settle(state, told, r, now_ns)
    packet.is_done = 1
    pause(rules, state, queue, r, packet.pause_ns, now_ns)


@borrowing()
def pause(rules, state, queue, r, pause_ns, now_ns):
    """A packet is over: silence, or new slots, then the next one."""
    me = state.robot[r]
    if rules.method == dcf.DCF:
        me.exponent = 0
        dcf.wait_after(rules, state, r)
    if pause_ns == 0:
        serve(rules, state, queue, r, now_ns)
        return
    me.stage, me.packet = PAUSING, NOBODY
    schedule(queue, TIMER, r, now_ns + pause_ns)


@borrowing()
def fail(rules, state, queue, told, r, now_ns):
    """No acknowledgement came: once more, or the last attempt's fate is the packet's."""
    me = state.robot[r]
    packet = state.packet[me.packet]
    if me.attempt >= rules.retries:
        telling.settle(state, told, r, now_ns)
        pause(rules, state, queue, r, packet.pause_ns, now_ns)
        return
    me.attempt += 1
    if rules.method == dcf.DCF:
        me.exponent += 1
        dcf.wait_after(rules, state, r)
    begin(rules, state, queue, r, now_ns)
    keep_newest(rules, state, queue, told, r, now_ns)


@borrowing()
def keep_newest(rules, state, queue, told, r, now_ns):
    """If the robot's radio is off and keeps the newest packet alone: what waits before it ends."""
    me = state.robot[r]
    if state.off[r] == KEPT_NEWEST and me.waiting > 0:
        telling.give_up_older(state, told, r, me.entry - 1, now_ns)
        me.waiting = 1
        if me.stage == NOTHING:
            serve(rules, state, queue, r, now_ns)


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
def stop(state, queue, told, r, now_ns, fate):
    """The robot died: its queue ends; what it has on air stays there."""
    me = state.robot[r]
    for kind in (TIMER, LISTENED, SEND, ANSWER, ENTER):
        cancel(queue, kind, r)
    sending = me.stage == SENDING
    if sending:
        state.packet[me.packet].result = NOT_LEARNED
    elif me.stage >= BACKING_OFF and (me.stage == AWAITING or me.attempt > 0):  # it was on air
        telling.settle(state, told, r, now_ns)
    first = me.next - (me.stage >= BACKING_OFF)
    for at in range(first, me.stop):
        index = state.order[at]
        packet = state.packet[index]
        if not packet.is_done and not (sending and index == me.packet):
            telling.refuse(state, told, index, packet.refused if packet.refused else fate, now_ns)
    me.next = me.entry = me.stop
    me.waiting = 0
    if not sending:
        me.stage, me.packet = NOTHING, NOBODY
        state.reception[r].is_deaf = me.on_air != SILENT


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
        receiver = state.link.receiver[i]
        if receiver != me.answers_to or state.link.now[i] != HEARD:
            continue
        it = state.robot[receiver]
        if it.stage == AWAITING and state.packet[it.packet].to == r:
            cancel(queue, TIMER, receiver)
            state.packet[it.packet].result = IS_ACKNOWLEDGED
            telling.settle(state, told, receiver, now_ns)
            pause(rules, state, queue, receiver, state.packet[it.packet].pause_ns, now_ns)
    me.answers_to = NOBODY
