"""Tables of the PHY's event simulation: robots, receptions, packets and links; rows are numpy records."""

# pyright: basic, reportUnknownMemberType=false

from typing import Any, NamedTuple

import numpy as np

from swarmwire.comms.base.arrays import BoolArray, FloatArray, IntArray, KeyArray, Table, record_type
from swarmwire.comms.base.sentinels import NO_FATE, NO_PACKET, NO_ROBOT, UNDER_WAY

# State of a robot's MAC; it serves a packet in the states from BACKING_OFF on.
IDLE, SPACING, BACKING_OFF, SENSING, TURNAROUND, SENDING, AWAITING_ACK, SUSPENDED = range(8)
# Kind of the frame that a robot has on air.
SILENT, DATA, ACKNOWLEDGEMENT = range(3)
RECEIVING = UNDER_WAY  # a link's `frame_fate` while the frame is being received
LONG_AGO_NS = -(10**15)
NO_RESULT = -1  # result of a packet whose sender died while it was on air

_I, _F = np.int64, np.float64


ROBOT = record_type(
    [
        # The queue: indices in `PhyState.order`.
        ("next", _I),  # first packet not served yet
        ("enqueue_next", _I),  # first packet that has not arrived at the queue yet
        ("stop", _I),
        ("waiting", _I),  # number of packets in the queue, not served yet
        # Access.
        ("mac_state", _I),
        ("packet", _I),  # row of the packet being served, or NO_PACKET
        ("attempt", _I),  # number of the attempt, from 0
        ("nb", _I),  # CSMA: NB, number of busy CCAs
        ("exponent", _I),  # CSMA: BE; DCF: number of window doublings
        ("backoff_slots", _I),  # DCF: remaining slots, counted from `free_from_ns` + DIFS while the medium is idle
        ("free_from_ns", _I),  # DCF: start of the idle period
        ("eifs_until_ns", _I),  # DCF: end of EIFS; the medium counts as busy until then
        ("nav_until_ns", _I),  # DCF: end of the NAV; the medium counts as busy until then
        # The frame on air.
        ("on_air", _I),
        ("on_air_ns", _I),
        ("airtime_ns", _I),
        ("bits", _I),
        ("rate", _I),  # row of its bit rate in `PhyParams.log_success`
        ("sequence", _I),  # DATA: key of the draws of its reception
        ("to", _I),  # robot row, BROADCAST or NOWHERE
        ("duration_ns", _I),  # DCF: field Duration of the header, time reserved after the frame
        ("first_link", _I),  # first strong link: fates of strong links are recorded
        ("weak_link", _I),  # first link of interference only
        ("stop_link", _I),
        ("pose_id", _I),  # number of the poses when it went on air
        # Acknowledgements.
        ("ack_to", _I),  # sender row of the frame to acknowledge
        ("last_fate", _I),  # fate of the latest attempt at a unicast packet, or NO_FATE
        ("last_in_range", _I),
        ("last_mw", _F),
    ]
)
# State that each frame changes at each robot nearby; a row fits into one cache line.
RECEPTION = record_type(
    [
        ("power_mw", _F),  # sum of all frames on air here
        ("peak_mw", _F),  # CSMA: maximum of `power_mw` during the CCA
        ("signal_mw", _F),  # power of the frame being received; inf without one
        ("log_success", _F),  # sum over the chunks of the frame being received
        ("since_ns", _I),  # start of the current chunk, which `log_success` does not contain yet
        ("locked_to", np.int32),  # sender row of the frame being received, or NO_ROBOT
        ("link", np.int32),  # link row of that frame
        ("signals", np.int32),  # number of frames on air here
        ("jam_mw", np.float32),  # power of jammers
        ("jam_log", np.float32),  # part of `log_success` due to jammers
        ("is_deaf", np.int8),  # the robot sends, or is about to send
        ("is_busy", np.int8),  # DCF: latest result of carrier sense
    ]
)
PACKET = record_type(
    [
        ("sender", _I),
        ("to", _I),  # robot row, BROADCAST or NOWHERE
        ("sequence", _I),
        ("sent_at_ns", _I),
        ("airtime_ns", _I),
        ("bits", _I),
        ("ifs_ns", _I),  # interframe space after it
        ("is_too_large", np.bool_),
        ("is_enqueued", _I),  # 1: at its queue, or refused by it
        ("is_settled", _I),  # the fate at the receiver of a unicast packet is recorded
        ("is_done", _I),
        ("is_departed", _I),  # earlier results contain the packet, which is not done yet
        ("on_air_at_ns", _I),  # start of the latest attempt
        ("fate", _I),  # fate at the sender's radio; UNDER_WAY for a packet that waits or was on air
        ("result", _I),  # TxResult for the sender, valid once the packet is done
    ]
)
# Links by sender: strong links, then links of interference only. Rows are small, since each frame reads its links three
# times, and the next frame reads others.
LINK = record_type(
    [
        ("power_mw", _F),  # power at the receiver, with fading
        ("receiver", np.int32),  # robot row
        ("above_sensitivity", np.bool_),  # the mean power reaches the sensitivity
        ("fate", np.int8),  # UNDER_WAY, or the drop reason of all packets on a link that is cut
        ("frame_fate", np.int8),  # fate of the frame on air, or RECEIVING
        ("pdu_fate", np.int8),  # advertising: number and fate of the PDU that decides so far, or UNDER_WAY
    ]
)


class LinkRanges(NamedTuple):
    """Range of each robot's links in the link table, (rows,) each."""

    first: IntArray
    weak: IntArray  # first link of interference only
    stop: IntArray


class JammerSchedule(NamedTuple):
    """Jammers under the current poses, and their switching times until the next poses."""

    arena: IntArray  # (k,)
    power_mw: FloatArray  # (k, robots) power at each robot of the arena
    is_on: BoolArray  # (k,)
    at_ns: IntArray  # (n,) rising
    jammer: IntArray  # (n,) jammer that switches
    next: IntArray  # (1,) index of the next switching time


class RadioSwitches(NamedTuple):
    """The switch of each radio, and the packets to send while it is off, (rows,) each."""

    is_on: BoolArray
    backlog: IntArray  # DROP, NEWEST or ALL; DROP while the radio is on
    drop_fate: IntArray  # fate of packets to send while the radio is off, under DROP


class AirtimeLog(NamedTuple):
    """Airtime of robots by minute, (rows, minutes) each; no rows without a duty cycle."""

    minute: IntArray  # number of the minute
    airtime_ns: IntArray  # airtime of frames that started in it


class PhyState(NamedTuple):
    """The tables that events read and change."""

    keys: KeyArray
    robot: Table
    reception: Table
    link: Table
    links: LinkRanges  # links of each robot under the current poses
    pose_id: int  # number of the current poses
    packet: Table
    order: IntArray  # rows of packets by sender, in the order of sending
    switch: RadioSwitches
    spent: AirtimeLog
    jam: JammerSchedule
    ht: tuple[Any, ...] | None  # `HtState` of radios of 802.11n


def idle_robots(rows: int) -> Table:
    """Return a table of dtype ROBOT without packets, in a medium that has been idle for long."""
    robot: Table = np.zeros(rows, ROBOT)
    robot["packet"], robot["ack_to"], robot["last_fate"] = NO_PACKET, NO_ROBOT, NO_FATE
    robot["free_from_ns"] = LONG_AGO_NS
    return robot


def idle_receptions(rows: int) -> Table:
    """Return a table of dtype RECEPTION without frames on air."""
    reception: Table = np.zeros(rows, RECEPTION)
    reception["locked_to"], reception["signal_mw"] = NO_ROBOT, np.inf
    return reception
