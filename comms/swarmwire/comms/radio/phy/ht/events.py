"""The events of 802.11n in the order of time, and the stations that die or are switched.

The functions that Python calls have the names of those in `mac.py`, which has them for other radios.
"""

# pyright: basic, reportUnknownMemberType=false

from swarmwire.comms.base.kernels import kernel
from swarmwire.comms.base.sentinels import NO_PACKET, NO_ROBOT
from swarmwire.comms.radio.disruption import DROP, NEWEST
from swarmwire.comms.radio.phy import mac
from swarmwire.comms.radio.phy.event_queue import CCA_END, ENQUEUE, NO_EVENT, OFF_AIR, SEND, SEND_ACK, TIMER, cancel
from swarmwire.comms.radio.phy.ht import ppdu
from swarmwire.comms.radio.phy.ht.exchange import SENDER_DEAD, frame_ended, send
from swarmwire.comms.radio.phy.ht.responses import NAV_RESET, reset_nav, respond, timer_expired
from swarmwire.comms.radio.phy.ht.station import TOO_LARGE, begin, enqueue
from swarmwire.comms.radio.phy.mac import end_receptions, next_event
from swarmwire.comms.radio.phy.state import BACKING_OFF, DATA, IDLE, NO_RESULT, SENDING, SUSPENDED, TURNAROUND

__all__ = ["end_receptions", "order_queues", "run_until", "stop_dead", "switch"]


@kernel(from_python=True)
def order_queues(state, events, start):
    """Set up the queues after packets were added or removed, as `mac.order_queues`, and find the PPDUs again."""
    mac.order_queues(state, events, start)
    for r in range(len(state.robot)):
        robot, station = state.robot[r], state.ht.station[r]
        robot.next, robot.waiting, station.count = start[r], 0, 0
        if robot.mac_state >= BACKING_OFF and not state.packet[robot.packet].is_enqueued:
            robot.packet = NO_PACKET
        for k in range(start[r], robot.enqueue_next):
            packet = state.packet[state.order[k]]
            robot.waiting += not (packet.is_acked or packet.is_done)
            if packet.is_in_ppdu:
                station.first = k if station.count == 0 else station.first
                station.count += 1
        if station.count > 0:
            robot.packet = state.order[station.first]


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
        elif kind == NAV_RESET:
            reset_nav(params, state, events, r, now_ns)
        elif kind == TIMER:
            timer_expired(params, state, events, r, now_ns)
        elif kind == SEND:
            send(params, state, events, buffer, r, now_ns)
        elif kind == ENQUEUE:
            enqueue(params, state, events, buffer, r, now_ns)
        else:
            respond(params, state, events, r, now_ns)
        kind, r, now_ns = next_event(params, state, events, buffer, max_links, until_ns)
    return now_ns


@kernel(from_python=True)
def stop_dead(state, events, buffer, alive, now_ns):
    """End the queues of robots that are not `alive` (rows,), after `order_queues`; their frames on air continue."""
    for r in range(len(state.robot)):
        robot, station = state.robot[r], state.ht.station[r]
        if alive[r]:
            continue
        for kind in (TIMER, CCA_END, SEND, SEND_ACK, ENQUEUE):
            cancel(events, kind, r)
        is_sending = robot.mac_state == SENDING and robot.on_air == DATA
        if is_sending:
            state.packet[robot.packet].result = NO_RESULT
        else:
            ppdu.dissolve(state, r)
            robot.mac_state, robot.packet, station.request_to = IDLE, NO_PACKET, NO_ROBOT
        for k in range(robot.next, robot.stop):
            index = state.order[k]
            packet = state.packet[index]
            if not packet.is_done and not packet.is_in_ppdu:
                fate = TOO_LARGE if packet.is_too_large else SENDER_DEAD
                ppdu.end_packet(state, buffer, r, index, fate, now_ns)
        robot.enqueue_next = robot.stop
        robot.waiting = 0


@kernel(from_python=True)
def switch(params, state, events, buffer, now_ns):
    """Suspend or resume the queues of radios that were switched, see `state.switch`, after `order_queues`."""
    for r in range(len(state.robot)):
        robot = state.robot[r]
        if state.switch.backlog[r] != DROP:
            if robot.mac_state in (BACKING_OFF, TURNAROUND):
                cancel(events, SEND, r)
                ppdu.dissolve(state, r)
                robot.mac_state = SUSPENDED
            if state.switch.backlog[r] == NEWEST and robot.waiting > 1:
                ppdu.drop_older(state, buffer, r, robot.enqueue_next - 1, now_ns)
        elif robot.mac_state == SUSPENDED:
            begin(params, state, events, r, now_ns)
