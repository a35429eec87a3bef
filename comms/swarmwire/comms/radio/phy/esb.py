"""Polling by Enhanced ShockBurst: a station polls its drones in turn, and these only answer.

A poll has the oldest packet that waits at the station for the drone, its answer the oldest that waits at the drone; a
null packet if nothing waits. Without an answer the poll is repeated after ARD, at most ARC times; then it is the next
drone's turn. Both packets end with their exchange. Packets to all are sent before the next poll, and not answered.

With Safelink, of cflib's driver and the Crazyflie's firmware, a packet of the station whose poll had no answer, and a
packet of a drone that the station did not receive, are in the next exchange again. A sequence bit for each direction
lets the receiver drop what it has already: a packet is received once. The link is lost, and these packets end, after
`MAX_SILENT` exchanges without an answer, until there is one.

A poll and its answer on air are frames of the kind DATA, also null packets. A station's `mac_state` is SPACING: it
serves no packet of its queue in order. A drone's packet in service waits in BACKING_OFF, until it is polled.
"""

# pyright: basic, reportUnknownMemberType=false

import numpy as np

from swarmwire.comms.base.kernels import kernel
from swarmwire.comms.base.sentinels import BROADCAST, NO_FATE, NO_PACKET
from swarmwire.comms.radio.disruption import DROP
from swarmwire.comms.radio.phy import reception, results, tx_queue
from swarmwire.comms.radio.phy.event_queue import (
    ENQUEUE,
    NO_EVENT,
    NOT_SCHEDULED_NS,
    OFF_AIR,
    SEND,
    SEND_ACK,
    TIMER,
    cancel,
    due_ns,
    schedule,
)
from swarmwire.comms.radio.phy.mac import next_event, order_queues, use_current_links
from swarmwire.comms.radio.phy.state import BACKING_OFF, DATA, IDLE, NO_RESULT, SENDING, SILENT, SPACING
from swarmwire.comms.robot.packets import Fate, TxResult

RECEIVED, QUEUE_FULL = int(Fate.RECEIVED), int(Fate.QUEUE_FULL)
ACKNOWLEDGED, TX_QUEUE_FULL = int(TxResult.ACKNOWLEDGED), int(TxResult.QUEUE_FULL)
MAX_ATTEMPTS = 16  # ARC + 1
MAX_SILENT = 100  # exchanges without an answer after which cflib's driver closes the link ("Too many packets lost")


@kernel(from_python=True, nogil=True)
def run_until(params, timing, polling, losses, state, events, buffer, max_links, from_ns, until_ns, start, is_new):
    """Handle the events due before `until_ns`, after `order_queues` if packets are new; none was since `from_ns`.

    Returns the time of the next event, NEVER_NS or BUFFER_IS_FULL, see `next_event`.
    """
    if is_new:
        order_queues(state, events, start)
        for r in range(len(state.robot)):
            if polling.station[r] == r:
                state.robot[r].mac_state = SPACING
                _wake(polling, state, events, buffer, r, from_ns)
    kind, r, now_ns = next_event(params, state, events, buffer, max_links, until_ns)
    while kind != NO_EVENT:
        is_station = polling.station[r] == r
        if kind == ENQUEUE:
            tx_queue.enqueue(params, state, events, buffer, r, now_ns)
            if is_station:
                _wake(polling, state, events, buffer, r, now_ns)
        elif kind == OFF_AIR:
            reception.end_frame(params, losses, state, events, r, now_ns)
            if is_station:
                _poll_ended(params, timing, polling, state, events, buffer, r, now_ns)
            else:
                _answer_ended(params, timing, polling, state, events, buffer, r, now_ns)
        elif kind == SEND_ACK:
            _answer(params, timing, polling, state, events, buffer, r, now_ns)
        elif not is_station:
            _admit(params, polling, state, events, buffer, r, now_ns)
        elif kind == SEND:
            _send_poll(params, timing, polling, state, events, r, now_ns)
        elif polling.awaits[r]:
            _ard_ended(params, timing, polling, state, events, buffer, r, now_ns)
        else:
            _begin_exchange(params, timing, polling, state, events, buffer, r, now_ns)
        kind, r, now_ns = next_event(params, state, events, buffer, max_links, until_ns)
    return now_ns


