"""The MAC of the PHY: transmission attempts, acknowledgements and the event loop.

An attempt starts with channel access, goes on air, and ends with an acknowledgement, an ACK timeout or, without
acknowledgements, the end of the frame. `run_until` handles the events due before a time in the order (time, kind, robot
row).
"""

# pyright: basic, reportUnknownMemberType=false

import numpy as np

from swarmwire.comms.base.clock import NEVER_NS
from swarmwire.comms.base.kernels import kernel
from swarmwire.comms.base.sentinels import BROADCAST, NO_PACKET, NO_ROBOT, UNDER_WAY
from swarmwire.comms.radio.phy import csma, dcf, duty_cycle, jamming, reception, results, tx_queue
from swarmwire.comms.radio.phy.event_queue import CCA_END, ENQUEUE, NO_EVENT, OFF_AIR, SEND, TIMER, cancel, schedule
from swarmwire.comms.radio.phy.state import (
    ACKNOWLEDGEMENT,
    AWAITING_ACK,
    BACKING_OFF,
    DATA,
    NO_RESULT,
    RECEIVING,
    SENDING,
    SILENT,
    TURNAROUND,
)
from swarmwire.comms.robot.packets import Fate, TxResult

RECEIVED, CHANNEL_BUSY = int(Fate.RECEIVED), int(Fate.CHANNEL_BUSY)
SENDER_DEAD, RECEIVER_DEAD, BLACKOUT = int(Fate.SENDER_DEAD), int(Fate.RECEIVER_DEAD), int(Fate.BLACKOUT)
ACKNOWLEDGED, TX_CHANNEL_BUSY = int(TxResult.ACKNOWLEDGED), int(TxResult.CHANNEL_BUSY)

switch = tx_queue.switch

BUFFER_IS_FULL = -1  # `run_until` returns it in place of a time
MAX_EXTRA_ROWS = 64  # result rows of one event in addition to one per link of a frame


@kernel()
def timer_expired(params, state, events, buffer, r, now_ns):
    """Handle the timer: end of backoff, ACK timeout, or end of the interframe space."""
    robot = state.robot[r]
    if robot.mac_state == BACKING_OFF:
        csma.start_cca(params, state, events, r, now_ns)
    elif robot.mac_state == AWAITING_ACK:
        ack_timed_out(params, state, events, buffer, r, now_ns)
    else:
        tx_queue.serve(params, state, events, r, now_ns)


@kernel()
def cca_ended(params, state, events, buffer, r, now_ns):
    """Handle the end of a CCA (CSMA): after a channel access failure the packet is dropped."""
    if not csma.end_cca(params, state, events, r, now_ns):
        return
    robot = state.robot[r]
    state.packet[robot.packet].result = TX_CHANNEL_BUSY
    if robot.attempt == 0:
        results.record_at_sender(state, buffer, robot.packet, CHANNEL_BUSY, now_ns)
    else:
        results.record_last_attempt(state, buffer, r, now_ns)
    tx_queue.serve(params, state, events, r, now_ns)


@kernel()
def send(params, state, events, buffer, r, now_ns):
    """Put the packet being served on air."""
    robot = state.robot[r]
    if robot.on_air != SILENT:  # the radio is still sending an acknowledgement
        tx_queue.begin_attempt(params, state, events, r, now_ns)
        return
    if not tx_queue.drop_expired(params, state, buffer, r, now_ns):
        state.reception[r].is_deaf = 0  # the turnaround was for a frame that does not follow
        return
    packet = state.packet[robot.packet]
    if robot.attempt > 0 and not state.switch.is_on[r]:  # off during a retry: the fate of the last attempt counts
        state.reception[r].is_deaf = 0
        results.record_last_attempt(state, buffer, r, now_ns)
        tx_queue.wait_interframe(params, state, events, r, packet.ifs_ns, now_ns)
        return
    lead_ns = params.lead_ns[r % params.robots]
    packet.on_air_at_ns = now_ns - lead_ns
    robot.mac_state = SENDING
    if state.switch.is_on[r]:
        use_current_links(state, r)
    else:
        packet.fate = state.switch.drop_fate[r]
        robot.first_link = robot.weak_link = robot.stop_link = 0  # no links; pragma: no mutate (any empty range does)
    robot.on_air, robot.to, robot.sequence = DATA, packet.to, packet.sequence
    robot.rate = params.data_rate if packet.to != BROADCAST else params.broadcast_rate
    robot.duration_ns = params.data_duration_ns if packet.to != BROADCAST else 0
    duty_cycle.spend(params, state, r, packet.airtime_ns, packet.on_air_at_ns)
    reception.start_frame(params, state, events, r, now_ns, packet.airtime_ns - lead_ns, packet.bits)


