"""The whole fit of a real network's log: range, losses within it, latency, and what may be biased."""

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.arrays import BoolArray, FloatArray, IntArray
from swarmwire.metrics.radio_fit.latency_fit import OTHER_SHAPE, LatencyFit, fit_latency
from swarmwire.metrics.radio_fit.loss_fit import MAX_PACKETS, LossFit, fit_losses
from swarmwire.metrics.radio_fit.loss_sequences import LossSequences
from swarmwire.metrics.radio_fit.network_log import NetworkLog
from swarmwire.metrics.radio_fit.range_fit import RangeFit, fit_range

NEIGHBOURS = 0.1  # delivered both ways at least: an edge of the emulator's radio graph, unless told


@dataclass(frozen=True)
class LinkDelivery:
    """How many packets of a link arrived."""

    sender: str
    receiver: str
    packets: int
    received: int

    @property
    def pdr(self) -> float:
        """The share that arrived."""
        return self.received / self.packets


@dataclass(frozen=True)
class NetworkFit:
    """What a log says of a network. A fit that the log is too small for is the sentence that says what it lacks."""

    log: NetworkLog
    range: RangeFit | str
    latency: LatencyFit | str
    losses: LossFit | str
    sequences: LossSequences  # of packets within range
    links: tuple[LinkDelivery, ...]
    notes: tuple[str, ...]

    @property
    def neighbours(self) -> dict[str, tuple[str, ...]]:
        """By robot: with whom it exchanged packets, a tenth of them each way at least.

        Of robots whose logs are not there nothing tells what they received: the way that is known counts alone.
        """
        pdr = {(link.sender, link.receiver): link.pdr for link in self.links}

        def are_neighbours(one: str, other: str) -> bool:
            known = [pdr[way] for way in ((one, other), (other, one)) if way in pdr]
            return bool(known) and min(known) >= NEIGHBOURS

        names = self.log.names
        return {name: tuple(other for other in names if are_neighbours(name, other)) for name in names}


def fit_network(log: NetworkLog) -> NetworkFit:
    """Fit what can be fitted; never raises for too little data."""
    found = fit_range(log.distance_m, log.lost)
    sequences = log.sequences(_within(log, found))
    latency = fit_latency(log.packets.latency_s)
    losses = fit_losses(sequences)
    notes = (*log.notes, *_notes(found, latency, losses, len(sequences.lost)))
    return NetworkFit(log, found, latency, losses, sequences, deliveries(log), notes)


def _within(log: NetworkLog, found: RangeFit | str) -> BoolArray:
    """Which packets were within range, (n,): all where there is none."""
    if isinstance(found, str):
        return np.ones(len(log.lost), np.bool_)
    return ~(log.distance_m > found.range_m.value)


def deliveries(log: NetworkLog) -> tuple[LinkDelivery, ...]:
    """How many packets arrived on each link that had any, by sender and then receiver."""
    of, robots = log.packets, len(log.names)
    link: IntArray = of.sender * robots + of.receiver
    count, received = np.bincount(link), np.bincount(link, ~log.lost)
    return tuple(
        LinkDelivery(log.names[n // robots], log.names[n % robots], int(count[n]), int(received[n]))
        for n in np.flatnonzero(count).tolist()
    )


def _notes(found: RangeFit | str, latency: LatencyFit | str, losses: LossFit | str, packets: int) -> list[str]:
    notes: list[str] = []
    if isinstance(found, RangeFit) and not found.reached:
        notes.append(
            f"packets were received from as far as robots went: the range is {found.range_m.value:.3g} m or more"
        )
    if isinstance(found, RangeFit) and found.reached:
        notes.append(f"{found.beyond} packets from beyond the range count as out of range, not as lost")
    if isinstance(latency, LatencyFit) and latency.negative > 0.0:
        notes.append(f"{latency.negative:.1%} of the packets came before they were sent: clocks are apart")
    if isinstance(latency, LatencyFit) and (latency.delays is not None or latency.apart > OTHER_SHAPE):
        told = ", ".join(f"{1e3 * value:.3g}" for value in latency.percentiles_s)
        other = "no distribution of [radio.delays] fits clearly better"
        if latency.delays is not None:
            other = (
                f"[radio.delays] is {latency.delays.distribution}, {latency.delays.apart:.2g} from them by Kolmogorov "
                f"and Smirnov's distance, uniform jitter {latency.apart:.2g}"
            )
        notes.append(f"latencies are not uniform (p50, p90, p99: {told} ms): {other}")
    if isinstance(losses, LossFit) and losses.loss.value > 0.0:
        notes.append(
            "all losses count here, those of obstacles and of collisions too; a scenario that makes such losses itself "
            "counts them twice"
        )
    if packets > MAX_PACKETS:
        notes.append(f"models of loss were fitted to {MAX_PACKETS} packets at most, in stretches chosen evenly")
    return notes


def delivery_over_distance(log: NetworkLog, edges_m: FloatArray) -> tuple[FloatArray, IntArray]:
    """The share of packets that arrived and how many were sent, by bins of distance, (bins,) each; NaN of none."""
    known = np.isfinite(log.distance_m)
    sent = np.histogram(log.distance_m[known], edges_m)[0]
    received = np.histogram(log.distance_m[known & ~log.lost], edges_m)[0]
    return received / np.where(sent > 0, sent, np.nan), sent