@kernel(from_python=True)
def end_exchanges(polling, state, events, buffer, now_ns):
    """End the exchanges of stations that are dead or off, see `state.switch`, after `order_queues`."""
    for r in range(len(state.robot)):
        if polling.station[r] == r and not state.switch.is_on[r]:
            cancel(events, TIMER, r)
            cancel(events, SEND, r)
            if polling.awaits[r]:
                _end_packet(polling, state, buffer, r, now_ns)
            if state.robot[r].on_air == SILENT:
                polling.sequence[r] = NO_PACKET
            polling.awaits[r] = False


@kernel(from_python=True)
def resume(params, polling, state, events, buffer, now_ns):
    """Start exchanges of stations that are on again, and end packets of radios that are off."""
    for r in range(len(state.robot)):
        if polling.station[r] != r:
            _admit(params, polling, state, events, buffer, r, now_ns)
        else:
            state.robot[r].mac_state = SPACING
            _wake(polling, state, events, buffer, r, now_ns)


@kernel()
def _wake(polling, state, events, buffer, r, now_ns):
    """Start an exchange of a station that has none; end the packets of a station that is off."""
    robot = state.robot[r]
    if not state.switch.is_on[r]:
        if state.switch.backlog[r] == DROP and robot.on_air == SILENT:
            for i in range(robot.next, robot.enqueue_next):
                if not state.packet[state.order[i]].is_done:
                    results.record_at_sender(state, buffer, state.order[i], state.switch.drop_fate[r], now_ns)
            robot.next, robot.waiting = robot.enqueue_next, 0
        return
    is_scheduled = due_ns(events, TIMER, r) != NOT_SCHEDULED_NS or due_ns(events, SEND, r) != NOT_SCHEDULED_NS
    has_any = polling.first[r] < polling.stop[r] or robot.waiting > 0
    if has_any and not is_scheduled and robot.on_air == SILENT:
        schedule(events, TIMER, r, now_ns)


@kernel()
def _begin_exchange(params, timing, polling, state, events, buffer, r, now_ns):
    """Choose the frame: the oldest packet to all, or the poll of the next drone; it starts once it is in the radio."""
    robot, to = state.robot[r], BROADCAST
    index = _oldest(params, polling, state, buffer, r, BROADCAST, now_ns)
    if index == NO_PACKET:
        if polling.first[r] == polling.stop[r]:
            return
        turn = polling.turn[r] + 1
        polling.turn[r] = turn if turn < polling.stop[r] else polling.first[r]
        to = polling.drones[polling.turn[r]]
        index = _oldest(params, polling, state, buffer, r, to, now_ns)
    robot.to, robot.last_fate = to, NO_FATE
    polling.exchange[r] += 1
    polling.attempt[r] = 0
    polling.sequence[r] = state.packet[index].sequence if index != NO_PACKET else NO_PACKET
    bits = state.packet[index].bits if index != NO_PACKET else timing.null_bits
    upload_ns = (bits - timing.frame_bits) * timing.upload_ns_per_bit
    schedule(events, SEND, r, now_ns + upload_ns + params.turnaround_ns)


@kernel()
def _oldest(params, polling, state, buffer, r, to, now_ns):
    """Return the station's oldest waiting packet to robot row `to` or BROADCAST, or NO_PACKET.

    Ends packets on the way that waited too long, and those to robots of which it is not the station.
    """
    robot = state.robot[r]
    while robot.next < robot.enqueue_next and state.packet[state.order[robot.next]].is_done:
        robot.next += 1
    for i in range(robot.next, robot.enqueue_next):
        index = state.order[i]
        packet = state.packet[index]
        if packet.is_done:
            continue
        if now_ns - packet.sent_at_ns > params.queue_lifetime_ns:
            packet.result = TX_QUEUE_FULL
            results.record_at_sender(state, buffer, index, QUEUE_FULL, now_ns)
            robot.waiting -= 1
        elif packet.to != BROADCAST and (packet.to < 0 or polling.station[packet.to] != r):
            packet.is_done = 1
            robot.waiting -= 1
        elif packet.to == to:
            return index
    return NO_PACKET


