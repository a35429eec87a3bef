"""Bluetooth LE advertising: an event sends its PDU on each channel in turn, and a scanner listens to one at a time.

A packet is one advertising event: after advDelay, U{0 … max_delay_s}, its PDUs follow one another with a gap. They are
attempts at one packet, which a receiver receives once. PDU k is on channel k (37, 38, 39), where alone it interferes.

`PhyState.reception` has a row per channel and robot: of robot r on channel c it is row c x robots + r. A robot locks to
frames on the channel that its scanner is on, and loses a frame if its scanner leaves the channel before the end. In
its own event, gaps included, it receives nothing. An event uses the links of its begin.
"""

# pyright: basic, reportUnknownMemberType=false

from typing import NamedTuple

import numpy as np

from swarmwire.comms.base.arrays import IntArray, KeyArray
from swarmwire.comms.base.clock import to_ns
from swarmwire.comms.base.draws import purpose, uniform
from swarmwire.comms.base.draws_compiled import uniform as compiled_uniform
from swarmwire.comms.base.kernels import kernel
from swarmwire.comms.base.sentinels import BROADCAST, UNDER_WAY
from swarmwire.comms.radio.config.phy import Advertising
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.phy import mac, reception, results, tx_queue
from swarmwire.comms.radio.phy.event_queue import ENQUEUE, NO_EVENT, OFF_AIR, SEND, schedule
from swarmwire.comms.radio.phy.mac import next_event, use_current_links
from swarmwire.comms.radio.phy.params import FOREVER_NS
from swarmwire.comms.radio.phy.state import DATA, RECEIVING, SENDING, SILENT, SUSPENDED, PhyState
from swarmwire.comms.robot.packets import Fate

DELAY, SCAN_PHASE = purpose("advertising delay"), purpose("scan phase")
RECEIVED, BLOCKED = int(Fate.RECEIVED), int(Fate.BLOCKED)
COLLIDED, JAMMED, NOT_LISTENING = int(Fate.COLLIDED), int(Fate.JAMMED), int(Fate.NOT_LISTENING)
RECEIVER_DEAD, BLACKOUT = int(Fate.RECEIVER_DEAD), int(Fate.BLACKOUT)
BETWEEN_PDUS = 100  # a robot's `on_air` in the gap: it keeps its links, and sends nothing
FATES = 32  # `pdu_fate` of a link is FATES x number of the PDU + its fate

order_queues, stop_dead = mac.order_queues, mac.stop_dead


class AdvertisingTiming(NamedTuple):
    """The table `[radio.advertising]` in ns, and the scan phase of each robot."""

    channels: int
    gap_ns: int
    max_delay_ns: int
    interval_ns: int
    window_ns: int
    phase_ns: IntArray  # (rows,) time since the scanner began with the first channel, at time 0


def advertising_timing(radio: Radio, keys: KeyArray, robots: int) -> AdvertisingTiming:
    """Return the timing of a radio; scan phases are drawn by `keys`, one per arena of `robots`."""
    table = radio.advertising or Advertising()
    interval_ns = to_ns(table.scan_interval_s)
    window_ns = interval_ns if table.scan_window_s is None else min(to_ns(table.scan_window_s), interval_ns)
    share = uniform(keys[:, None], np.arange(robots), 0, 0, SCAN_PHASE).ravel()
    phase_ns = (share * (table.channels * interval_ns)).astype(np.int64)
    return AdvertisingTiming(
        table.channels, to_ns(table.gap_s), to_ns(table.max_delay_s), interval_ns, window_ns, phase_ns
    )


@kernel()
def on_channel(state, channel):
    """Return the state with the receptions of one channel alone, (robots,)."""
    rows = len(state.robot)
    return PhyState(
        state.keys,
        state.robot,
        state.reception[channel * rows : (channel + 1) * rows],
        state.link,
        state.links,
        state.pose_id,
        state.packet,
        state.order,
        state.switch,
        state.spent,
        state.jam,
        state.ht,
    )


