"""Contention: nodes at one position that all send at an interval, a figure for comparison with other simulators."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from swarmwire.comms.base.clock import NS_PER_S, tick_start_ns
from swarmwire.comms.base.draws import derive_key
from swarmwire.comms.base.sentinels import BROADCAST
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.context import ChannelContext
from swarmwire.comms.radio.medium import RadioMedium
from swarmwire.comms.robot.packets import Fate, Payloads, SentPackets

ARENA_M = (2.0, 2.0)
WARM_UP_S = 0.5
DRAIN_S = 0.5  # receptions count for this long after the last counted packet


@dataclass(frozen=True, slots=True)
class Contention:
    """Results over all packets sent between the warm-up and the end of the measured time."""

    packets: int
    pdr: float  # receptions / (packets x other nodes)
    mean_delay_s: float | None  # time between `send` and reception; None if nothing was received


def contention(
    radio: Radio,
    nodes: int,
    payload_bytes: int,
    interval_s: float,
    seeds: Sequence[int],
    measured_s: float = 2.0,
) -> Contention:
    """Measure the contention of `nodes` that each broadcast a packet per interval (rounded to 1/n s), at `send_offset`.

    One arena per seed. Traffic continues after the measured time, until the counted packets have arrived.
    """
    rate_hz = max(round(1.0 / interval_s), 1)
    rows = nodes * len(seeds)
    keys = np.array([derive_key("arena", seed) for seed in seeds], np.uint64)
    medium = RadioMedium(ChannelContext.open_space(radio, keys, nodes, ARENA_M), rate_hz)
    payloads = Payloads.from_rows([bytes(payload_bytes)] * rows)
    sent = SentPackets(np.arange(rows), np.full(rows, BROADCAST), payloads)
    first, last = round(WARM_UP_S * rate_hz), round((WARM_UP_S + measured_s) * rate_hz)
    pose = np.zeros((rows, 3))
    counted = (last - first) * rows
    received = delay_ns = 0
    for tick in range(last + round(DRAIN_S * rate_hz) + 1):
        at_ns = tick_start_ns(tick, rate_hz)
        finished = medium.step(at_ns, pose).finished
        reached = (finished.sequence >= first) & (finished.sequence < last) & (finished.fate == Fate.RECEIVED)
        received += int(finished.receivers[reached].sum())
        delay_ns += int((finished.final_at_ns - finished.sent_at_ns)[reached].sum())
        medium.send(at_ns, tick, sent)
    mean_delay_s = delay_ns / received / NS_PER_S if received else None
    return Contention(counted, received / (counted * (nodes - 1)), mean_delay_s)