@kernel()
def _packet_of(polling, state, r):
    """Return the packet in the station's exchange, or NO_PACKET; rows of packets change, their numbers do not."""
    robot = state.robot[r]
    if polling.sequence[r] != NO_PACKET:
        for i in range(robot.next, robot.enqueue_next):
            packet = state.packet[state.order[i]]
            if packet.sequence == polling.sequence[r] and not packet.is_done:
                return state.order[i]
    return NO_PACKET


@kernel()
def _send_poll(params, timing, polling, state, events, r, now_ns):
    """Put the station's poll, or its packet to all, on air."""
    robot, index = state.robot[r], _packet_of(polling, state, r)
    bits, airtime_ns = timing.null_bits, timing.null_airtime_ns
    if index != NO_PACKET:
        packet = state.packet[index]
        packet.on_air_at_ns, bits, airtime_ns = now_ns, packet.bits, packet.airtime_ns
    robot.sequence = MAX_ATTEMPTS * polling.exchange[r] + polling.attempt[r]
    use_current_links(state, r)
    robot.on_air, robot.rate, robot.duration_ns = DATA, params.data_rate, 0
    reception.start_frame(params, state, events, r, now_ns, airtime_ns, bits)


@kernel()
def _poll_ended(params, timing, polling, state, events, buffer, r, now_ns):
    """Handle the end of a station's frame: the drone answers if it received the poll; ARD begins."""
    robot = state.robot[r]
    robot.packet = _packet_of(polling, state, r)
    if robot.packet != NO_PACKET:
        results.record_frame(params, state, events, buffer, r, now_ns)
    elif robot.to != BROADCAST and _is_received(state, r):
        schedule(events, SEND_ACK, robot.to, now_ns + params.sifs_ns)
    robot.packet = NO_PACKET
    if robot.to == BROADCAST or not state.switch.is_on[r]:
        _end_exchange(params, timing, polling, state, events, buffer, r, now_ns)
        return
    polling.awaits[r] = True
    schedule(events, TIMER, r, now_ns + params.ack_timeout_ns)


@kernel()
def _is_received(state, s):
    """Return True if the robot to which robot s sent its last frame received it."""
    robot = state.robot[s]
    for i in range(robot.first_link, robot.weak_link):
        if np.int64(state.link[i].receiver) == robot.to:
            return state.link[i].frame_fate == RECEIVED
    return False


@kernel()
def _answer(params, timing, polling, state, events, buffer, r, now_ns):
    """Answer a poll with the packet that waits, or with a null packet, unless the radio is off."""
    robot, station = state.robot[r], polling.station[r]
    if station == r or robot.on_air != SILENT or not state.switch.is_on[r]:
        return
    bits, airtime_ns = timing.null_bits, timing.null_airtime_ns
    if robot.mac_state == BACKING_OFF and tx_queue.drop_expired(params, state, buffer, r, now_ns):
        _admit(params, polling, state, events, buffer, r, now_ns)
    if robot.mac_state == BACKING_OFF:
        packet = state.packet[robot.packet]
        packet.on_air_at_ns, bits, airtime_ns = now_ns, packet.bits, packet.airtime_ns
        robot.mac_state, robot.attempt = SENDING, 1
    robot.to, robot.sequence = station, state.robot[station].sequence
    use_current_links(state, r)
    robot.on_air, robot.rate, robot.duration_ns = DATA, params.data_rate, 0
    reception.start_frame(params, state, events, r, now_ns, airtime_ns, bits)


