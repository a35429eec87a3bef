"""The tables that the run of events works on: robots, links, packets."""

# pyright: basic, reportUnknownMemberType=false

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swarmwire.comms.arrays import BoolArray, FloatArray, IntArray, KeyArray
from swarmwire.comms.truth import NO_ROBOT

# What a robot's radio does with the packet at the head of its queue; from BACKING_OFF on there is one.
NOTHING, PAUSING, BACKING_OFF, LISTENING, TURNING, SENDING, AWAITING, HELD = range(8)
# What becomes of packets of a radio that is off, beside the fates: they wait for it.
KEPT_ALL, KEPT_NEWEST = -1, -2
# What a robot has on air.
SILENT, DATA, ACKNOWLEDGEMENT = range(3)
RECEIVING = 255  # of a link, beside the fates: the frame on air may still be received
LONG_AGO_NS = -(10**15)
NOT_LEARNED = -1  # the result of a packet whose sender died while it was on air

_I, _F = np.int64, np.float64


def _rows(fields: list[tuple[str, type]]) -> np.dtype[np.void]:
    """Rows whose fields are attributes, as they are in compiled code, also where the compiler is off."""
    return np.dtype((np.record, np.dtype(fields, align=True)))


ROBOT = _rows(
    [
        # The queue: places in the order of packets by sender.
        ("next", _I),  # the first packet that is not served yet
        ("entry", _I),  # the first that its radio was not handed yet
        ("stop", _I),
        ("waiting", _I),  # packets handed over, not served yet
        # Access.
        ("stage", _I),
        ("packet", _I),  # being served, from BACKING_OFF on
        ("attempt", _I),  # of this packet, from 0
        ("busy_times", _I),  # CSMA: NB
        ("exponent", _I),  # CSMA: BE; DCF: how often the window was doubled
        ("slots", _I),  # DCF: left to wait, counted from `free_from_ns` + DIFS while the medium is free
        ("free_from_ns", _I),  # DCF
        ("trust_from_ns", _I),  # DCF: after a frame that was not understood the medium counts as free only from here
        # The frame on air.
        ("on_air", _I),
        ("on_air_ns", _I),
        ("airtime_ns", _I),
        ("bits", _I),
        ("first_link", _I),  # those that may be told of
        ("weak_link", _I),  # and, from here on, those that only disturb
        ("stop_link", _I),
        ("hold", _I),  # of the poses held when it went on air
        # Acknowledgements.
        ("answers_to", _I),  # sender row
        ("last_fate", _I),  # of the latest attempt at an addressed packet
        ("last_in_range", _I),
        ("last_mw", _F),
    ]
)
# What every frame on air changes at every robot near, and so in one line of the processor's cache.
RECEPTION = _rows(
    [
        ("power_mw", _F),  # all frames on air here
        ("peak_mw", _F),  # CSMA: most of `power_mw` while it listens
        ("signal_mw", _F),  # the frame being received; inf if there is none
        ("log_success", _F),  # of its chunks so far
        ("since_ns", _I),  # start of the chunk that is not in `log_success` yet
        ("locked_to", np.int32),  # sender row of the frame being received, or NOBODY
        ("link", np.int32),  # and its link
        ("signals", np.int32),  # frames on air here
        ("jam_mw", np.float32),  # all that is no frame
        ("jam_log", np.float32),  # what that has taken from `log_success`
        ("is_deaf", np.int8),  # it sends, or is about to
        ("is_busy", np.int8),  # DCF: as it was when last looked at
    ]
)
PACKET = _rows(
    [
        ("sender", _I),
        ("to", _I),  # robot row, or NOBODY: a broadcast
        ("sequence", _I),
        ("sent_at_ns", _I),
        ("airtime_ns", _I),
        ("bits", _I),
        ("pause_ns", _I),  # silence of its sender after it
        ("refused", _I),  # 0, or the fate that its size gives it
        ("is_entered", _I),
        ("is_settled", _I),  # its one receiver received it
        ("is_done", _I),
        ("is_departed", _I),  # it was reported before, and is not done yet
        ("on_air_at_ns", _I),  # of the latest attempt
        ("fate", _I),  # that it had at the sender's radio, or RECEIVED: it was on air
        ("result", _I),  # TxResult, once it is done: what its sender knows
    ]
)
# Links by sender: to robots that may be told of a frame, and then to those that it only disturbs. In few bytes, since
# each frame goes over its links three times, and the next frame over others.
LINK = _rows(
    [
        ("power_mw", _F),  # at the receiver, with fading
        ("receiver", np.int32),  # robot row
        ("is_listed", np.bool_),  # mean power reaches the sensitivity
        ("fate", np.uint8),  # RECEIVED: open; else what ends every packet here
        ("now", np.uint8),  # of the frame on air: RECEIVING or a fate
    ]
)
Table = NDArray[np.void]


class LinkPlaces(NamedTuple):
    """Where in a table of links each robot's are, (rows,) each."""

    first: IntArray
    weak: IntArray  # the first that it only disturbs
    stop: IntArray


class Jam(NamedTuple):
    """Jammers under the poses held, and when they go on or off until the next."""

    arena: IntArray  # (k,)
    power_mw: FloatArray  # (k, robots) at each robot of the arena
    is_on: BoolArray  # (k,)
    at_ns: IntArray  # (n,) rising
    which: IntArray  # (n,) the jammer that goes on if it is off, or off
    next: IntArray  # (1,) the first of them that has not come yet


class PhyState(NamedTuple):
    """All that events read and change."""

    keys: KeyArray
    robot: Table
    reception: Table
    link: Table
    places: LinkPlaces  # under the poses held
    hold: int  # which poses these are
    packet: Table
    order: IntArray  # packets by sender, in the order of sending
    off: IntArray  # (rows,) RECEIVED: the radio is on; else the fate of what it should send, or KEPT_ALL or KEPT_NEWEST
    jam: Jam


def robots_at_rest(rows: int) -> Table:
    """A table of dtype ROBOT: nobody has a packet, and the medium has been free for long."""
    robot: Table = np.zeros(rows, ROBOT)
    robot["packet"] = robot["answers_to"] = NO_ROBOT
    robot["free_from_ns"] = LONG_AGO_NS
    return robot


def receptions_of_nothing(rows: int) -> Table:
    """A table of dtype RECEPTION: nothing is on air."""
    reception: Table = np.zeros(rows, RECEPTION)
    reception["locked_to"], reception["signal_mw"] = NO_ROBOT, np.inf
    return reception
