"""The result buffer of the PHY: fates of packets, at the sender's radio or at each receiver."""

# pyright: basic, reportUnknownMemberType=false

from typing import NamedTuple

import numpy as np

from swarmwire.comms.base.arrays import FloatArray, IntArray
from swarmwire.comms.base.kernels import kernel
from swarmwire.comms.base.sentinels import BROADCAST, NO_FATE, NO_PACKET, NO_ROBOT
from swarmwire.comms.radio.phy.event_queue import SEND_ACK, schedule
from swarmwire.comms.radio.phy.state import IDLE, SUSPENDED
from swarmwire.comms.robot.packets import Fate


class ResultBuffer(NamedTuple):
    """Result rows as columns, (capacity,) each: one per packet and receiver, or per packet never on air."""

    packet: IntArray
    receiver: IntArray  # robot row, or NO_ROBOT for a packet never on air
    fate: IntArray
    in_range: IntArray
    final_at_ns: IntArray
    on_air_at_ns: IntArray
    pose_id: IntArray  # number of the poses when the frame went on air
    power_mw: FloatArray  # power at the receiver
    count: IntArray  # (1,) rows in use


def result_buffer(capacity: int) -> ResultBuffer:
    """Return an empty buffer of `capacity` rows."""
    columns = (np.empty(capacity, np.int64) for _ in range(7))
    return ResultBuffer._make([*columns, np.empty(capacity), np.zeros(1, np.int64)])


def joined_rows(parts: list[ResultBuffer]) -> ResultBuffer:
    """Return the rows of all parts, one or more, in order."""
    if len(parts) == 1:
        return parts[0]
    counts = [int(part.count[0]) for part in parts]
    columns = zip(*(part[:-1] for part in parts), strict=True)
    rows = [np.concatenate([part[:n] for part, n in zip(column, counts, strict=True)]) for column in columns]
    return ResultBuffer._make([*rows, np.array([sum(counts)])])


RECEIVED, BLOCKED, BLACKOUT = int(Fate.RECEIVED), int(Fate.BLOCKED), int(Fate.BLACKOUT)


@kernel()
def record_at_sender(state, buffer, index, fate, now_ns):
    """Record the fate of a packet that ends at its sender's radio."""
    packet = state.packet[index]
    packet.is_done, packet.fate, packet.on_air_at_ns = 1, fate, now_ns
    _record(state, buffer, index, NO_ROBOT, fate, 0, now_ns, 0, 0.0)


@kernel()
def drop_older(state, buffer, r, newest, now_ns):
    """End packets that wait before index `newest` of `state.order`, since the radio is off: BLACKOUT."""
    radio = state.robot[r]
    if radio.stage == SUSPENDED:
        if radio.attempt == 0:
            record_at_sender(state, buffer, radio.packet, BLACKOUT, now_ns)
        else:
            record_last_attempt(state, buffer, r, now_ns)
        radio.stage, radio.packet = IDLE, NO_PACKET
    for i in range(radio.next, newest):
        if not state.packet[state.order[i]].is_done:
            record_at_sender(state, buffer, state.order[i], BLACKOUT, now_ns)
    radio.waiting = 0


@kernel()
def record_frame(params, state, events, buffer, r, now_ns):
    """Record a frame's fate at each robot in range, and at robots out of range that received it."""
    radio = state.robot[r]
    packet = state.packet[radio.packet]
    radio.last_fate, radio.last_in_range, radio.last_mw = NO_FATE, 0, 0.0
    link, to, pose_id, index = state.link, packet.to, radio.pose_id, radio.packet
    if to == BROADCAST:
        _record_broadcast(state, buffer, r, now_ns)
        return
    for i in range(radio.first_link, radio.weak_link):
        receiver, fate, power_mw = np.int64(link[i].receiver), np.int64(link[i].frame_fate), link[i].power_mw
        if to != receiver or not (link[i].above_sensitivity or fate == RECEIVED):
            continue
        in_range = 0 if fate == BLOCKED else 1
        radio.last_fate, radio.last_in_range, radio.last_mw = fate, in_range, power_mw
        if fate == RECEIVED:
            if not packet.is_settled:
                packet.is_settled = 1
                _record(state, buffer, index, receiver, RECEIVED, 1, now_ns, pose_id, power_mw)
            if params.acknowledged:
                state.robot[receiver].ack_to = r
                schedule(events, SEND_ACK, receiver, now_ns + params.sifs_ns)


@kernel()
def _record_broadcast(state, buffer, r, now_ns):
    radio, link = state.robot[r], state.link
    on_air_at_ns, k = state.packet[radio.packet].on_air_at_ns, np.uint64(buffer.count[0])
    for i in range(np.uint64(radio.first_link), np.uint64(radio.weak_link)):
        row = link[i]
        fate = row.frame_fate
        # Branchless: write first, then advance for a row that counts; branches would be mispredicted too often.
        buffer.packet[k], buffer.receiver[k], buffer.fate[k] = radio.packet, row.receiver, fate
        buffer.in_range[k], buffer.final_at_ns[k], buffer.pose_id[k] = fate != BLOCKED, now_ns, radio.pose_id
        buffer.on_air_at_ns[k], buffer.power_mw[k] = on_air_at_ns, row.power_mw
        k += np.uint64(row.above_sensitivity | (fate == RECEIVED))
    buffer.count[0] = k


@kernel()
def record_last_attempt(state, buffer, r, now_ns):
    """End a unicast packet with the fate of its last attempt, unless its reception is recorded already."""
    radio = state.robot[r]
    packet = state.packet[radio.packet]
    packet.is_done = 1
    if not packet.is_settled and radio.last_fate != NO_FATE:
        packet.is_settled = 1
        _record(
            state,
            buffer,
            radio.packet,
            packet.to,
            radio.last_fate,
            radio.last_in_range,
            now_ns,
            radio.pose_id,
            radio.last_mw,
        )


@kernel()
def _record(state, buffer, packet, receiver, fate, in_range, final_at_ns, pose_id, power_mw):
    k = buffer.count[0]
    buffer.packet[k], buffer.receiver[k], buffer.fate[k], buffer.in_range[k] = packet, receiver, fate, in_range
    buffer.final_at_ns[k], buffer.pose_id[k], buffer.power_mw[k] = final_at_ns, pose_id, power_mw
    buffer.on_air_at_ns[k] = state.packet[packet].on_air_at_ns  # start of this attempt; others may follow
    buffer.count[0] += 1
