"""What the run of events tells: which packets ended, where, and how."""

# pyright: basic, reportUnknownMemberType=false

from typing import NamedTuple

import numpy as np

from swarmwire.comms.arrays import FloatArray, IntArray
from swarmwire.comms.kernels import kernel
from swarmwire.comms.packets import Fate
from swarmwire.comms.radio.phy.event_queue import ANSWER, schedule
from swarmwire.comms.radio.phy.state import HELD, NOTHING
from swarmwire.comms.truth import NO_ROBOT


class ResultBuffer(NamedTuple):
    """What the run of events tells, (capacity,) each: a row per packet and receiver, or per packet never on air."""

    packet: IntArray
    receiver: IntArray  # robot row or NOBODY
    fate: IntArray
    in_range: IntArray
    final_at_ns: IntArray
    hold: IntArray
    on_air_at_ns: IntArray
    power_mw: FloatArray  # at the receiver
    count: IntArray  # (1,) rows told


def room_for(capacity: int) -> ResultBuffer:
    """Room for so many rows."""
    columns = (np.empty(capacity, np.int64) for _ in range(7))
    return ResultBuffer._make([*columns, np.empty(capacity), np.zeros(1, np.int64)])


def taken_out(room: ResultBuffer) -> ResultBuffer:
    """The rows that were told, out of `room`, which is empty again."""
    count = int(room.count[0])
    rows = ResultBuffer._make([*(column[:count].copy() for column in room[:-1]), room.count.copy()])
    room.count[0] = 0
    return rows


# --- Telling: what became of a packet, at its sender's radio or at each receiver.


RECEIVED, BLOCKED, BLACKOUT = int(Fate.RECEIVED), int(Fate.BLOCKED), int(Fate.BLACKOUT)


@kernel()
def refuse(state, told, index, fate, now_ns):
    """A packet ends at its sender's radio."""
    packet = state.packet[index]
    packet.is_done, packet.fate, packet.on_air_at_ns = 1, fate, now_ns
    _tell(state, told, index, NO_ROBOT, fate, 0, now_ns, 0, 0.0)


@kernel()
def give_up_older(state, told, r, newest, now_ns):
    """What waits at the robot's radio before the packet at place `newest` of its order ends: the radio is off."""
    me = state.robot[r]
    if me.stage == HELD:
        if me.attempt == 0:
            refuse(state, told, me.packet, BLACKOUT, now_ns)
        else:
            settle(state, told, r, now_ns)
        me.stage, me.packet = NOTHING, NO_ROBOT
    for at in range(me.next, newest):
        if not state.packet[state.order[at]].is_done:
            refuse(state, told, state.order[at], BLACKOUT, now_ns)
    me.waiting = 0


@kernel()
def report(rules, state, queue, told, r, now_ns):
    """Tell what became of a frame: at each robot in range, and at those out of range that received it."""
    me = state.robot[r]
    packet = state.packet[me.packet]
    me.last_fate, me.last_in_range, me.last_mw = NO_ROBOT, 0, 0.0
    link, to, hold, index = state.link, packet.to, me.hold, me.packet
    if to == NO_ROBOT:
        _tell_all(state, told, r, now_ns)
        return
    for i in range(me.first_link, me.weak_link):
        receiver, fate, power_mw = np.int64(link[i].receiver), np.int64(link[i].now), link[i].power_mw
        if to != receiver or not (link[i].is_listed or fate == RECEIVED):
            continue
        in_range = 0 if fate == BLOCKED else 1
        me.last_fate, me.last_in_range, me.last_mw = fate, in_range, power_mw
        if fate == RECEIVED:
            if not packet.is_settled:
                packet.is_settled = 1
                _tell(state, told, index, receiver, RECEIVED, 1, now_ns, hold, power_mw)
            if rules.acknowledged:
                state.robot[receiver].answers_to = r
                schedule(queue, ANSWER, receiver, now_ns + rules.short_space_ns)


@kernel()
def _tell_all(state, told, r, now_ns):
    me, link = state.robot[r], state.link
    on_air_at_ns, at = state.packet[me.packet].on_air_at_ns, np.uint64(told.count[0])
    for i in range(np.uint64(me.first_link), np.uint64(me.weak_link)):
        one = link[i]
        fate = one.now
        # Written first and kept if it counts: a branch would be guessed wrong too often.
        told.packet[at], told.receiver[at], told.fate[at] = me.packet, one.receiver, fate
        told.in_range[at], told.final_at_ns[at], told.hold[at] = fate != BLOCKED, now_ns, me.hold
        told.on_air_at_ns[at], told.power_mw[at] = on_air_at_ns, one.power_mw
        at += np.uint64(one.is_listed | (fate == RECEIVED))
    told.count[0] = at


@kernel()
def settle(state, told, r, now_ns):
    """An addressed packet is given up: its fate is that of the last attempt, if nothing else was told."""
    me = state.robot[r]
    packet = state.packet[me.packet]
    packet.is_done = 1
    if not packet.is_settled and me.last_fate != NO_ROBOT:
        packet.is_settled = 1
        _tell(state, told, me.packet, packet.to, me.last_fate, me.last_in_range, now_ns, me.hold, me.last_mw)


@kernel()
def _tell(state, told, packet, receiver, fate, in_range, final_at_ns, hold, power_mw):
    at = told.count[0]
    told.packet[at], told.receiver[at], told.fate[at], told.in_range[at] = packet, receiver, fate, in_range
    told.final_at_ns[at], told.hold[at], told.power_mw[at] = final_at_ns, hold, power_mw
    told.on_air_at_ns[at] = state.packet[packet].on_air_at_ns  # of this attempt: more may follow
    told.count[0] += 1
