"""The run of events: what is due before a time happens, in order of (time, kind, robot row)."""

# pyright: basic, reportUnknownMemberType=false

import numpy as np

from swarmwire.comms.air.signal import attempts, dcf, jamming, on_air, sender_queue
from swarmwire.comms.air.signal.event_queue import ENTER, LISTENED, OFF_AIR, SEND, TIMER, cancel, schedule
from swarmwire.comms.air.signal.tables import BACKING_OFF, RECEIVING, SILENT
from swarmwire.comms.borrowing import borrowing
from swarmwire.comms.fates import Fate
from swarmwire.comms.truth import NOBODY

SENDER_DEAD, RECEIVER_DEAD, BLACKOUT = int(Fate.SENDER_DEAD), int(Fate.RECEIVER_DEAD), int(Fate.BLACKOUT)
FEW = 64  # rows that any one event tells beyond a frame's links


@borrowing(from_python=True)
def line_up(state, queue, start):
    """Before events run: the packets of robot r are order[start[r]:start[r + 1]], those done taken out."""
    for r in range(len(state.robot)):
        me = state.robot[r]
        at, stop = start[r], start[r + 1]
        me.stop = stop
        me.packet = NOBODY
        if me.stage >= BACKING_OFF:
            me.packet = state.order[at]
            at += 1
        me.next = at
        while at < stop and state.packet[state.order[at]].is_entered:
            at += 1
        me.entry = at
        me.waiting = at - me.next
        if at < stop:
            schedule(queue, ENTER, r, state.packet[state.order[at]].sent_at_ns)


@borrowing(from_python=True)
def run_until(rules, losses, state, queue, told, most_links, until_ns):
    """Let happen what is due before `until_ns`; False if `told` has no more room: then take it out and call again.

    No robot has more than `most_links`.
    """
    rows = len(state.robot)
    jam = state.jam
    while queue.size[0] > 0 or jam.next[0] < len(jam.at_ns):
        event = queue.heap[0]
        now_ns = queue.at_ns[event] if queue.size[0] > 0 else until_ns
        if jam.next[0] < len(jam.at_ns) and jam.at_ns[jam.next[0]] <= now_ns:
            jamming.toggle(rules, state, queue)  # all of them are before `until_ns`
            continue
        if now_ns >= until_ns:
            break
        kind, r = event // rows, event % rows
        queued = state.robot[r].stop - state.robot[r].next
        if told.count[0] + most_links + queued + FEW > len(told.packet):
            return False
        cancel(queue, kind, r)
        if kind == OFF_AIR:
            attempts.sent(rules, losses, state, queue, told, r, now_ns)
        elif kind == LISTENED:
            attempts.listened(rules, state, queue, told, r, now_ns)
        elif kind == TIMER:
            attempts.timer(rules, state, queue, told, r, now_ns)
        elif kind == SEND:
            attempts.send(rules, state, queue, told, r, now_ns)
        elif kind == ENTER:
            sender_queue.enter(rules, state, queue, told, r, now_ns)
        else:
            attempts.answer(rules, state, queue, r, now_ns)
    return True


@borrowing(from_python=True)
def stop_the_dead(state, queue, told, alive, now_ns):
    """The queues of robots that are not alive (rows,) end; after `line_up`."""
    for r in range(len(state.robot)):
        if not alive[r]:
            sender_queue.stop(state, queue, told, r, now_ns, SENDER_DEAD)


@borrowing(from_python=True)
def cut_off(rules, state, queue, alive, radio_on, now_ns):
    """Robots that are dead (rows,), or whose radio is off, do not hear the frames on air to their end."""
    for s in range(len(state.robot)):
        me = state.robot[s]
        if me.on_air == SILENT:
            continue
        for i in range(me.first_link, me.weak_link):
            r = np.int64(state.link[i].receiver)
            if state.link[i].now == RECEIVING and not (alive[r] and radio_on[r]):
                state.link[i].now = BLACKOUT if alive[r] else RECEIVER_DEAD
                on_air.let_go(state.reception[r])
                dcf.sense(rules, state, queue, r, now_ns)
