"""Responses to frames of 802.11n: acknowledgements, block acknowledgements and CTS, their timeouts, and NAV resets."""

# pyright: basic, reportUnknownMemberType=false

import numpy as np

from swarmwire.comms.base.kernels import kernel
from swarmwire.comms.base.sentinels import NO_ROBOT
from swarmwire.comms.radio.phy.event_queue import CCA_END, SEND, SEND_ACK, TIMER, cancel, schedule
from swarmwire.comms.radio.phy.ht import ppdu
from swarmwire.comms.radio.phy.ht.params import (
    ACK_BYTES,
    BASIC_RATE,
    BLOCK_ACK_BYTES,
    CTS_BYTES,
    NO_LIMIT,
    REQUEST_ATTEMPTS,
)
from swarmwire.comms.radio.phy.ht.rate_control import report_failure, report_success
from swarmwire.comms.radio.phy.ht.state import BLOCK_ACK, CTS
from swarmwire.comms.radio.phy.ht.station import finish, put_on_air
from swarmwire.comms.radio.phy.state import AWAITING_ACK, BACKING_OFF, SILENT, TURNAROUND
from swarmwire.comms.robot.packets import Fate

RECEIVED = int(Fate.RECEIVED)
HALF = 0.5  # share of a PPDU that a receiver must have for a success of the bit rate
NAV_RESET = CCA_END  # kind of event: DCF has no CCA of its own


@kernel()
def schedule_response(params, state, events, r, i, kind, rate, duration_ns, now_ns):
    """Schedule the response of the receiver on link i to the frame of robot r."""
    to, power_mw = np.int64(state.link[i].receiver), state.link[i].power_mw
    receiver = state.ht.station[to]
    receiver.answer, receiver.answer_duration_ns = kind, duration_ns
    receiver.answer_rate = BASIC_RATE if kind == CTS else params.ht.control_rate[rate]
    receiver.answer_sinr = power_mw / (params.noise_mw + state.reception[to].jam_mw)
    state.robot[to].ack_to = r
    schedule(events, SEND_ACK, to, now_ns + params.sifs_ns)


@kernel()
def respond(params, state, events, r, now_ns):
    """Send the response that is due, busy medium or not, unless the radio sends, is about to send, or is off."""
    robot, station = state.robot[r], state.ht.station[r]
    if robot.on_air != SILENT or robot.mac_state == TURNAROUND or not state.switch.is_on[r]:
        robot.ack_to = NO_ROBOT
        return
    octets = BLOCK_ACK_BYTES if station.answer == BLOCK_ACK else CTS_BYTES if station.answer == CTS else ACK_BYTES
    duration_ns = station.answer_duration_ns
    put_on_air(params, state, events, r, now_ns, station.answer, station.answer_rate, octets, duration_ns)


@kernel()
def answered(params, state, events, r, s, kind, now_ns):
    """Handle the response of robot r at robot s, which decoded it."""
    robot, station = state.robot[s], state.ht.station[s]
    if robot.mac_state != AWAITING_ACK or station.awaits != kind or station.to != r:
        return
    cancel(events, TIMER, s)
    if kind == CTS:
        robot.mac_state = TURNAROUND
        schedule(events, SEND, s, now_ns + params.sifs_ns)
        return
    is_ppdu = station.count > 0
    share = ppdu.acknowledge(state, s, r, kind == BLOCK_ACK)
    if is_ppdu and share < HALF:
        report_failure(params, state, s, r)
    else:
        report_success(params, state, s, r, state.ht.station[r].answer_sinr)
    finish(params, state, events, s, now_ns, False)


@kernel()
def timer_expired(params, state, events, r, now_ns):
    """Handle a timeout: without a response that has begun, the exchange has failed."""
    station = state.ht.station[r]
    source = np.int64(state.reception[r].locked_to)
    if source != NO_ROBOT:
        schedule(events, TIMER, r, state.robot[source].on_air_ns + state.robot[source].airtime_ns)
        return
    if station.awaits == BLOCK_ACK:
        station.request_to = station.to
        station.requests = 0 if station.count > 0 else station.requests + 1
        is_awaited = station.count > 0 or ppdu.count_request(state, r, station.to)
        limit = REQUEST_ATTEMPTS if params.ht.max_attempts == NO_LIMIT else 1
        if not is_awaited and station.requests >= limit:
            station.request_to, station.requests = NO_ROBOT, 0
    if station.count > 0:
        report_failure(params, state, r, station.to)
        ppdu.dissolve(state, r)
    finish(params, state, events, r, now_ns, True)


@kernel()
def start_nav_resets(params, state, events, r, now_ns):
    """Have the stations that decoded an RTS of robot r reset their NAV if no frame follows (2020: 10.3.2.4)."""
    robot = state.robot[r]
    for i in range(robot.first_link, robot.weak_link):
        link = state.link[i]
        if link.frame_fate == RECEIVED and link.receiver != robot.to:
            schedule(events, NAV_RESET, np.int64(link.receiver), now_ns + params.ht.nav_reset_ns)


@kernel()
def reset_nav(params, state, events, r, now_ns):
    """Reset the NAV of a station that receives no frame when the announced one should have begun."""
    robot, rx = state.robot[r], state.reception[r]
    if rx.locked_to != NO_ROBOT or robot.nav_until_ns <= now_ns:
        return
    robot.nav_until_ns = now_ns
    if not rx.is_busy:
        robot.free_from_ns = max(now_ns, robot.eifs_until_ns)
        if robot.mac_state == BACKING_OFF:
            slots_ns = robot.backoff_slots * params.slot_ns
            schedule(events, SEND, r, robot.free_from_ns + params.difs_ns + slots_ns)