@kernel()
def frame_ended(params, losses, state, events, buffer, r, now_ns):
    """Handle the end of the robot's frame: report it, then await the acknowledgement or finish the packet."""
    robot = state.robot[r]
    kind = robot.on_air
    reception.end_frame(params, losses, state, events, r, now_ns)
    if kind == ACKNOWLEDGEMENT:
        _ack_ended(params, state, events, buffer, r, now_ns)
        return
    if robot.packet == NO_PACKET:
        return  # the robot died, and the packet has its fate
    packet = state.packet[robot.packet]
    if packet.fate != UNDER_WAY:
        results.record_at_sender(state, buffer, robot.packet, packet.fate, packet.on_air_at_ns)
        tx_queue.wait_interframe(params, state, events, r, packet.ifs_ns, now_ns)
        return
    results.record_frame(params, state, events, buffer, r, now_ns)
    if packet.to != BROADCAST and params.acknowledged and packet.result != NO_RESULT:
        robot.mac_state = AWAITING_ACK
        schedule(events, TIMER, r, now_ns + params.ack_timeout_ns)
        return
    if packet.to != BROADCAST and not packet.is_settled:
        results.record_last_attempt(state, buffer, r, now_ns)
    packet.is_done = 1
    tx_queue.wait_interframe(params, state, events, r, packet.ifs_ns, now_ns)


@kernel()
def ack_timed_out(params, state, events, buffer, r, now_ns):
    """Handle an ACK timeout: retry, or end the packet with the fate of its last attempt."""
    robot = state.robot[r]
    packet = state.packet[robot.packet]
    if robot.attempt >= params.max_retries:
        results.record_last_attempt(state, buffer, r, now_ns)
        tx_queue.wait_interframe(params, state, events, r, packet.ifs_ns, now_ns)
        return
    robot.attempt += 1
    if params.method == dcf.DCF:
        robot.exponent += 1
        dcf.draw_backoff(params, state, r)
        robot.free_from_ns = max(robot.free_from_ns, now_ns)  # DIFS and slots count from the timeout
    tx_queue.begin_attempt(params, state, events, r, now_ns)
    tx_queue.keep_newest(params, state, events, buffer, r, now_ns)


@kernel()
def send_ack(params, state, events, r, now_ns):
    """Acknowledge the received frame, busy medium or not, unless the radio sends, is about to send, or is off."""
    robot = state.robot[r]
    if robot.on_air != SILENT or robot.mac_state == TURNAROUND or not state.switch.is_on[r]:
        return
    use_current_links(state, r)
    robot.on_air, robot.to, robot.duration_ns = ACKNOWLEDGEMENT, robot.ack_to, 0
    robot.rate = params.ack_rate
    reception.start_frame(params, state, events, r, now_ns, params.ack_airtime_ns, params.ack_bits)


@kernel()
def use_current_links(state, r):
    """Use the robot's links under the current poses for its next frame."""
    robot, links = state.robot[r], state.links
    robot.first_link, robot.weak_link, robot.stop_link = links.first[r], links.weak[r], links.stop[r]
    robot.pose_id = state.pose_id


@kernel()
def _ack_ended(params, state, events, buffer, r, now_ns):
    """Handle the end of an acknowledgement: if the sender of the data received it, its packet is finished."""
    robot = state.robot[r]
    for i in range(robot.first_link, robot.weak_link):
        receiver = np.int64(state.link[i].receiver)
        if receiver != robot.ack_to or state.link[i].frame_fate != RECEIVED:
            continue
        sender = state.robot[receiver]
        if sender.mac_state == AWAITING_ACK and state.packet[sender.packet].to == r:
            cancel(events, TIMER, receiver)
            state.packet[sender.packet].result = ACKNOWLEDGED
            results.record_last_attempt(state, buffer, receiver, now_ns)
            tx_queue.wait_interframe(params, state, events, receiver, state.packet[sender.packet].ifs_ns, now_ns)
    robot.ack_to = NO_ROBOT


