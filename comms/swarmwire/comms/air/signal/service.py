"""Serving packets: from the sender's queue through the access method on air, and what is told of them."""

# pyright: basic, reportUnknownMemberType=false

import numpy as np
from numba import njit

from swarmwire.comms.air.signal import dcf, on_air
from swarmwire.comms.air.signal.event_queue import ANSWER, ENTER, LISTENED, SEND, TIMER, cancel, schedule
from swarmwire.comms.air.signal.parameters import METHODS
from swarmwire.comms.air.signal.tables import (
    ACKNOWLEDGEMENT,
    AWAITING,
    BACKING_OFF,
    DATA,
    LISTENING,
    NOBODY,
    NOTHING,
    PAUSING,
    SENDING,
    SILENT,
    TURNING,
)
from swarmwire.comms.draws import purpose
from swarmwire.comms.draws_compiled import uniform
from swarmwire.comms.fates import Fate

BACKOFF = purpose("csma backoff")
HEARD, BLOCKED = int(Fate.HEARD), int(Fate.BLOCKED)
QUEUE_FULL, CHANNEL_BUSY = int(Fate.QUEUE_FULL), int(Fate.CHANNEL_BUSY)
CSMA, DCF = METHODS.index("csma-802154"), METHODS.index("dcf")


@njit(cache=True)
def enter(rules, state, queue, told, r, now_ns):
    """The robot's radio is handed what was sent by now: it waits, or is refused."""
    me = state.robot[r]
    while me.entry < me.stop and state.packet[state.order[me.entry]].sent_at_ns <= now_ns:
        index = state.order[me.entry]
        packet = state.packet[index]
        packet.is_entered = 1
        me.entry += 1
        if packet.refused:
            refuse(state, told, index, packet.refused, now_ns)
        elif me.stage != NOTHING and me.waiting >= rules.queue_limit:
            refuse(state, told, index, QUEUE_FULL, now_ns)
        else:
            me.waiting += 1
            if me.stage == NOTHING:
                serve(rules, state, queue, r, now_ns)
    if me.entry < me.stop:
        schedule(queue, ENTER, r, state.packet[state.order[me.entry]].sent_at_ns)


@njit(cache=True)
def refuse(state, told, index, fate, now_ns):
    """A packet ends at its sender's radio."""
    packet = state.packet[index]
    packet.is_done, packet.fate, packet.on_air_at_ns = 1, fate, now_ns
    _tell(state, told, index, NOBODY, fate, 0, now_ns, 0, 0.0)


@njit(cache=True)
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


@njit(cache=True)
def begin(rules, state, queue, r, now_ns):
    """An attempt at the packet being served."""
    me = state.robot[r]
    if rules.method == CSMA:
        me.busy_times, me.exponent = 0, rules.least_exponent
        back_off(rules, state, queue, r, now_ns)
    elif rules.method == DCF:
        dcf.want(rules, state, queue, r, now_ns)
    else:
        me.stage = BACKING_OFF
        schedule(queue, SEND, r, now_ns)


