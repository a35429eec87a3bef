"""The tables of Enhanced ShockBurst: its timing, the stations with their drones, and their exchanges."""

from typing import NamedTuple

import numpy as np

from swarmwire.comms.base.arrays import BoolArray, IntArray
from swarmwire.comms.base.clock import to_ns
from swarmwire.comms.base.sentinels import NO_PACKET
from swarmwire.comms.radio.config.frames import acknowledgement_bytes, acknowledgement_ns, frame_bits
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.timing import ESB


class EsbTiming(NamedTuple):
    """Times and sizes of polls beyond those of `PhyParams`; of packets without payload where not stated."""

    null_bits: int  # null packet
    null_airtime_ns: int
    frame_bits: int
    upload_ns_per_bit: int
    idle_ns: int  # between an exchange and the upload of the next: T_IRQ, and the station's computer
    has_safelink: bool


class Polling(NamedTuple):
    """The stations with their drones, and the exchange of each station; (rows,) by robot row if not stated."""

    station: IntArray  # row of the station; a station's own
    drones: IntArray  # (drones,) rows, by station
    first: IntArray  # a station's drones are drones[first:stop]
    stop: IntArray
    turn: IntArray  # index in `drones` of the drone in turn
    exchange: IntArray  # number of exchanges so far
    attempt: IntArray  # number of the attempt, from 0
    sequence: IntArray  # number of the packet in the exchange, or NO_PACKET for a null packet
    awaits: BoolArray  # True from the end of a poll to the answer's, or to ARD's
    silent: IntArray  # of a drone: number of its latest exchanges without an answer


def esb_timing(radio: Radio) -> EsbTiming:
    """Return the timing of a radio's polls."""
    null_bytes = np.array([acknowledgement_bytes(radio), radio.overhead_bytes])
    null_bits, empty_bits = frame_bits(radio, null_bytes).tolist()
    access = radio.access_or_default
    idle_ns = ESB.irq_ns(radio.bit_rate_bps) + to_ns(access.host_delay_s)
    return EsbTiming(null_bits, acknowledgement_ns(radio), empty_bits, ESB.upload_ns // 8, idle_ns, access.safelink)


def new_polling(stations: tuple[int, ...], robots: int, arenas: int) -> Polling:
    """Return stations at these indices of each arena, to which the others belong in turn."""
    rows = robots * arenas
    polls, station = np.zeros(robots, np.bool_), np.zeros(robots, np.int64)
    polls[list(stations)] = True
    station[polls] = np.flatnonzero(polls)
    station[~polls] = np.array(stations)[np.arange(robots - len(stations)) % len(stations)]
    first_row = np.repeat(np.arange(arenas) * robots, robots)
    station = np.tile(station, arenas) + first_row
    others = np.flatnonzero(station != np.arange(rows))
    drones = others[np.argsort(station[others], kind="stable")]
    first, stop = (np.searchsorted(station[drones], np.arange(rows), side) for side in ("left", "right"))
    exchange, attempt, silent = np.zeros((3, rows), np.int64)
    no_packet, awaits = np.full(rows, NO_PACKET), np.zeros(rows, np.bool_)
    return Polling(station, drones, first, stop, stop - 1, exchange, attempt, no_packet, awaits, silent)


def are_linked(polling: Polling, a: IntArray, b: IntArray) -> BoolArray:
    """Return True for pairs of robot rows of which one polls the other, (k,)."""
    return (polling.station[a] == b) | (polling.station[b] == a)
