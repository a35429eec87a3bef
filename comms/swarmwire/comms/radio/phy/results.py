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
    record(state, buffer, index, NO_ROBOT, fate, 0, now_ns, 0, 0.0)


@kernel()
def drop_older(state, buffer, r, newest, now_ns):
    """End packets that wait before index `newest` of `state.order`, since the radio is off: BLACKOUT."""
    robot = state.robot[r]
    if robot.mac_state == SUSPENDED:
        if robot.attempt == 0:
            record_at_sender(state, buffer, robot.packet, BLACKOUT, now_ns)
        else:
            record_last_attempt(state, buffer, r, now_ns)
        robot.mac_state, robot.packet = IDLE, NO_PACKET
    for i in range(robot.next, newest):
        if not state.packet[state.order[i]].is_done:
            record_at_sender(state, buffer, state.order[i], BLACKOUT, now_ns)
    robot.waiting = 0


@kernel()
def record_frame(params, state, events, buffer, r, now_ns):
    """Record a frame's fate at each robot in range, and at robots out of range that received it."""
    robot = state.robot[r]
    packet = state.packet[robot.packet]
    robot.last_fate, robot.last_in_range, robot.last_mw = NO_FATE, 0, 0.0
    link, to, pose_id, index = state.link, packet.to, robot.pose_id, robot.packet
    if to == BROADCAST:
        record_broadcast(state, buffer, r, now_ns)
        return
    for i in range(robot.first_link, robot.weak_link):
        receiver, fate, power_mw = np.int64(link[i].receiver), np.int64(link[i].frame_fate), link[i].power_mw
        if to != receiver or not (link[i].above_sensitivity or fate == RECEIVED):
            continue
        in_range = 0 if fate == BLOCKED else 1
        robot.last_fate, robot.last_in_range, robot.last_mw = fate, in_range, power_mw
        if fate == RECEIVED:
            if not packet.is_settled:
                packet.is_settled = 1
                record(state, buffer, index, receiver, RECEIVED, 1, now_ns, pose_id, power_mw)
            if params.acknowledged:
                state.robot[receiver].ack_to = r
                schedule(events, SEND_ACK, receiver, now_ns + params.sifs_ns)


@kernel()
def record_broadcast(state, buffer, r, now_ns):
    """Record a broadcast's fate at each robot in range, and at robots out of range that received it."""
    robot, link = state.robot[r], state.link
    on_air_at_ns, k = state.packet[robot.packet].on_air_at_ns, np.uint64(buffer.count[0])
    for i in range(np.uint64(robot.first_link), np.uint64(robot.weak_link)):
        row = link[i]
        fate = row.frame_fate
        # Branchless: write first, then advance for a row that counts; branches would be mispredicted too often.
        buffer.packet[k], buffer.receiver[k], buffer.fate[k] = robot.packet, row.receiver, fate
        buffer.in_range[k], buffer.final_at_ns[k], buffer.pose_id[k] = fate != BLOCKED, now_ns, robot.pose_id
        buffer.on_air_at_ns[k], buffer.power_mw[k] = on_air_at_ns, row.power_mw
        k += np.uint64(row.above_sensitivity | (fate == RECEIVED))
    buffer.count[0] = k


@kernel()
def record_last_attempt(state, buffer, r, now_ns):
    """End a unicast packet with the fate of its last attempt, unless its reception is recorded already."""
    robot = state.robot[r]
    packet = state.packet[robot.packet]
    packet.is_done = 1
    if not packet.is_settled and robot.last_fate != NO_FATE:
        packet.is_settled = 1
        record(
            state,
            buffer,
            robot.packet,
            packet.to,
            robot.last_fate,
            robot.last_in_range,
            now_ns,
            robot.pose_id,
            robot.last_mw,
        )


@kernel()
def record(state, buffer, packet, receiver, fate, in_range, final_at_ns, pose_id, power_mw):
    """Append a row."""
    k = buffer.count[0]
    buffer.packet[k], buffer.receiver[k], buffer.fate[k], buffer.in_range[k] = packet, receiver, fate, in_range
    buffer.final_at_ns[k], buffer.pose_id[k], buffer.power_mw[k] = final_at_ns, pose_id, power_mw
    buffer.on_air_at_ns[k] = state.packet[packet].on_air_at_ns  # start of this attempt; others may follow
    buffer.count[0] += 1
