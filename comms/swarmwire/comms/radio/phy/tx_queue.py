"""Transmit queues of the PHY: first in, first out, one packet in service at a time.

A radio that is off ends its packets, or suspends them until it is on again; the queue of a dead robot ends.
"""

# pyright: basic, reportUnknownMemberType=false

import numpy as np

from swarmwire.comms.base.kernels import kernel
from swarmwire.comms.base.sentinels import NO_FATE, NO_PACKET
from swarmwire.comms.radio.config.phy import METHODS
from swarmwire.comms.radio.disruption import ALL, DROP, NEWEST, Disruption
from swarmwire.comms.radio.phy import csma, dcf, duty_cycle, reception, results
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

QUEUE_FULL, TOO_LARGE, DUTY_CYCLE = int(Fate.QUEUE_FULL), int(Fate.TOO_LARGE), int(Fate.DUTY_CYCLE)
TX_QUEUE_FULL = int(TxResult.QUEUE_FULL)
CSMA = METHODS.index("csma-802154")


@kernel()
def enqueue(params, state, events, buffer, r, now_ns):
    """Admit packets sent by `now_ns` to the robot's queue, or end them: TOO_LARGE or QUEUE_FULL."""
    robot = state.robot[r]
    while robot.enqueue_next < robot.stop and state.packet[state.order[robot.enqueue_next]].sent_at_ns <= now_ns:
        index = state.order[robot.enqueue_next]
        packet = state.packet[index]
        packet.is_enqueued = 1
        robot.enqueue_next += 1
        if packet.is_too_large:
            results.record_at_sender(state, buffer, index, TOO_LARGE, now_ns)
        elif duty_cycle.exceeds(params, state, r, packet.airtime_ns, now_ns):
            results.record_at_sender(state, buffer, index, DUTY_CYCLE, now_ns)
        elif state.switch.backlog[r] != NEWEST and _is_full(params, state, r):
            packet.result = TX_QUEUE_FULL
            results.record_at_sender(state, buffer, index, QUEUE_FULL, now_ns)
        else:
            if state.switch.backlog[r] == NEWEST:
                results.drop_older(state, buffer, r, robot.enqueue_next - 1, now_ns)
            robot.waiting += 1
            if robot.mac_state == IDLE:
                serve(params, state, events, r, now_ns)
                dcf.defer(params, state, events, r, now_ns)
    if robot.enqueue_next < robot.stop:
        schedule(events, ENQUEUE, r, state.packet[state.order[robot.enqueue_next]].sent_at_ns)


@kernel()
def _is_full(params, state, r):
    """Return True if the robot's queue is full."""
    robot = state.robot[r]
    if state.switch.backlog[r] == ALL:
        return robot.waiting + (robot.mac_state == SUSPENDED) >= params.queue_limit
    return robot.mac_state != IDLE and robot.waiting >= params.queue_limit


@kernel()
def serve(params, state, events, r, now_ns):
    """Serve the next packet of a free radio, if there is one."""
    if _pop_next(state, r):
        begin_attempt(params, state, events, r, now_ns)


@kernel()
def _pop_next(state, r):
    """Remove the next packet from the queue, to serve it; return False and idle the radio if the queue is empty."""
    robot = state.robot[r]
    robot.mac_state, robot.packet = IDLE, NO_PACKET
    while robot.next < robot.enqueue_next and state.packet[state.order[robot.next]].is_done:
        robot.next += 1
    if robot.next == robot.enqueue_next:
        return False
    robot.packet = state.order[robot.next]
    robot.next += 1
    robot.waiting -= 1
    robot.attempt = robot.exponent = 0
    robot.last_fate = NO_FATE
    return True


