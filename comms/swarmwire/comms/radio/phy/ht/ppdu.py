"""Queues of 802.11n: the packets of the next PPDU, and the ends of packets.

A packet waits until the sender knows that it was received, or its lifetime ends. It is retried in its order, together
with newer ones to the same robot, and its receiver passes packets on in this order, as under a block acknowledgement
agreement, which is assumed for every pair of robots.
"""

# pyright: basic, reportUnknownMemberType=false

from swarmwire.comms.base.kernels import kernel
from swarmwire.comms.base.sentinels import ABSENT, BROADCAST, NO_FATE, NO_ROBOT, NOWHERE
from swarmwire.comms.radio.phy import results
from swarmwire.comms.radio.phy.ht.params import DELIMITER_BYTES, MAX_MPDUS, MAX_PPDU_NS, NO_LIMIT, frame_ns
from swarmwire.comms.radio.phy.ht.rate_control import rate_to
from swarmwire.comms.robot.packets import Fate, TxResult

RECEIVED, BLACKOUT, QUEUE_FULL = int(Fate.RECEIVED), int(Fate.BLACKOUT), int(Fate.QUEUE_FULL)
SENDER_DEAD, RECEIVER_DEAD = int(Fate.SENDER_DEAD), int(Fate.RECEIVER_DEAD)
ACKNOWLEDGED, TX_QUEUE_FULL = int(TxResult.ACKNOWLEDGED), int(TxResult.QUEUE_FULL)


@kernel()
def head(state, r):
    """Return the index in `state.order` of the robot's first packet that waits for a frame, or ABSENT."""
    robot = state.robot[r]
    while robot.next < robot.enqueue_next and state.packet[state.order[robot.next]].is_done:
        robot.next += 1
    for k in range(robot.next, robot.enqueue_next):
        packet = state.packet[state.order[k]]
        if not (packet.is_done or packet.is_acked):
            return k
    return ABSENT