@kernel()
def _listens_until(timing, r, channel, at_ns):
    """Return the time at which robot r's scanner, on this channel at `at_ns`, leaves it; `at_ns` if it is not on it."""
    if timing.channels == 1 and timing.window_ns == timing.interval_ns:
        return FOREVER_NS
    since_ns = at_ns + timing.phase_ns[r]
    scan = since_ns // timing.interval_ns
    remaining_ns = scan * timing.interval_ns + timing.window_ns - since_ns
    return at_ns + remaining_ns if scan % timing.channels == channel and remaining_ns > 0 else at_ns


@kernel()
def _unlock_if_left(timing, state, channel, r, now_ns):
    """Lose the frame that robot r receives on a channel, if its scanner left the channel before `now_ns`."""
    rx = state.reception[channel * len(state.robot) + r]
    s = rx.locked_to
    if s >= 0 and _listens_until(timing, r, channel, state.robot[s].on_air_ns) < now_ns:
        state.link[rx.link].frame_fate = NOT_LISTENING
        reception.unlock(rx)


@kernel()
def _send(params, timing, state, events, buffer, r, now_ns):
    """Begin an event with its first PDU, once its delay is over; or send the event's next PDU."""
    robot = state.robot[r]
    if robot.mac_state == SENDING:
        if state.switch.is_on[r] and robot.attempt + 1 < timing.channels:
            robot.attempt += 1
            _start_pdu(params, timing, state, events, r, now_ns)
        else:
            _end_event(timing, state, params, events, buffer, r, now_ns)
        return
    if not tx_queue.drop_expired(params, state, buffer, r, now_ns):
        return
    packet = state.packet[robot.packet]
    if robot.exponent == 0:  # 1 once the delay is drawn
        robot.exponent = 1
        u = compiled_uniform(state.keys[r // params.robots], r % params.robots, packet.sequence, 0, DELAY)
        delay_ns = np.int64(u * timing.max_delay_ns)
        if delay_ns > 0:
            schedule(events, SEND, r, now_ns + delay_ns)
            return
    packet.on_air_at_ns = now_ns
    robot.mac_state = SENDING
    if state.switch.is_on[r]:
        use_current_links(state, r)
    else:
        packet.fate = state.switch.drop_fate[r]
        robot.first_link = robot.weak_link = robot.stop_link = 0  # no links
    robot.to, robot.sequence, robot.duration_ns = packet.to, packet.sequence, 0
    robot.rate = params.data_rate
    for i in range(robot.first_link, robot.weak_link):
        state.link[i].pdu_fate = UNDER_WAY
    for channel in range(timing.channels):
        reception.stop_receiving(on_channel(state, channel), r)
    _start_pdu(params, timing, state, events, r, now_ns)


@kernel()
def _start_pdu(params, timing, state, events, r, now_ns):
    """Put the event's PDU on air; receivers are deaf to it while their scanners are not on its channel."""
    robot = state.robot[r]
    channel, packet = robot.attempt, state.packet[robot.packet]
    rows = len(state.robot)
    for i in range(robot.first_link, robot.weak_link):
        receiver = np.int64(state.link[i].receiver)
        _unlock_if_left(timing, state, channel, receiver, now_ns)
        listens = _listens_until(timing, receiver, channel, now_ns) > now_ns and state.switch.is_on[receiver]
        is_deaf = not listens or state.robot[receiver].on_air != SILENT
        state.reception[channel * rows + receiver].is_deaf = is_deaf
    robot.on_air = DATA
    reception.start_frame(params, on_channel(state, channel), events, r, now_ns, packet.airtime_ns, packet.bits)


@kernel()
def _pdu_ended(params, timing, losses, state, events, buffer, r, now_ns):
    """Handle the end of a PDU: note its fates, then wait for the next, or end the event.

    The PDU that decides a packet's fate is the first that is received, else the last that met the scanner.
    """
    robot = state.robot[r]
    channel = robot.attempt
    for i in range(robot.first_link, robot.weak_link):
        _unlock_if_left(timing, state, channel, np.int64(state.link[i].receiver), now_ns)
    reception.end_frame(params, losses, on_channel(state, channel), events, r, now_ns)
    for i in range(robot.first_link, robot.weak_link):
        link = state.link[i]
        before, fate = np.int64(link.pdu_fate), np.int64(link.frame_fate)
        until_ns = _listens_until(timing, np.int64(link.receiver), channel, robot.on_air_ns)
        if fate in (COLLIDED, JAMMED) and until_ns < now_ns:  # alone, it would not have been received either
            fate = NOT_LISTENING
        met = until_ns > robot.on_air_ns
        if before == UNDER_WAY or (before % FATES != RECEIVED and met):
            link.pdu_fate = FATES * channel + fate
    if channel + 1 < timing.channels:
        robot.on_air = BETWEEN_PDUS
        schedule(events, OFF_AIR, r, now_ns + timing.gap_ns)  # which the robot's death does not cancel
    else:
        _end_event(timing, state, params, events, buffer, r, now_ns)


@kernel()
def _end_event(timing, state, params, events, buffer, r, now_ns):
    """Record the fates of an event's packet, each at the end of the PDU that decided it, and serve the next packet."""
    robot = state.robot[r]
    packet = state.packet[robot.packet]
    robot.on_air = SILENT
    if packet.fate != UNDER_WAY:
        results.record_at_sender(state, buffer, robot.packet, packet.fate, packet.on_air_at_ns)
        tx_queue.serve(params, state, events, r, now_ns)
        return
    for i in range(robot.first_link, robot.weak_link):
        link = state.link[i]
        pdu, fate = np.int64(link.pdu_fate) // FATES, np.int64(link.pdu_fate) % FATES
        receiver = np.int64(link.receiver)
        if packet.to in (BROADCAST, receiver) and (link.above_sensitivity or fate == RECEIVED):
            final_at_ns = packet.on_air_at_ns + pdu * (packet.airtime_ns + timing.gap_ns) + packet.airtime_ns
            in_range = 0 if fate == BLOCKED else 1
            results.record(
                state, buffer, robot.packet, receiver, fate, in_range, final_at_ns, robot.pose_id, link.power_mw
            )
    packet.airtime_ns *= robot.attempt + 1  # of all its PDUs
    packet.is_done = 1
    tx_queue.serve(params, state, events, r, now_ns)


@kernel(from_python=True, nogil=True)
def run_until(params, timing, losses, state, events, buffer, max_links, until_ns, start, is_new):
    """Handle the events due before `until_ns`, after `order_queues` if packets are new.

    Returns the time of the next event, NEVER_NS or BUFFER_IS_FULL, see `next_event`.
    """
    if is_new:
        order_queues(state, events, start)
    kind, r, now_ns = next_event(params, state, events, buffer, max_links, until_ns)
    while kind != NO_EVENT:
        if kind == ENQUEUE:
            tx_queue.enqueue(params, state, events, buffer, r, now_ns)
        elif kind == SEND:
            _send(params, timing, state, events, buffer, r, now_ns)
        elif state.robot[r].on_air == BETWEEN_PDUS:
            schedule(events, SEND, r, now_ns)  # after frames that end now
        else:
            _pdu_ended(params, timing, losses, state, events, buffer, r, now_ns)
        kind, r, now_ns = next_event(params, state, events, buffer, max_links, until_ns)
    return now_ns


@kernel(from_python=True)
def switch(params, state, events, buffer, now_ns):
    """Suspend or resume queues as `tx_queue.switch` does; packets that resume get their delay again."""
    for r in range(len(state.robot)):
        if state.robot[r].mac_state == SUSPENDED:
            state.robot[r].exponent = 0
    tx_queue.switch(params, state, events, buffer, now_ns)


@kernel(from_python=True)
def end_receptions(_params, state, _events, alive, radio_on, _now_ns):
    """End the receptions of robots that are not `alive` (rows,), or whose radio is off, `radio_on` (rows,)."""
    rows = len(state.robot)
    for s in range(rows):
        robot = state.robot[s]
        if robot.on_air != DATA:
            continue
        for i in range(robot.first_link, robot.weak_link):
            r = np.int64(state.link[i].receiver)
            if state.link[i].frame_fate == RECEIVING and not (alive[r] and radio_on[r]):
                state.link[i].frame_fate = BLACKOUT if alive[r] else RECEIVER_DEAD
                reception.unlock(state.reception[robot.attempt * rows + r])
