"""The tables that the run of events works on: robots, links, packets, and what it tells."""

# pyright: basic, reportUnknownMemberType=false

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swarmwire.comms.air.reception.reception import Receiver
from swarmwire.comms.arrays import BoolArray, FloatArray, IntArray, KeyArray

# What a robot's radio does with the packet at the head of its queue; from BACKING_OFF on there is one.
NOTHING, PAUSING, BACKING_OFF, LISTENING, TURNING, SENDING, AWAITING = range(7)
# What a robot has on air.
SILENT, DATA, ACKNOWLEDGEMENT = range(3)
RECEIVING = -1  # of a link, beside the fates: the frame on air may still be heard
NOBODY = -1

_I, _F = np.int64, np.float64

ROBOT = np.dtype(
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
        ("slots", _I),  # DCF: left to wait, counted from `free_from_ns` + DIFS while the air is free
        ("free_from_ns", _I),  # DCF
        ("trust_from_ns", _I),  # DCF: after a frame that was not understood the air counts as free only from here
        ("is_busy", _I),  # DCF
        ("peak_mw", _F),  # CSMA: most power while it listens
        # The frame on air.
        ("on_air", _I),
        ("on_air_ns", _I),
        ("airtime_ns", _I),
        ("bits", _I),
        ("first_link", _I),
        ("stop_link", _I),
        ("hold", _I),  # of the poses held when it went on air
        # Reception.
        ("locked_to", _I),  # sender row of the frame being received, or NOBODY
        ("link", _I),  # and its link
        ("since_ns", _I),  # start of the chunk that is not in `log_success` yet
        ("signal_mw", _F),
        ("log_success", _F),  # of the chunks so far
        ("power_mw", _F),  # all that is on air here
        ("signals", _I),  # of which there are so many
        # Acknowledgements.
        ("answers_to", _I),  # sender row
        ("last_fate", _I),  # of the latest attempt at an addressed packet
        ("last_in_range", _I),
        ("last_mw", _F),
    ],
    align=True,
)
LINK = np.dtype(
    [
        ("receiver", _I),
        ("power_mw", _F),  # with fading
        ("fate", _I),  # HEARD: open; else what ends every packet here
        ("is_listed", _I),  # mean power reaches the sensitivity
        ("now", _I),  # of the frame on air: RECEIVING or a fate
    ],
    align=True,
)
PACKET = np.dtype(
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
        ("is_settled", _I),  # its one receiver heard it
        ("is_done", _I),
        ("on_air_at_ns", _I),  # of the latest attempt
        ("fate", _I),  # that it had at the sender's radio, or HEARD: it was on air
    ],
    align=True,
)
Table = NDArray[np.void]


class Rules(NamedTuple):
    """The radio in numbers; powers in mW, times in ns."""

    robots: int  # in each arena
    method: int  # a place in METHODS
    acknowledged: bool
    queue_limit: int
    noise_mw: float
    least_sinr: float  # that a preamble needs
    least_mw: float  # that a preamble needs
    sure_sinr: float  # from here on all bits are right
    take_over_ns: int  # how long after its start a frame gives way to a stronger one
    loss: float
    busy_mw: float
    retries: int
    # Acknowledgements.
    short_space_ns: int
    acknowledgement_ns: int  # airtime
    acknowledgement_bits: int
    patience_ns: int  # how long an acknowledgement is waited for
    # CSMA.
    backoff_ns: int
    listen_ns: int
    turnaround_ns: int
    least_exponent: int
    most_exponent: int
    most_backoffs: int
    # DCF.
    slot_ns: int
    difs_ns: int
    distrust_ns: int  # EIFS - DIFS
    least_window: int
    most_window: int
    receiver: Receiver
    log_success: FloatArray  # by SINR, as `log_success_table` has it


class Bursting(NamedTuple):
    """Which links were good or bad, as `BurstStates` keeps them."""

    is_on: bool
    link: IntArray
    at_ns: IntArray
    bad: BoolArray
    added: IntArray  # (1,)
    a: float
    b: float
    loss_bad: float
    loss_good: float


class Told(NamedTuple):
    """What the run of events tells: a row per packet and receiver, or per packet that never went on air."""

    row: IntArray  # (capacity, 7) packet, receiver row or NOBODY, fate, in range, final_at, hold, on_air_at
    power_mw: FloatArray  # (capacity,) at the receiver
    count: IntArray  # (1,)


class State(NamedTuple):
    """All that events read and change."""

    keys: KeyArray
    robot: Table
    link: Table
    packet: Table
    order: IntArray  # packets by sender, in the order of sending
    off: IntArray  # (rows,) HEARD: the radio is on; else the fate of what it should send


def told(capacity: int) -> Told:
    """Room for so many rows."""
    return Told(np.empty((capacity, 7), np.int64), np.empty(capacity), np.zeros(1, np.int64))
