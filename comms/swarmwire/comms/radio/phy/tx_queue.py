"""Transmit queues of the PHY: first in, first out, one packet in service at a time.

A radio that is off ends its packets, or suspends them until it is on again; the queue of a dead robot ends.
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
    IDLE,
    NO_RESULT,
    SENDING,
    SILENT,
    SPACING,
    SUSPENDED,
    TURNAROUND,
    RadioSwitches,
)
from swarmwire.comms.robot.packets import Fate, TxResult

QUEUE_FULL, TOO_LARGE, QUEUE_FULL_RESULT = int(Fate.QUEUE_FULL), int(Fate.TOO_LARGE), int(TxResult.QUEUE_FULL)
CSMA = METHODS.index("csma-802154")


@kernel()
def enter(params, state, events, buffer, r, now_ns):
    """Admit packets sent by `now_ns` to the robot's queue, or end them: TOO_LARGE or QUEUE_FULL."""
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
    """Return True if the robot's queue is full."""
    radio = state.robot[r]
    if state.switch.backlog[r] == ALL:
        return radio.waiting + (radio.stage == SUSPENDED) >= params.queue_limit
    return radio.stage != IDLE and radio.waiting >= params.queue_limit


@kernel()
def serve(params, state, events, r, now_ns):
    """Serve the next packet of a free radio, if there is one."""
    if _pop_next(state, r):
        begin(params, state, events, r, now_ns)


@kernel()
def _pop_next(state, r):
    """Remove the next packet from the queue, to serve it; return False and idle the radio if the queue is empty."""
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
    """End packets that waited too long before the radio may send; return False if no packet is left."""
    radio = state.robot[r]
    while radio.attempt == 0 and now_ns - state.packet[radio.packet].sent_at_ns > params.queue_lifetime_ns:
        state.packet[radio.packet].result = QUEUE_FULL_RESULT
        results.record_at_sender(state, buffer, radio.packet, QUEUE_FULL, now_ns)
        if not _pop_next(state, r):
            return False
    return True


@kernel()
def begin(params, state, events, r, now_ns):
    """Start an attempt at the packet being served, or suspend it if the radio is off."""
    radio = state.robot[r]
    if state.switch.backlog[r] != DROP:
        radio.stage = SUSPENDED
    elif params.method == CSMA:
        csma.request_access(params, state, events, r, now_ns)
    elif params.method == dcf.DCF:
        dcf.request_access(params, state, events, r, now_ns)
    else:
        radio.stage = BACKING_OFF
        schedule(events, SEND, r, now_ns)


@kernel()
def pause(params, state, events, r, pause_ns, now_ns):
    """Serve the next packet after a finished packet's interframe space or a new backoff."""
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
    """End all waiting packets except the newest, if the backlog is NEWEST."""
    radio = state.robot[r]
    if state.switch.backlog[r] == NEWEST and radio.waiting > 0:
        results.drop_older(state, buffer, r, radio.entry - 1, now_ns)
        radio.waiting = 1
        if radio.stage == IDLE:
            serve(params, state, events, r, now_ns)


@kernel()
def stop(state, events, buffer, r, now_ns, fate):
    """End the queue of a robot that died with `fate`; its frame on air continues."""
    radio = state.robot[r]
    for kind in (TIMER, CCA_END, SEND, SEND_ACK, ENQUEUE):
        cancel(events, kind, r)
    is_sending = radio.stage == SENDING
    if is_sending:
        state.packet[radio.packet].result = NO_RESULT
    elif radio.stage >= BACKING_OFF and (radio.stage == AWAITING_ACK or radio.attempt > 0):  # the packet was on air
        results.record_last_attempt(state, buffer, r, now_ns)
    first = radio.next - (radio.stage >= BACKING_OFF)
    for i in range(first, radio.stop):
        index = state.order[i]
        packet = state.packet[index]
        if not packet.is_done and not (is_sending and index == radio.packet):
            results.record_at_sender(state, buffer, index, TOO_LARGE if packet.is_too_large else fate, now_ns)
    radio.next = radio.entry = radio.stop
    radio.waiting = 0
    if not is_sending:
        radio.stage, radio.packet = IDLE, NO_PACKET
        state.reception[r].is_deaf = radio.on_air != SILENT


def switches_of(disruption: Disruption) -> RadioSwitches:
    """Return the switches of the radios; those of dead robots are off."""
    drop_fate = np.where(disruption.alive, int(Fate.BLACKOUT), int(Fate.SENDER_DEAD))
    return RadioSwitches(disruption.alive & disruption.radio_on, disruption.active_backlog, drop_fate)


@kernel(from_python=True)
def switch(params, state, events, buffer, now_ns):
    """Suspend or resume the queues of radios that were switched, see `state.switch`, after `order_queues`.

    A packet in channel access restarts its attempt, since its CCA is outdated when the radio is on again.
    """
    for r in range(len(state.robot)):
        radio = state.robot[r]
        if state.switch.backlog[r] != DROP:
            _suspend(state, events, r)
            keep_newest(params, state, events, buffer, r, now_ns)
        elif radio.stage == SUSPENDED:
            begin(params, state, events, r, now_ns)


@kernel()
def _suspend(state, events, r):
    radio = state.robot[r]
    if BACKING_OFF <= radio.stage <= TURNAROUND:
        cancel(events, TIMER, r)
        cancel(events, CCA_END, r)
        cancel(events, SEND, r)
        radio.stage = SUSPENDED
        state.reception[r].is_deaf = radio.on_air != SILENT
