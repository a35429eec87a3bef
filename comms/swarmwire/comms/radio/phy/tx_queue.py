"""Transmit queues of the PHY: first in, first out, one packet in service at a time.

A radio that is off ends its packets, or holds them until it is on again; the queue of a dead robot ends.
"""

# pyright: basic, reportUnknownMemberType=false

import numpy as np

from swarmwire.comms.base.kernels import kernel
from swarmwire.comms.base.sentinels import NO_FATE, NO_PACKET
from swarmwire.comms.radio.config.phy import METHODS
from swarmwire.comms.radio.disruption import ALL, DROP, NEWEST, Disruption
from swarmwire.comms.radio.phy import csma, dcf, results
from swarmwire.comms.radio.phy.event_queue import CCA_END, ENQUEUE, SEND, SEND_ACK, TIMER, cancel, schedule
from swarmwire.comms.radio.phy.state import (
    AWAITING_ACK,
    BACKING_OFF,
    HELD,
    IDLE,
    NO_RESULT,
    SENDING,
    SILENT,
    SPACING,
    TURNAROUND,
    RadioSwitches,
)
from swarmwire.comms.robot.packets import Fate, TxResult

QUEUE_FULL, TOO_LARGE, QUEUE_FULL_RESULT = int(Fate.QUEUE_FULL), int(Fate.TOO_LARGE), int(TxResult.QUEUE_FULL)
CSMA = METHODS.index("csma-802154")


@kernel()
def enter(params, state, events, buffer, r, now_ns):
    """Admit packets sent by `now_ns` to the robot's queue, or end them there: too large, or queue full."""
    radio = state.robot[r]
    while radio.entry < radio.stop and state.packet[state.order[radio.entry]].sent_at_ns <= now_ns:
        index = state.order[radio.entry]
        packet = state.packet[index]
        packet.is_entered = 1
        radio.entry += 1
        if packet.is_too_large:
            results.record_at_sender(state, buffer, index, TOO_LARGE, now_ns)
        elif state.switch.backlog[r] != NEWEST and _is_full(params, state, r):
            packet.result = QUEUE_FULL_RESULT
            results.record_at_sender(state, buffer, index, QUEUE_FULL, now_ns)
        else:
            if state.switch.backlog[r] == NEWEST:
                results.drop_older(state, buffer, r, radio.entry - 1, now_ns)
            radio.waiting += 1
            if radio.stage == IDLE:
                serve(params, state, events, r, now_ns)
                dcf.defer(params, state, events, r, now_ns)
    if radio.entry < radio.stop:
        schedule(events, ENQUEUE, r, state.packet[state.order[radio.entry]].sent_at_ns)


@kernel()
def _is_full(params, state, r):
    """Whether the robot's queue is full."""
    radio = state.robot[r]
    if state.switch.backlog[r] == ALL:
        return radio.waiting + (radio.stage == HELD) >= params.queue_limit
    return radio.stage != IDLE and radio.waiting >= params.queue_limit


@kernel()
def serve(params, state, events, r, now_ns):
    """The robot's radio is free: serve the next packet, if there is one."""
    if _take_next(state, r):
        begin(params, state, events, r, now_ns)


@kernel()
def _take_next(state, r):
    """Take the next packet out of the queue; False if it is empty, and the radio idle."""
    radio = state.robot[r]
    radio.stage, radio.packet = IDLE, NO_PACKET
    while radio.next < radio.entry and state.packet[state.order[radio.next]].is_done:
        radio.next += 1
    if radio.next == radio.entry:
        return False
    radio.packet = state.order[radio.next]
    radio.next += 1
    radio.waiting -= 1
    radio.attempt = radio.exponent = 0
    radio.last_fate = NO_FATE
    return True


@kernel()
def drop_expired(params, state, buffer, r, now_ns):
    """The radio may send: end packets that waited too long, up to one that did not; False if there is none."""
    radio = state.robot[r]
    while radio.attempt == 0 and now_ns - state.packet[radio.packet].sent_at_ns > params.queue_lifetime_ns:
        state.packet[radio.packet].result = QUEUE_FULL_RESULT
        results.record_at_sender(state, buffer, radio.packet, QUEUE_FULL, now_ns)
        if not _take_next(state, r):
            return False
    return True