@kernel()
def drop_expired(params, state, buffer, r, now_ns):
    """End packets that waited too long, or exceed the duty cycle; return True if a packet is left to send."""
    robot = state.robot[r]
    while robot.attempt == 0:
        packet = state.packet[robot.packet]
        if now_ns - packet.sent_at_ns > params.queue_lifetime_ns:
            packet.result = TX_QUEUE_FULL
            results.record_at_sender(state, buffer, robot.packet, QUEUE_FULL, now_ns)
        elif duty_cycle.exceeds(params, state, r, packet.airtime_ns, now_ns):
            results.record_at_sender(state, buffer, robot.packet, DUTY_CYCLE, now_ns)
        else:
            return True
        if not _pop_next(state, r):
            return False
    return True


@kernel()
def begin_attempt(params, state, events, r, now_ns):
    """Start an attempt at the packet being served, or suspend it if the radio is off."""
    robot = state.robot[r]
    if state.switch.backlog[r] != DROP:
        robot.mac_state = SUSPENDED
    elif params.method == CSMA:
        csma.request_access(params, state, events, r, now_ns)
    elif params.method == dcf.DCF:
        dcf.request_access(params, state, events, r, now_ns)
    else:
        robot.mac_state = BACKING_OFF
        lead_ns = params.lead_ns[r % params.robots]
        if lead_ns > 0:
            reception.stop_receiving(state, r)
        schedule(events, SEND, r, now_ns + lead_ns)


@kernel()
def wait_interframe(params, state, events, r, ifs_ns, now_ns):
    """Serve the next packet after a finished packet's interframe space or a new backoff."""
    robot = state.robot[r]
    if params.method == dcf.DCF:
        robot.exponent = 0
        dcf.draw_backoff(params, state, r)
    if ifs_ns == 0:
        serve(params, state, events, r, now_ns)
        return
    robot.mac_state, robot.packet = SPACING, NO_PACKET
    schedule(events, TIMER, r, now_ns + ifs_ns)


@kernel()
def keep_newest(params, state, events, buffer, r, now_ns):
    """End all waiting packets except the newest, if the backlog is NEWEST."""
    robot = state.robot[r]
    if state.switch.backlog[r] == NEWEST and robot.waiting > 0:
        results.drop_older(state, buffer, r, robot.enqueue_next - 1, now_ns)
        robot.waiting = 1
        if robot.mac_state == IDLE:
            serve(params, state, events, r, now_ns)


@kernel()
def stop(state, events, buffer, r, now_ns, fate):
    """End the queue of a robot that died with `fate`; its frame on air continues."""
    robot = state.robot[r]
    for kind in (TIMER, CCA_END, SEND, SEND_ACK, ENQUEUE):
        cancel(events, kind, r)
    is_sending = robot.mac_state == SENDING
    was_on_air = robot.mac_state == AWAITING_ACK or robot.attempt > 0
    if is_sending:
        state.packet[robot.packet].result = NO_RESULT
    elif robot.mac_state >= BACKING_OFF and was_on_air:
        results.record_last_attempt(state, buffer, r, now_ns)
    first = robot.next - (robot.mac_state >= BACKING_OFF)
    for i in range(first, robot.stop):
        index = state.order[i]
        packet = state.packet[index]
        if not packet.is_done and not (is_sending and index == robot.packet):
            results.record_at_sender(state, buffer, index, TOO_LARGE if packet.is_too_large else fate, now_ns)
    robot.next = robot.enqueue_next = robot.stop
    robot.waiting = 0
    if not is_sending:
        robot.mac_state, robot.packet = IDLE, NO_PACKET
        state.reception[r].is_deaf = robot.on_air != SILENT


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
        robot = state.robot[r]
        if state.switch.backlog[r] != DROP:
            _suspend(state, events, r)
            keep_newest(params, state, events, buffer, r, now_ns)
        elif robot.mac_state == SUSPENDED:
            begin_attempt(params, state, events, r, now_ns)


@kernel()
def _suspend(state, events, r):
    robot = state.robot[r]
    if BACKING_OFF <= robot.mac_state <= TURNAROUND:
        cancel(events, TIMER, r)
        cancel(events, CCA_END, r)
        cancel(events, SEND, r)
        robot.mac_state = SUSPENDED
        state.reception[r].is_deaf = robot.on_air != SILENT