@kernel()
def build(params, state, r, first):
    """Select the MPDUs of the next PPDU: the packet at index `first`, and those to the same robot that may join it."""
    robot, station, ht = state.robot[r], state.ht.station[r], params.ht
    to = state.packet[state.order[first]].to
    rate = params.broadcast_rate if to == BROADCAST else rate_to(params, state, r, to)
    is_single = to in (BROADCAST, NOWHERE) or ht.max_ampdu_bytes == 0
    station.to, station.rate, station.first, station.count, station.psdu_bytes = to, rate, first, 0, 0
    peer = state.ht.peer[r, max(to, 0) % params.robots]
    window_end = padded = 0
    for k in range(first, robot.enqueue_next):
        packet = state.packet[state.order[k]]
        if packet.to != to or packet.is_done or packet.is_acked:
            continue
        size = packet.bits // 8
        if station.count == 0:
            psdu_bytes = size
        else:
            psdu_bytes = padded + DELIMITER_BYTES + size
            number = packet.number if packet.number > 0 else peer.number + 1
            is_within = number < window_end and station.count < MAX_MPDUS and psdu_bytes <= ht.max_ampdu_bytes
            if not is_within or frame_ns(ht, rate, psdu_bytes) > MAX_PPDU_NS:
                break
            if station.count == 1:
                state.packet[state.order[first]].offset_bytes = DELIMITER_BYTES
        if packet.number == 0 and not is_single:
            peer.number += 1
            packet.number = peer.number
        if station.count == 0:
            window_end = packet.number + MAX_MPDUS
        packet.is_in_ppdu, packet.offset_bytes = 1, padded + (DELIMITER_BYTES if station.count > 0 else 0)
        station.count, station.psdu_bytes = station.count + 1, psdu_bytes
        padded += -(-(DELIMITER_BYTES + size) // DELIMITER_BYTES) * DELIMITER_BYTES
        if is_single:
            break


@kernel()
def dissolve(state, r):
    """Return the MPDUs of the PPDU to the queue."""
    station = state.ht.station[r]
    remaining, k = station.count, station.first
    while remaining > 0:
        packet = state.packet[state.order[k]]
        remaining -= packet.is_in_ppdu
        packet.is_in_ppdu = 0
        k += 1
    station.count = 0


@kernel()
def acknowledge(state, s, r, is_block):
    """Note that robot s knows what robot r received; return the share of the PPDU."""
    robot, station = state.robot[s], state.ht.station[s]
    received, members = 0, station.count
    for k in range(robot.next, robot.enqueue_next):
        packet = state.packet[state.order[k]]
        if packet.to != r or packet.is_done or packet.is_acked:
            continue
        if packet.attempts == 0:
            break
        if packet.is_received and (is_block or packet.is_in_ppdu):
            received += packet.is_in_ppdu
            packet.is_acked, packet.result = 1, ACKNOWLEDGED
            packet.is_done = packet.is_settled
            robot.waiting -= 1
    dissolve(state, s)
    station.requests = 0
    if station.request_to == r:
        station.request_to = NO_ROBOT
    return received / max(members, 1)


@kernel()
def count_request(state, r, to):
    """Count an unanswered request as an attempt of the packets that wait for its answer; return False without any."""
    is_any, robot = False, state.robot[r]
    for k in range(robot.next, robot.enqueue_next):
        packet = state.packet[state.order[k]]
        if packet.to == to and packet.attempts > 0 and not (packet.is_done or packet.is_acked):
            packet.attempts += 1
            is_any = True
    return is_any


@kernel()
def pass_on(state, buffer, r, to, now_ns):
    """Record the packets of robot r that their receiver passes on: those received up to the first one that it lacks."""
    robot = state.robot[r]
    for k in range(robot.next, robot.enqueue_next):
        packet = state.packet[state.order[k]]
        if packet.to != to or packet.is_done:
            continue
        if not packet.is_received:
            break
        settle(state, buffer, r, state.order[k], now_ns)


@kernel()
def settle(state, buffer, r, index, now_ns):
    """Record the reception of a packet, unless it is recorded already."""
    packet = state.packet[index]
    if not packet.is_settled:
        packet.is_settled = 1
        fate, to = RECEIVED, packet.to
        if not state.switch.is_on[to]:  # held until now
            fate = RECEIVER_DEAD if state.switch.drop_fate[to] == SENDER_DEAD else BLACKOUT
        results.record(state, buffer, index, to, fate, 1, now_ns, state.robot[r].pose_id, packet.last_mw)
    packet.is_done = packet.is_acked


@kernel()
def end_packet(state, buffer, r, index, fate, now_ns):
    """End a packet with the fate of its last attempt, or with `fate` if it was never on air."""
    robot, packet = state.robot[r], state.packet[index]
    robot.waiting -= 1 - packet.is_acked
    packet.is_in_ppdu = 0
    if packet.attempts == 0:
        results.record_at_sender(state, buffer, index, fate, now_ns)
        return
    if packet.is_received:
        settle(state, buffer, r, index, now_ns)
    elif packet.last_fate != NO_FATE:
        packet.is_settled = 1
        in_range, mw = packet.last_in_range, packet.last_mw
        results.record(state, buffer, index, packet.to, packet.last_fate, in_range, now_ns, robot.pose_id, mw)
    packet.is_done = 1


@kernel()
def drop_finished(params, state, buffer, r, now_ns):
    """End packets whose lifetime or attempts have ended; those behind them are passed on."""
    robot = state.robot[r]
    for k in range(robot.next, robot.enqueue_next):
        index = state.order[k]
        packet = state.packet[index]
        if packet.is_done or packet.is_acked or packet.is_in_ppdu:
            continue
        is_late = now_ns - packet.sent_at_ns > params.queue_lifetime_ns
        if is_late or packet.attempts >= params.ht.max_attempts:
            if packet.attempts == 0:
                packet.result = TX_QUEUE_FULL
            end_packet(state, buffer, r, index, QUEUE_FULL, now_ns)
            if packet.to >= 0 and packet.attempts > 0:
                pass_on(state, buffer, r, packet.to, now_ns)
                if params.ht.max_ampdu_bytes > 0:  # moves the receiver's window
                    state.ht.station[r].request_to = packet.to
                if not is_late:
                    state.ht.peer[r, packet.to % params.robots].sinr = 0.0
        elif packet.attempts == 0 and params.ht.max_attempts == NO_LIMIT:
            break  # those behind it are younger


@kernel()
def drop_older(state, buffer, r, newest, now_ns):
    """End packets that wait before index `newest` of `state.order`, since the radio is off: BLACKOUT."""
    robot = state.robot[r]
    for k in range(robot.next, newest):
        packet = state.packet[state.order[k]]
        if not (packet.is_done or packet.is_in_ppdu):
            end_packet(state, buffer, r, state.order[k], BLACKOUT, now_ns)
