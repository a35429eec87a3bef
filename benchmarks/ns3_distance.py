"""Delivery of 802.15.4 over distance: ns-3's, the formula's, and what the medium makes of it."""

# pyright: basic, reportUnknownMemberType=false

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.ns3_reference import radio_far_apart, recorded
from swarmwire.comms.clock import tick_start_ns
from swarmwire.comms.draws import derive_key
from swarmwire.comms.geometry.obstacles import obstacle_arrays
from swarmwire.comms.packets import BROADCAST, Fate, Payloads, SentPackets
from swarmwire.comms.radio.medium import RadioMedium
from swarmwire.comms.radio.propagation.decibels import from_db
from swarmwire.comms.radio.propagation.path_loss import loss_db
from swarmwire.comms.radio.reception.error_rates import oqpsk_success

FILE = "ns3_802154_distance.json"
SEEDS, PACKETS = 20, 1000  # of the table: 20,000 packets at each distance, as many as ns-3 sent
LIMIT = 0.02  # of either difference, absolute
RATE_HZ = 50  # two packets in each of ns-3's intervals: nobody else sends
QUIET_TICKS = 2


@dataclass(frozen=True)
class Point:
    """Delivery at one distance."""

    distance_m: float
    ns3: float
    formula: float  # (1 - BER)^bits of the whole frame
    ours: float

    @property
    def agrees(self) -> bool:
        """Whether ours lies within the limit of both others."""
        return abs(self.ours - self.ns3) <= LIMIT and abs(self.ours - self.formula) <= LIMIT


def points(seeds: Sequence[int], packets: int) -> Iterator[Point]:
    """Every distance that ns-3 was run at, with so many packets for each seed."""
    file = recorded(FILE)
    payload_bytes = file["parameters"]["payload_bytes"]
    for row in file["rows"]:
        distance_m = float(row["distance_m"])
        ours = delivered(distance_m, payload_bytes, seeds, packets)
        yield Point(distance_m, row["delivery_ratio"], by_formula(distance_m, payload_bytes), ours)


def by_formula(distance_m: float, payload_bytes: int) -> float:
    """The success of a lone frame at the SNR that path loss leaves."""
    radio = radio_far_apart("802.15.4")
    loss = loss_db(radio.loss_model.curve(radio.frequency_hz), distance_m)
    snr_db = radio.antenna_or_default.power_dbm - loss - radio.noise_or_default.power_dbm
    return float(oqpsk_success(from_db(snr_db), 8 * (payload_bytes + radio.overhead_bytes)))


def delivered(distance_m: float, payload_bytes: int, seeds: Sequence[int], packets: int) -> float:
    """The share that one robot hears of what another sends, so far away; an arena per seed."""
    radio = radio_far_apart("802.15.4")
    arenas = len(seeds)
    keys = np.array([derive_key("distance", seed) for seed in seeds], np.uint64)
    air = RadioMedium(radio, keys, 2, (2.0 * distance_m, 2.0), obstacle_arrays(((),) * arenas), RATE_HZ)
    pose = np.tile([[-0.5 * distance_m, 0.0, 0.0], [0.5 * distance_m, 0.0, 0.0]], (arenas, 1))
    sender = 2 * np.arange(arenas)
    sent = SentPackets(sender, np.full(arenas, BROADCAST), Payloads.of([bytes(payload_bytes)] * arenas))
    received = 0
    for tick in range(packets + QUIET_TICKS):
        at_ns = tick_start_ns(tick, RATE_HZ)
        received += int(air.step(at_ns, pose).tally.fates[:, Fate.RECEIVED].sum())
        if tick < packets:
            air.send(at_ns, tick, sent)
    return received / (arenas * packets)


def table(seeds: Sequence[int] = range(SEEDS), packets: int = PACKETS) -> Iterator[str]:
    """Lines of the table, each as soon as it is known."""
    yield "| distance, m | ns-3: delivered | formula | ours: delivered | to ns-3 | to the formula | within limits |"
    yield "| --- " * 7 + "|"
    for point in points(seeds, packets):
        cells = [f"{point.distance_m:g}", f"{point.ns3:.3f}", f"{point.formula:.3f}", f"{point.ours:.3f}"]
        cells += [f"{point.ours - point.ns3:+.3f}", f"{point.ours - point.formula:+.3f}"]
        yield "| " + " | ".join([*cells, "yes" if point.agrees else "**no**"]) + " |"