@njit(cache=True)
def back_off(rules, state, queue, r, now_ns):
    """CSMA: wait U{0 .. 2^BE - 1} backoff periods, keyed by (robot, sequence, attempt and busy times)."""
    me = state.robot[r]
    me.stage = BACKING_OFF
    sequence, attempt = state.packet[me.packet].sequence, 16 * me.attempt + me.busy_times
    u = uniform(state.keys[r // rules.robots], r % rules.robots, sequence, attempt, BACKOFF)
    schedule(queue, TIMER, r, now_ns + np.int64(u * 2**me.exponent) * rules.backoff_ns)


@njit(cache=True)
def timer(rules, state, queue, told, r, now_ns):
    """What the robot waited for has passed."""
    me = state.robot[r]
    if me.stage == BACKING_OFF:
        me.stage, me.peak_mw = LISTENING, 0.0
        schedule(queue, LISTENED, r, now_ns + rules.listen_ns)
    elif me.stage == AWAITING:
        fail(rules, state, queue, told, r, now_ns)
    else:
        serve(rules, state, queue, r, now_ns)


@njit(cache=True)
def listened(rules, state, queue, told, r, now_ns):
    """CSMA: the radio has listened whether the air is free.

    As in ns-3, it is busy if a frame began meanwhile or is on air at the end; one that ended meanwhile does not count.
    """
    me = state.robot[r]
    if max(me.peak_mw, me.power_mw) < rules.busy_mw and me.on_air == SILENT:
        me.stage = TURNING
        on_air.turn_away(state, r)
        schedule(queue, SEND, r, now_ns + rules.turnaround_ns)
        return
    me.busy_times += 1
    me.exponent = min(me.exponent + 1, rules.most_exponent)
    if me.busy_times <= rules.most_backoffs:
        back_off(rules, state, queue, r, now_ns)
        return
    if me.last_fate == NOBODY:
        refuse(state, told, me.packet, CHANNEL_BUSY, now_ns)
    else:
        _settle(state, told, r, now_ns)
    serve(rules, state, queue, r, now_ns)


@njit(cache=True)
def send(rules, state, queue, r, now_ns, first_link, stop_link, hold):
    """The packet being served goes on air; links are those of the robot under the poses held."""
    me = state.robot[r]
    if me.on_air != SILENT:  # an acknowledgement of its own is still on air
        begin(rules, state, queue, r, now_ns)
        return
    packet = state.packet[me.packet]
    packet.on_air_at_ns = now_ns
    me.stage, me.hold = SENDING, hold
    me.first_link = me.stop_link = 0
    packet.fate = state.off[r]
    if packet.fate == HEARD:
        me.first_link, me.stop_link = first_link, stop_link
    on_air.put_on_air(rules, state, queue, r, DATA, now_ns, packet.airtime_ns, packet.bits)


@njit(cache=True)
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
        refuse(state, told, me.packet, packet.fate, packet.on_air_at_ns)
        pause(rules, state, queue, r, packet.pause_ns, now_ns)
        return
    _report(rules, state, queue, told, r, now_ns)
    if packet.to != NOBODY and rules.acknowledged:
        me.stage = AWAITING
        schedule(queue, TIMER, r, now_ns + rules.patience_ns)
        return
    if packet.to != NOBODY and not packet.is_settled:
        _settle(state, told, r, now_ns)
    packet.is_done = 1
    pause(rules, state, queue, r, packet.pause_ns, now_ns)


@njit(cache=True)
def pause(rules, state, queue, r, pause_ns, now_ns):
    """A packet is over: silence, or new slots, then the next one."""
    me = state.robot[r]
    if rules.method == DCF:
        me.exponent = 0
        dcf.wait_after(rules, state, r)
    if pause_ns == 0:
        serve(rules, state, queue, r, now_ns)
        return
    me.stage, me.packet = PAUSING, NOBODY
    schedule(queue, TIMER, r, now_ns + pause_ns)


@njit(cache=True)
def fail(rules, state, queue, told, r, now_ns):
    """No acknowledgement came: once more, or the last attempt's fate is the packet's."""
    me = state.robot[r]
    packet = state.packet[me.packet]
    if me.attempt >= rules.retries:
        _settle(state, told, r, now_ns)
        pause(rules, state, queue, r, packet.pause_ns, now_ns)
        return
    me.attempt += 1
    if rules.method == DCF:
        me.exponent += 1
        dcf.wait_after(rules, state, r)
    begin(rules, state, queue, r, now_ns)


@njit(cache=True)
def answer(rules, state, queue, r, now_ns, first_link, stop_link, hold):
    """The robot acknowledges what it heard, unless it is about to send."""
    me = state.robot[r]
    if me.on_air != SILENT or me.stage == TURNING or state.off[r] != HEARD:
        return
    me.first_link, me.stop_link, me.hold = first_link, stop_link, hold
    on_air.put_on_air(
        rules, state, queue, r, ACKNOWLEDGEMENT, now_ns, rules.acknowledgement_ns, rules.acknowledgement_bits
    )


@njit(cache=True)
def stop(state, queue, told, r, now_ns, fate):
    """The robot died: its queue ends; what it has on air stays there."""
    me = state.robot[r]
    for kind in (TIMER, LISTENED, SEND, ANSWER, ENTER):
        cancel(queue, kind, r)
    sending = me.stage == SENDING
    if me.stage == AWAITING:
        _settle(state, told, r, now_ns)
    first = me.next - (me.stage >= BACKING_OFF)
    for at in range(first, me.stop):
        index = state.order[at]
        packet = state.packet[index]
        if not packet.is_done and not (sending and index == me.packet):
            refuse(state, told, index, packet.refused if packet.refused else fate, now_ns)
    me.next = me.entry = me.stop
    me.waiting = 0
    if not sending:
        me.stage, me.packet = NOTHING, NOBODY


@njit(cache=True)
def _report(rules, state, queue, told, r, now_ns):
    """Tell what became of a frame: at each robot in range, and at those out of range that heard it."""
    me = state.robot[r]
    packet = state.packet[me.packet]
    me.last_fate, me.last_in_range, me.last_mw = NOBODY, 0, 0.0
    for i in range(me.first_link, me.stop_link):
        link = state.link[i]
        is_meant = packet.to == NOBODY or packet.to == link.receiver  # noqa: PLR1714 - `in` would make a tuple
        if not (is_meant and (link.is_listed or link.now == HEARD)):
            continue
        in_range = 0 if link.now == BLOCKED else 1
        if packet.to == NOBODY:
            _tell(state, told, me.packet, link.receiver, link.now, in_range, now_ns, me.hold, link.power_mw)
            continue
        me.last_fate, me.last_in_range, me.last_mw = link.now, in_range, link.power_mw
        if link.now == HEARD:
            if not packet.is_settled:
                packet.is_settled = 1
                _tell(state, told, me.packet, link.receiver, HEARD, 1, now_ns, me.hold, link.power_mw)
            if rules.acknowledged:
                state.robot[link.receiver].answers_to = r
                schedule(queue, ANSWER, link.receiver, now_ns + rules.short_space_ns)


@njit(cache=True)
def _settle(state, told, r, now_ns):
    """An addressed packet is given up: its fate is that of the last attempt, if nothing else was told."""
    me = state.robot[r]
    packet = state.packet[me.packet]
    packet.is_done = 1
    if not packet.is_settled and me.last_fate != NOBODY:
        packet.is_settled = 1
        _tell(state, told, me.packet, packet.to, me.last_fate, me.last_in_range, now_ns, me.hold, me.last_mw)


@njit(cache=True)
def _acknowledged(rules, state, queue, told, r, now_ns):
    """An acknowledgement ends: its sender's packet is over, if it was heard there."""
    me = state.robot[r]
    for i in range(me.first_link, me.stop_link):
        link = state.link[i]
        if link.receiver != me.answers_to or link.now != HEARD:
            continue
        it = state.robot[link.receiver]
        if it.stage == AWAITING and state.packet[it.packet].to == r:
            cancel(queue, TIMER, link.receiver)
            _settle(state, told, link.receiver, now_ns)
            pause(rules, state, queue, link.receiver, state.packet[it.packet].pause_ns, now_ns)
    me.answers_to = NOBODY


@njit(cache=True)
def _tell(state, told, packet, receiver, fate, in_range, final_at_ns, hold, power_mw):
    at = told.count[0]
    row = told.row[at]
    row[0], row[1], row[2], row[3], row[4], row[5] = packet, receiver, fate, in_range, final_at_ns, hold
    row[6] = state.packet[packet].on_air_at_ns  # of this attempt: more may follow
    told.power_mw[at] = power_mw
    told.count[0] += 1