@kernel(from_python=True)
def order_queues(state, events, start):
    """Set up the queues after packets were added or removed. Precondition: no packet is done.

    Writes `state.order` and `start` (rows + 1,): the packets of robot r are order[start[r]:start[r + 1]].
    """
    for r in range(len(start)):
        start[r] = 0
    for p in range(len(state.packet)):
        start[state.packet[p].sender + 1] += 1
    for r in range(len(state.robot)):
        start[r + 1] += start[r]
    for p in range(len(state.packet)):  # afterwards start[r] is the end of robot r; shifted back below
        r = state.packet[p].sender
        state.order[start[r]] = p
        start[r] += 1
    for r in range(len(state.robot), 0, -1):
        start[r] = start[r - 1]
    start[0] = 0
    for r in range(len(state.robot)):
        robot = state.robot[r]
        i, stop = start[r], start[r + 1]
        robot.stop = stop
        robot.packet = NO_PACKET
        if robot.mac_state >= BACKING_OFF:
            robot.packet = state.order[i]
            i += 1
        robot.next = i
        while i < stop and state.packet[state.order[i]].is_enqueued:
            i += 1
        robot.enqueue_next = i
        robot.waiting = i - robot.next
        if i < stop:
            schedule(events, ENQUEUE, r, state.packet[state.order[i]].sent_at_ns)


@kernel()
def next_event(params, state, events, buffer, max_links, until_ns):
    """Take the next event before `until_ns` off the queue; switch the jammers that switch until then.

    Returns its kind, robot row and time. Without one: NO_EVENT, NO_ROBOT and what a `run_until` returns, which is the
    time of the first event later on, NEVER_NS without one; or BUFFER_IS_FULL: call again with an empty `buffer`. No
    robot has more than `max_links` links.
    """
    jam = state.jam
    while jam.next[0] < len(jam.at_ns):  # all switching times are before `until_ns`
        if events.size[0] > 0 and events.at_ns[events.heap[0]] < jam.at_ns[jam.next[0]]:
            break
        jamming.toggle(params, state, events)
    if events.size[0] == 0:
        return NO_EVENT, NO_ROBOT, NEVER_NS
    event, rows = events.heap[0], len(state.robot)
    now_ns = events.at_ns[event]
    if now_ns >= until_ns:
        return NO_EVENT, NO_ROBOT, now_ns
    kind, r = event // rows, event % rows
    queued = state.robot[r].stop - state.robot[r].next
    if buffer.count[0] + max_links + queued + MAX_EXTRA_ROWS > len(buffer.packet):
        return NO_EVENT, NO_ROBOT, BUFFER_IS_FULL
    cancel(events, kind, r)
    return kind, r, now_ns


@kernel(from_python=True, nogil=True)
def run_until(params, losses, state, events, buffer, max_links, until_ns, start, is_new):
    """Handle the events due before `until_ns`, after `order_queues` if packets are new.

    Returns the time of the next event, NEVER_NS or BUFFER_IS_FULL, see `next_event`.
    """
    if is_new:
        order_queues(state, events, start)
    kind, r, now_ns = next_event(params, state, events, buffer, max_links, until_ns)
    while kind != NO_EVENT:
        if kind == OFF_AIR:
            frame_ended(params, losses, state, events, buffer, r, now_ns)
        elif kind == CCA_END:
            cca_ended(params, state, events, buffer, r, now_ns)
        elif kind == TIMER:
            timer_expired(params, state, events, buffer, r, now_ns)
        elif kind == SEND:
            send(params, state, events, buffer, r, now_ns)
        elif kind == ENQUEUE:
            tx_queue.enqueue(params, state, events, buffer, r, now_ns)
        else:
            send_ack(params, state, events, r, now_ns)
        kind, r, now_ns = next_event(params, state, events, buffer, max_links, until_ns)
    return now_ns


@kernel(from_python=True)
def stop_dead(state, events, buffer, alive, now_ns):
    """End the queues of robots that are not `alive` (rows,), after `order_queues`."""
    for r in range(len(state.robot)):
        if not alive[r]:
            tx_queue.stop(state, events, buffer, r, now_ns, SENDER_DEAD)


@kernel(from_python=True)
def end_receptions(params, state, events, alive, radio_on, now_ns):
    """End the receptions of robots that are not `alive` (rows,), or whose radio is off, `radio_on` (rows,)."""
    for s in range(len(state.robot)):
        robot = state.robot[s]
        if robot.on_air == SILENT:
            continue
        for i in range(robot.first_link, robot.weak_link):
            r = np.int64(state.link[i].receiver)
            if state.link[i].frame_fate == RECEIVING and not (alive[r] and radio_on[r]):
                state.link[i].frame_fate = BLACKOUT if alive[r] else RECEIVER_DEAD
                reception.unlock(state.reception[r])
                dcf.sense(params, state, events, r, now_ns)
