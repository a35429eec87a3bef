"""Tables of the PHY's event simulation: robots, receptions, packets and links.

Rows are numpy records. Comments state the meaning of each field.
"""

# pyright: basic, reportUnknownMemberType=false

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swarmwire.comms.base.arrays import BoolArray, FloatArray, IntArray, KeyArray
from swarmwire.comms.base.sentinels import NO_FATE, NO_PACKET, NO_ROBOT, UNDER_WAY

# Stage of a robot's radio; from BACKING_OFF on it serves a packet.
IDLE, SPACING, BACKING_OFF, SENSING, TURNAROUND, SENDING, AWAITING_ACK, HELD = range(8)
# The kind of frame that a robot has on air.
SILENT, DATA, ACKNOWLEDGEMENT = range(3)
RECEIVING = UNDER_WAY  # a link's `frame_fate` while the frame is being received
LONG_AGO_NS = -(10**15)
NO_RESULT = -1  # result of a packet whose sender died while it was on air

_I, _F = np.int64, np.float64


def _rows(fields: list[tuple[str, type]]) -> np.dtype[np.void]:
    """A record type: fields are attributes, as in compiled code, also with the compiler off."""
    return np.dtype((np.record, np.dtype(fields, align=True)))


ROBOT = _rows(
    [
        # The queue: places in the order of packets by sender.
        ("next", _I),  # the first packet that is not served yet
        ("entry", _I),  # the first that has not entered the queue yet
        ("stop", _I),
        ("waiting", _I),  # packets in the queue, not served yet
        # Access.
        ("stage", _I),
        ("packet", _I),  # being served, from BACKING_OFF on
        ("attempt", _I),  # attempt number of this packet, from 0
        ("nb", _I),  # CSMA: NB, number of busy CCAs
        ("exponent", _I),  # CSMA: BE; DCF: number of window doublings
        ("backoff_slots", _I),  # DCF: remaining slots, counted from `free_from_ns` + DIFS while the medium is idle
        ("free_from_ns", _I),  # DCF: start of the idle period
        ("eifs_until_ns", _I),  # DCF: after a frame that was not decoded the medium counts as idle only from here
        ("nav_until_ns", _I),  # DCF: end of the NAV; idle only from here
        # The frame on air.
        ("on_air", _I),
        ("on_air_ns", _I),
        ("airtime_ns", _I),
        ("bits", _I),
        ("to", _I),  # robot row, BROADCAST or NOWHERE
        ("duration_ns", _I),  # DCF: reserved after its end, the field Duration of its header
        ("first_link", _I),  # strong links: their fates are recorded
        ("weak_link", _I),  # from here on interference only
        ("stop_link", _I),
        ("hold", _I),  # number of the poses when it went on air
        # Acknowledgements.
        ("ack_to", _I),  # sender row of the frame to acknowledge
        ("last_fate", _I),  # of the latest attempt at a unicast packet, or NO_FATE
        ("last_in_range", _I),
        ("last_mw", _F),
    ]
)
# State that every frame changes at every robot nearby; small enough for one cache line.
RECEPTION = _rows(
    [
        ("power_mw", _F),  # sum of all frames on air here
        ("peak_mw", _F),  # CSMA: maximum of `power_mw` during the CCA
        ("signal_mw", _F),  # the frame being received; inf if there is none
        ("log_success", _F),  # sum over its chunks so far
        ("since_ns", _I),  # start of the chunk that is not in `log_success` yet
        ("locked_to", np.int32),  # sender row of the frame being received, or NO_ROBOT
        ("link", np.int32),  # link row of that frame
        ("signals", np.int32),  # number of frames on air here
        ("jam_mw", np.float32),  # power of jammers
        ("jam_log", np.float32),  # the part of `log_success` due to jammers
        ("is_deaf", np.int8),  # it sends, or is about to
        ("is_busy", np.int8),  # DCF: latest result of carrier sense
    ]
)
PACKET = _rows(
    [
        ("sender", _I),
        ("to", _I),  # robot row, BROADCAST or NOWHERE
        ("sequence", _I),
        ("sent_at_ns", _I),
        ("airtime_ns", _I),
        ("bits", _I),
        ("pause_ns", _I),  # interframe space after it
        ("is_too_large", np.bool_),
        ("is_entered", _I),
        ("is_settled", _I),  # the fate at its one receiver is recorded
        ("is_done", _I),
        ("is_departed", _I),  # it left the sender in earlier results, and is not done yet
        ("on_air_at_ns", _I),  # of the latest attempt
        ("fate", _I),  # at the sender's radio; UNDER_WAY: none, it waits or was on air
        ("result", _I),  # TxResult for its sender, valid once it is done
    ]
)
# Links by sender: strong links, then links of interference only. Rows are small, since each frame passes over its links
# three times, and the next frame over others.
LINK = _rows(
    [
        ("power_mw", _F),  # at the receiver, with fading
        ("receiver", np.int32),  # robot row
        ("above_sensitivity", np.bool_),  # mean power reaches the sensitivity
        ("fate", np.int8),  # of every packet: UNDER_WAY, or the drop reason of a link that is cut
        ("frame_fate", np.int8),  # fate of the frame on air, or RECEIVING
    ]
)
Table = NDArray[np.void]


class LinkPlaces(NamedTuple):
    """Rows of each robot's links in the link table, (rows,) each."""

    first: IntArray
    weak: IntArray  # the first link of interference only
    stop: IntArray


class JammerSchedule(NamedTuple):
    """Jammers under the current poses, and their switching times until the next poses."""

    arena: IntArray  # (k,)
    power_mw: FloatArray  # (k, robots) at each robot of the arena
    is_on: BoolArray  # (k,)
    at_ns: IntArray  # (n,) rising
    which: IntArray  # (n,) the jammer that switches
    next: IntArray  # (1,) index of the next switching time


class RadioSwitches(NamedTuple):
    """The switch of each radio, and the packets to send while it is off, (rows,) each."""

    is_on: BoolArray
    backlog: IntArray  # DROP, NEWEST or ALL; DROP while the radio is on
    drop_fate: IntArray  # fate of packets to send while the radio is off, under DROP


class PhyState(NamedTuple):
    """Everything that events read and change."""

    keys: KeyArray
    robot: Table
    reception: Table
    link: Table
    places: LinkPlaces  # under the current poses
    hold: int  # number of the current poses
    packet: Table
    order: IntArray  # packets by sender, in the order of sending
    switch: RadioSwitches
    jam: JammerSchedule


def idle_robots(rows: int) -> Table:
    """A table of dtype ROBOT: no packets, and a medium that has been idle for long."""
    robot: Table = np.zeros(rows, ROBOT)
    robot["packet"], robot["ack_to"], robot["last_fate"] = NO_PACKET, NO_ROBOT, NO_FATE
    robot["free_from_ns"] = LONG_AGO_NS
    return robot


def idle_receptions(rows: int) -> Table:
    """A table of dtype RECEPTION: no frame is on air."""
    reception: Table = np.zeros(rows, RECEPTION)
    reception["locked_to"], reception["signal_mw"] = NO_ROBOT, np.inf
    return reception
