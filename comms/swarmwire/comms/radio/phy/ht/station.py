"""Stations of 802.11n: their queues, channel access for the next exchange, and frames on air."""

# pyright: basic, reportUnknownMemberType=false

from swarmwire.comms.base.kernels import kernel
from swarmwire.comms.base.sentinels import ABSENT, NO_PACKET, NO_ROBOT
from swarmwire.comms.radio.disruption import ALL, DROP, NEWEST
from swarmwire.comms.radio.phy import dcf, mac, reception, results
from swarmwire.comms.radio.phy.event_queue import ENQUEUE, SEND, schedule
from swarmwire.comms.radio.phy.ht import ppdu
from swarmwire.comms.radio.phy.ht.params import frame_ns
from swarmwire.comms.radio.phy.ht.state import BLOCK_ACK, CTS
from swarmwire.comms.radio.phy.state import ACKNOWLEDGEMENT, BACKING_OFF, IDLE, SUSPENDED
from swarmwire.comms.robot.packets import Fate, TxResult

TOO_LARGE, QUEUE_FULL, TX_QUEUE_FULL = int(Fate.TOO_LARGE), int(Fate.QUEUE_FULL), int(TxResult.QUEUE_FULL)
MAX_DOUBLINGS = 7  # of the contention window; after another failure it is CWmin again (2020: 10.23.2.2)


@kernel()
def begin(params, state, events, r, now_ns):
    """Request access for the robot's next exchange, or idle the radio."""
    robot = state.robot[r]
    first = ppdu.head(state, r)
    robot.mac_state, robot.packet = IDLE, NO_PACKET
    if first == ABSENT:
        state.ht.station[r].request_to = NO_ROBOT
        return
    robot.packet = state.order[first]
    if state.switch.backlog[r] != DROP:
        robot.mac_state = SUSPENDED
    else:
        request_access(params, state, events, r, now_ns)


@kernel()
def request_access(params, state, events, r, now_ns):
    """Start channel access for the next exchange: at once if the backoff has ended, at the boundary of a slot.

    DCF waits for DIFS in this case; the EDCA of ns-3 does not, as the standard allows (IEEE 802.11-2020, 10.23.2.4).
    """
    robot = state.robot[r]
    robot.mac_state = BACKING_OFF
    if state.reception[r].is_busy:
        return
    counted_ns = robot.free_from_ns + params.difs_ns + robot.backoff_slots * params.slot_ns
    if counted_ns < now_ns:
        counted_ns += -(-(now_ns - counted_ns) // params.slot_ns) * params.slot_ns
    schedule(events, SEND, r, counted_ns)


@kernel()
def finish(params, state, events, r, now_ns, has_failed):
    """End the exchange of robot r: a backoff precedes the next one, from a wider window after a failure."""
    robot = state.robot[r]
    if has_failed:
        robot.exponent = robot.exponent + 1 if robot.exponent < MAX_DOUBLINGS else 0
        robot.free_from_ns = max(robot.free_from_ns, now_ns)  # AIFS and slots count from the timeout
    else:
        robot.exponent = 0
    robot.attempt = state.ht.station[r].frames  # keys the draw
    dcf.draw_backoff(params, state, r)
    begin(params, state, events, r, now_ns)


@kernel()
def enqueue(params, state, events, buffer, r, now_ns):
    """Admit packets sent by `now_ns` to the robot's queue, or end them: TOO_LARGE or QUEUE_FULL."""
    robot = state.robot[r]
    while robot.enqueue_next < robot.stop and state.packet[state.order[robot.enqueue_next]].sent_at_ns <= now_ns:
        index = state.order[robot.enqueue_next]
        packet = state.packet[index]
        packet.is_enqueued = 1
        robot.enqueue_next += 1
        backlog = state.switch.backlog[r]
        is_full = robot.waiting >= (params.queue_limit if backlog == ALL else max(params.queue_limit, 1))
        if is_full and backlog == DROP and not packet.is_too_large:
            ppdu.drop_finished(params, state, buffer, r, now_ns)
            is_full = robot.waiting >= max(params.queue_limit, 1)
        if packet.is_too_large:
            results.record_at_sender(state, buffer, index, TOO_LARGE, now_ns)
        elif backlog != NEWEST and is_full:
            packet.result = TX_QUEUE_FULL
            results.record_at_sender(state, buffer, index, QUEUE_FULL, now_ns)
        else:
            if backlog == NEWEST:
                ppdu.drop_older(state, buffer, r, robot.enqueue_next - 1, now_ns)
            robot.waiting += 1
            if robot.mac_state == IDLE:
                robot.attempt = state.ht.station[r].frames
                begin(params, state, events, r, now_ns)
                dcf.defer(params, state, events, r, now_ns)
    if robot.enqueue_next < robot.stop:
        schedule(events, ENQUEUE, r, state.packet[state.order[robot.enqueue_next]].sent_at_ns)


@kernel()
def put_on_air(params, state, events, r, now_ns, kind, rate, octets, duration_ns):
    """Start a frame of robot r; other stations that decode it set their NAV to `duration_ns` after its end."""
    robot = state.robot[r]
    is_response = kind in (ACKNOWLEDGEMENT, BLOCK_ACK, CTS)
    robot.to = robot.ack_to if is_response else state.ht.station[r].to
    if state.switch.is_on[r]:
        mac.use_current_links(state, r)
    else:
        robot.first_link = robot.weak_link = robot.stop_link = 0
    robot.on_air, robot.rate, robot.duration_ns = kind, rate, duration_ns
    state.ht.station[r].frames += 1
    reception.start_frame(params, state, events, r, now_ns, frame_ns(params.ht, rate, octets), 8 * octets)