@kernel()
def begin(params, state, events, r, now_ns):
    """Start an attempt at the packet being served, unless the radio is off and holds it."""
    radio = state.robot[r]
    if state.switch.backlog[r] != DROP:
        radio.stage = HELD
    elif params.method == CSMA:
        csma.request_access(params, state, events, r, now_ns)
    elif params.method == dcf.DCF:
        dcf.request_access(params, state, events, r, now_ns)
    else:
        radio.stage = BACKING_OFF
        schedule(events, SEND, r, now_ns)


@kernel()
def pause(params, state, events, r, pause_ns, now_ns):
    """A packet is finished: after the interframe space or a new backoff, serve the next one."""
    radio = state.robot[r]
    if params.method == dcf.DCF:
        radio.exponent = 0
        dcf.draw_backoff(params, state, r)
    if pause_ns == 0:
        serve(params, state, events, r, now_ns)
        return
    radio.stage, radio.packet = SPACING, NO_PACKET
    schedule(events, TIMER, r, now_ns + pause_ns)


@kernel()
def keep_newest(params, state, events, buffer, r, now_ns):
    """Under NEWEST, end all waiting packets but the newest."""
    radio = state.robot[r]
    if state.switch.backlog[r] == NEWEST and radio.waiting > 0:
        results.drop_older(state, buffer, r, radio.entry - 1, now_ns)
        radio.waiting = 1
        if radio.stage == IDLE:
            serve(params, state, events, r, now_ns)


@kernel()
def stop(state, events, buffer, r, now_ns, fate):
    """The robot died: end its queue with `fate`; a frame on air continues."""
    radio = state.robot[r]
    for kind in (TIMER, CCA_END, SEND, SEND_ACK, ENQUEUE):
        cancel(events, kind, r)
    sending = radio.stage == SENDING
    if sending:
        state.packet[radio.packet].result = NO_RESULT
    elif radio.stage >= BACKING_OFF and (radio.stage == AWAITING_ACK or radio.attempt > 0):  # it was on air before
        results.record_last_attempt(state, buffer, r, now_ns)
    first = radio.next - (radio.stage >= BACKING_OFF)
    for at in range(first, radio.stop):
        index = state.order[at]
        packet = state.packet[index]
        if not packet.is_done and not (sending and index == radio.packet):
            results.record_at_sender(state, buffer, index, TOO_LARGE if packet.is_too_large else fate, now_ns)
    radio.next = radio.entry = radio.stop
    radio.waiting = 0
    if not sending:
        radio.stage, radio.packet = IDLE, NO_PACKET
        state.reception[r].is_deaf = radio.on_air != SILENT


def switches_of(disruption: Disruption) -> RadioSwitches:
    """The switches of the radios; those of dead robots are off."""
    drop_fate = np.where(disruption.alive, int(Fate.BLACKOUT), int(Fate.SENDER_DEAD))
    return RadioSwitches(disruption.alive & disruption.radio_on, disruption.active_backlog, drop_fate)


@kernel(from_python=True)
def switch(params, state, events, buffer, now_ns):
    """Apply radios that went off or on, by `state.switch`; call `order_queues` first.

    A packet in channel access restarts its attempt: its CCA is outdated when the radio is on again.
    """
    for r in range(len(state.robot)):
        radio = state.robot[r]
        if state.switch.backlog[r] != DROP:
            _hold_back(state, events, r)
            keep_newest(params, state, events, buffer, r, now_ns)
        elif radio.stage == HELD:
            begin(params, state, events, r, now_ns)


@kernel()
def _hold_back(state, events, r):
    radio = state.robot[r]
    if BACKING_OFF <= radio.stage <= TURNAROUND:
        cancel(events, TIMER, r)
        cancel(events, CCA_END, r)
        cancel(events, SEND, r)
        radio.stage = HELD
        state.reception[r].is_deaf = radio.on_air != SILENT