@kernel()
def _answer_ended(params, timing, polling, state, events, buffer, r, now_ns):
    """Handle the end of an answer: if the station received it, the exchange has succeeded."""
    robot = state.robot[r]
    station, is_received = robot.to, _is_received(state, r)
    if robot.mac_state == SENDING:
        results.record_frame(params, state, events, buffer, r, now_ns)
        cancel(events, SEND_ACK, station)  # which `record_frame` scheduled
        robot.mac_state = BACKING_OFF
        if state.packet[robot.packet].result == NO_RESULT:  # the drone died
            results.record_last_attempt(state, buffer, r, now_ns)
            robot.mac_state, robot.packet = IDLE, NO_PACKET
        elif not state.switch.is_on[r]:
            tx_queue.begin_attempt(params, state, events, r, now_ns)
    if is_received and polling.awaits[station] and state.robot[station].to == r:
        cancel(events, TIMER, station)
        polling.silent[r] = 0
        index = _packet_of(polling, state, station)
        if index != NO_PACKET:
            state.packet[index].result = ACKNOWLEDGED
        _end_exchange(params, timing, polling, state, events, buffer, station, now_ns)


@kernel()
def _ard_ended(params, timing, polling, state, events, buffer, r, now_ns):
    """Handle a poll without an answer: repeat it, or give up after ARC repetitions."""
    polling.awaits[r] = False
    if polling.attempt[r] < params.max_retries:
        polling.attempt[r] += 1
        _send_poll(params, timing, polling, state, events, r, now_ns)
    else:
        polling.silent[state.robot[r].to] += 1
        _end_exchange(params, timing, polling, state, events, buffer, r, now_ns)


@kernel()
def _end_exchange(params, timing, polling, state, events, buffer, r, now_ns):
    """End the packets of the station's exchange, or repeat them with Safelink, and schedule the next exchange.

    Without Safelink a drone's radio takes its packet for sent when the next poll comes, also if its answers were lost.
    """
    to = state.robot[r].to
    has_link = timing.has_safelink and to != BROADCAST and polling.silent[to] < MAX_SILENT
    if not (has_link and polling.silent[to] > 0 and state.switch.is_on[r]):
        _end_packet(polling, state, buffer, r, now_ns)
    polling.sequence[r], polling.awaits[r] = NO_PACKET, False
    if to != BROADCAST and state.robot[to].attempt > 0 and state.robot[to].mac_state >= BACKING_OFF:
        packet = state.packet[state.robot[to].packet]
        if packet.is_settled or not has_link:
            packet.result = ACKNOWLEDGED
            results.record_last_attempt(state, buffer, to, now_ns)
            tx_queue.serve(params, state, events, to, now_ns)
    if state.switch.is_on[r]:
        schedule(events, TIMER, r, now_ns + timing.idle_ns)
    else:
        _wake(polling, state, events, buffer, r, now_ns)


@kernel()
def _end_packet(polling, state, buffer, r, now_ns):
    """End the packet in the station's exchange with the fate of its last attempt."""
    robot = state.robot[r]
    robot.packet = _packet_of(polling, state, r)
    if robot.packet != NO_PACKET:
        if robot.to == BROADCAST:
            state.packet[robot.packet].is_done = 1
        else:
            results.record_last_attempt(state, buffer, r, now_ns)
        robot.waiting -= 1
    robot.packet = NO_PACKET


@kernel()
def _admit(params, polling, state, events, buffer, r, now_ns):
    """Leave a drone's packet in service if it waits for a poll, or end it.

    Only the station hears a drone: a packet to another robot ends, and one to all reaches the station alone. If the
    radio is off and drops its packets, it ends as well.
    """
    robot = state.robot[r]
    while robot.mac_state == BACKING_OFF:
        packet = state.packet[robot.packet]
        if not state.switch.is_on[r]:
            if robot.attempt > 0:
                results.record_last_attempt(state, buffer, r, now_ns)
            else:
                results.record_at_sender(state, buffer, robot.packet, state.switch.drop_fate[r], now_ns)
        elif packet.to == BROADCAST or packet.to == polling.station[r]:
            packet.to = polling.station[r]
            return
        else:
            packet.is_done = 1
        tx_queue.serve(params, state, events, r, now_ns)
