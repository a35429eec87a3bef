"""The MAC of 802.11n: frame exchange sequences of RTS, CTS, PPDU, acknowledgement and block acknowledgement.

A PPDU to one robot aggregates packets (A-MPDU), each with an outcome of its own, and a block acknowledgement answers
it; a normal acknowledgement answers a single packet. What it lacks is sent again, with the next packets. If no block
acknowledgement comes, the sender asks for it by a request. RTS and CTS reserve the medium before long PPDUs. Each
exchange has an access of its own.
"""

# pyright: basic, reportUnknownMemberType=false

import numpy as np

from swarmwire.comms.base.kernels import kernel
from swarmwire.comms.base.sentinels import ABSENT, BROADCAST, NO_FATE, NO_PACKET, NO_ROBOT
from swarmwire.comms.radio.phy import reception, results
from swarmwire.comms.radio.phy.event_queue import TIMER, schedule
from swarmwire.comms.radio.phy.ht import ppdu
from swarmwire.comms.radio.phy.ht.params import (
    ACK_BYTES,
    BASIC_RATE,
    BLOCK_ACK_BYTES,
    CTS_BYTES,
    REQUEST_BYTES,
    RTS_BYTES,
    frame_ns,
)
from swarmwire.comms.radio.phy.ht.rate_control import rate_to
from swarmwire.comms.radio.phy.ht.responses import answered, schedule_response, start_nav_resets
from swarmwire.comms.radio.phy.ht.state import BLOCK_ACK, BLOCK_ACK_REQUEST, CTS, RTS
from swarmwire.comms.radio.phy.ht.station import begin, finish, put_on_air
from swarmwire.comms.radio.phy.state import (
    ACKNOWLEDGEMENT,
    AWAITING_ACK,
    DATA,
    IDLE,
    NO_RESULT,
    SENDING,
    SILENT,
    TURNAROUND,
)
from swarmwire.comms.robot.packets import Fate

RECEIVED, SENDER_DEAD = int(Fate.RECEIVED), int(Fate.SENDER_DEAD)


@kernel()
def send(params, state, events, buffer, r, now_ns):
    """Put the first frame of the next exchange on air, or, after a CTS, the PPDU."""
    robot, station, ht = state.robot[r], state.ht.station[r], params.ht
    is_reserved = robot.mac_state == TURNAROUND
    if robot.on_air != SILENT:  # the radio is still sending a response
        if is_reserved:
            ppdu.dissolve(state, r)
        begin(params, state, events, r, now_ns)
        return
    if not is_reserved:
        ppdu.drop_finished(params, state, buffer, r, now_ns)
        first = ppdu.head(state, r)
        if first != ABSENT and not state.switch.is_on[r]:
            ppdu.end_packet(state, buffer, r, state.order[first], state.switch.drop_fate[r], now_ns)
            first = ABSENT
        if first == ABSENT:
            begin(params, state, events, r, now_ns)
            return
        robot.packet = state.order[first]
        if station.request_to != NO_ROBOT and _is_any_waiting(state, r, station.request_to):
            station.to, station.awaits, robot.mac_state = station.request_to, BLOCK_ACK, SENDING
            station.rate = rate_to(params, state, r, station.to)  # the last PPDU may have been a broadcast
            rate = ht.control_rate[station.rate]
            duration_ns = params.sifs_ns + frame_ns(ht, rate, BLOCK_ACK_BYTES)
            put_on_air(params, state, events, r, now_ns, BLOCK_ACK_REQUEST, rate, REQUEST_BYTES, duration_ns)
            return
        station.request_to = NO_ROBOT
        ppdu.build(params, state, r, first)
    airtime_ns, response_ns = frame_ns(ht, station.rate, station.psdu_bytes), np.int64(0)
    if station.to != BROADCAST and params.acknowledged:
        response_bytes = ACK_BYTES if station.count == 1 else BLOCK_ACK_BYTES
        response_ns = params.sifs_ns + frame_ns(ht, ht.control_rate[station.rate], response_bytes)
    robot.mac_state = SENDING
    if station.to >= 0 and station.psdu_bytes > ht.rts_threshold_bytes and not is_reserved:
        station.awaits = CTS
        cts_ns = params.sifs_ns + frame_ns(ht, BASIC_RATE, CTS_BYTES)
        duration_ns = cts_ns + params.sifs_ns + airtime_ns + response_ns
        put_on_air(params, state, events, r, now_ns, RTS, BASIC_RATE, RTS_BYTES, duration_ns)
        return
    station.awaits = ACKNOWLEDGEMENT if station.count == 1 else BLOCK_ACK
    remaining, k = station.count, station.first
    while remaining > 0:
        packet = state.packet[state.order[k]]
        k += 1
        if packet.is_in_ppdu:
            remaining -= 1
            packet.attempts += 1
            # Each packet counts its share, so that their sum is the airtime of the PPDU.
            packet.on_air_at_ns, packet.airtime_ns = now_ns, airtime_ns // station.count
            packet.last_fate = RECEIVED
    put_on_air(params, state, events, r, now_ns, DATA, station.rate, station.psdu_bytes, response_ns)


