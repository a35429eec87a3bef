"""Tables of the frame exchanges of 802.11n: MPDUs, stations, links and chunks of frames being received."""

from typing import NamedTuple

import numpy as np

from swarmwire.comms.base.arrays import IntArray, Table, record_type
from swarmwire.comms.base.sentinels import NO_ROBOT
from swarmwire.comms.radio.phy.state import PACKET

# Kinds of frames besides those of `phy/state.py`.
BLOCK_ACK, BLOCK_ACK_REQUEST, RTS, CTS = range(3, 7)

_I, _F = np.int64, np.float64
CHUNKS = 64  # chunks of a frame that a receiver tells apart; the last one holds those beyond

_PACKET_FIELDS = [(name, PACKET[name]) for name in PACKET.names or ()]
MPDU = record_type(
    [
        *_PACKET_FIELDS,
        ("attempts", _I),  # times on air
        ("is_in_ppdu", _I),  # part of the PPDU that is on air or unanswered
        ("offset_bytes", _I),  # of its start in the PSDU
        ("number", _I),  # sequence number among the packets to this robot, from 1; 0 before its first PPDU
        ("is_received", _I),  # at its receiver, which may hold it until earlier ones are there
        ("is_acked", _I),  # its sender knows
        # The last attempt.
        ("last_fate", _I),  # NO_FATE out of range
        ("last_in_range", _I),
        ("last_mw", _F),
    ]
)
STATION = record_type(
    [
        ("frames", _I),  # frames sent so far
        # The exchange: a PPDU and the response to it.
        ("to", _I),  # robot row, BROADCAST or NOWHERE
        ("first", _I),  # index in `PhyState.order` of its first MPDU
        ("count", _I),  # number of MPDUs
        ("psdu_bytes", _I),
        ("rate", _I),  # row in `PhyParams.log_success`
        ("awaits", _I),  # kind of the frame that answers the frame on air
        ("request_to", _I),  # robot row to which a block acknowledgement request is due, or NO_ROBOT
        ("requests", _I),  # unanswered requests in a row
        # The response of a receiver.
        ("answer", _I),  # kind of the frame
        ("answer_rate", _I),
        ("answer_duration_ns", _I),  # its field Duration
        ("answer_sinr", _F),  # SINR of the answered frame, without interference by other frames
    ]
)
PEER = record_type(  # what a sender knows of a receiver
    [
        ("number", np.int32),  # sequence number of the newest packet that was in a PPDU
        ("sinr", np.float32),  # of the last frame that was answered; 0: none yet
        # Adaptive auto rate fallback (AARF).
        ("rate", np.int16),
        ("threshold", np.int16),  # successes after which the rate rises; 0: the lowest
        ("successes", np.int16),
        ("failures", np.int16),
        ("is_probing", np.int16),  # the rate has risen, and no frame had it yet
    ]
)
CHUNK = record_type(
    [
        ("since_ns", _I),
        ("until_ns", _I),
        ("sinr", _F),
        ("clear_sinr", _F),  # without jammers
    ]
)


class HtState(NamedTuple):
    """The tables that events of 802.11n read and change beyond those of `PhyState`."""

    station: Table  # (rows,)
    peer: Table  # (rows, robots) by sender and index of the receiver in the arena
    chunk: Table  # (rows, CHUNKS) chunks in which bits may be wrong, of the frame being received
    chunks: IntArray  # (rows,) their number


def idle_stations(rows: int, robots: int) -> HtState:
    """Return the tables of stations that have not sent yet."""
    station: Table = np.zeros(rows, STATION)
    station["request_to"] = NO_ROBOT
    return HtState(station, np.zeros((rows, robots), PEER), np.zeros((rows, CHUNKS), CHUNK), np.zeros(rows, np.int64))