@kernel()
def _is_any_waiting(state, r, to):
    """Return True if a packet of robot r to robot `to` waits for a frame or its acknowledgement."""
    robot = state.robot[r]
    for k in range(robot.next, robot.enqueue_next):
        packet = state.packet[state.order[k]]
        if packet.to == to and not (packet.is_done or packet.is_acked):
            return True
    return False


@kernel()
def frame_ended(params, losses, state, events, buffer, r, now_ns):
    """Handle the end of the robot's frame: its receiver responds, and its sender awaits the response."""
    robot = state.robot[r]
    kind = robot.on_air
    reception.end_frame(params, losses, state, events, r, now_ns)
    i = _link_to(state, r, robot.to)
    is_decoded = i != ABSENT and state.link[i].frame_fate == RECEIVED
    if kind in (ACKNOWLEDGEMENT, BLOCK_ACK, CTS):
        robot.ack_to = NO_ROBOT
        if is_decoded:
            answered(params, state, events, r, robot.to, kind, now_ns)
        return
    if robot.packet == NO_PACKET:
        return  # the robot died
    station = state.ht.station[r]
    if kind == DATA:
        is_decoded = _record(state, buffer, r, i, now_ns)
        if robot.to == BROADCAST or not params.acknowledged or state.packet[robot.packet].result == NO_RESULT:
            _end_unanswered(params, state, events, buffer, r, now_ns)
            if is_decoded and params.acknowledged and robot.to != BROADCAST:
                schedule_response(params, state, events, r, i, ACKNOWLEDGEMENT, station.rate, np.int64(0), now_ns)
            return
        if is_decoded:
            schedule_response(params, state, events, r, i, station.awaits, station.rate, np.int64(0), now_ns)
    elif kind == RTS:
        start_nav_resets(params, state, events, r, now_ns)
        if is_decoded and state.robot[robot.to].nav_until_ns <= now_ns:
            duration_ns = robot.duration_ns - params.sifs_ns - frame_ns(params.ht, BASIC_RATE, CTS_BYTES)
            schedule_response(params, state, events, r, i, CTS, np.int64(0), duration_ns, now_ns)
    elif is_decoded:
        schedule_response(params, state, events, r, i, BLOCK_ACK, station.rate, np.int64(0), now_ns)
    robot.mac_state = AWAITING_ACK
    schedule(events, TIMER, r, now_ns + params.ht.wait_ns)


@kernel()
def _link_to(state, r, to):
    """Return the row of the strong link of the robot's last frame to robot `to`, or ABSENT."""
    robot = state.robot[r]
    for i in range(robot.first_link, robot.weak_link):
        if state.link[i].receiver == to:
            return i
    return ABSENT


@kernel()
def _record(state, buffer, r, i, now_ns):
    """Write the fates of the packets of a PPDU that ends, on link i or ABSENT; return True if one was received."""
    robot, station = state.robot[r], state.ht.station[r]
    if robot.to == BROADCAST:
        results.record_broadcast(state, buffer, r, now_ns)
        return True
    is_any, remaining, k = False, station.count, station.first
    while remaining > 0:
        packet = state.packet[state.order[k]]
        k += 1
        if packet.is_in_ppdu == 0:
            continue
        remaining -= 1
        if i == ABSENT:
            packet.last_fate = NO_FATE
            continue
        link = state.link[i]
        fate = packet.last_fate if link.frame_fate == RECEIVED else np.int64(link.frame_fate)
        is_any = is_any or fate == RECEIVED
        packet.is_received = packet.is_received or fate == RECEIVED
        packet.last_in_range, packet.last_mw = fate != results.BLOCKED, link.power_mw
        packet.last_fate = fate if link.above_sensitivity or fate == RECEIVED else NO_FATE
    if is_any:
        ppdu.pass_on(state, buffer, r, robot.to, now_ns)
    return is_any


@kernel()
def _end_unanswered(params, state, events, buffer, r, now_ns):
    """End the packets of a PPDU to which no response is due, and those of a sender that died."""
    robot, station = state.robot[r], state.ht.station[r]
    is_dead = state.packet[robot.packet].result == NO_RESULT
    remaining, k = station.count, station.first
    while remaining > 0:
        packet = state.packet[state.order[k]]
        if packet.is_in_ppdu:
            remaining -= 1
            packet.is_in_ppdu = 0
            if robot.to == BROADCAST:
                packet.is_done = 1
                robot.waiting -= 1
            else:
                ppdu.end_packet(state, buffer, r, state.order[k], SENDER_DEAD, now_ns)
        k += 1
    station.count = 0
    if is_dead:
        robot.mac_state, robot.packet = IDLE, NO_PACKET
    else:
        finish(params, state, events, r, now_ns, False)
