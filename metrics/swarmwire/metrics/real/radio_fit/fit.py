"""The fit of a log: of a radio with RSSI, or of a network with delivery and latency alone."""

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.base.arrays import BoolArray, FloatArray, IntArray
from swarmwire.metrics.real.radio_fit.delay import OTHER_SHAPE, LatencyFit, fit_latency
from swarmwire.metrics.real.radio_fit.logs import NetworkLog, PacketLog, loss_sequences
from swarmwire.metrics.real.radio_fit.losses import MAX_PACKETS, LossFit, LossSequences, fit_losses
from swarmwire.metrics.real.radio_fit.path_loss import (
    EstimatedValue,
    PathLossFit,
    fit_path_loss,
    implausibility,
    missing_data,
)
from swarmwire.metrics.real.radio_fit.shadowing import ShadowingFit, fit_shadowing, location_means

BIASED_BY_LOSS = 0.05  # share of lost packets in the farthest quarter above which a note names the missing RSSI
MIN_PACKETS = 100
MIN_BEYOND = 30  # packets from farther away that a range needs
STRAY = 0.01  # greatest share of packets received from beyond the range
NEIGHBOURS = 0.1  # least PDR of both directions between neighbours, the edges of the emulator's radio graph


@dataclass(frozen=True)
class RadioFit:
    """The fit of a radio to a log. A part without enough data is a sentence on the missing data."""

    log: PacketLog
    path_loss: PathLossFit | str
    shadowing: ShadowingFit | str
    losses: LossFit | str
    sequences: LossSequences
    notes: tuple[str, ...]  # possible biases

    @property
    def distance_m(self) -> FloatArray:
        """Values of received packets, (n,)."""
        return self.log.distance_m[self.log.received]

    @property
    def rssi_dbm(self) -> FloatArray:
        """Values of received packets, (n,)."""
        return self.log.rssi_dbm[self.log.received]

    @property
    def residual_db(self) -> FloatArray:
        """RSSI above the line of path loss, of each received packet, (n,); empty without a line."""
        if isinstance(self.path_loss, str):
            return np.zeros(0)
        return self.rssi_dbm - self.path_loss.rssi_dbm(self.distance_m)


def fit_radio(log: PacketLog) -> RadioFit:
    """Fit each part that has enough data; never raises for too little data."""
    sequences = loss_sequences(log)
    distance_m, rssi_dbm = log.distance_m[log.received], log.rssi_dbm[log.received]
    path_loss = _path_loss(log, distance_m, rssi_dbm)
    shadowing = _shadowing(log, path_loss)
    if isinstance(path_loss, PathLossFit) and isinstance(shadowing, ShadowingFit):
        # Standard errors of the line by the fitted field are better than those by clusters of packets.
        rssi_error_db, exponent_error = shadowing.line_errors
        path_loss = PathLossFit(
            EstimatedValue(path_loss.exponent.value, exponent_error),
            EstimatedValue(path_loss.rssi_at_1_m_dbm.value, rssi_error_db),
        )
    losses = fit_losses(sequences)
    notes = _notes(log, losses, shadowing, len(sequences.lost))
    return RadioFit(log, path_loss, shadowing, losses, sequences, notes)


def _path_loss(log: PacketLog, distance_m: FloatArray, rssi_dbm: FloatArray) -> PathLossFit | str:
    reason = missing_data(distance_m)
    if reason is not None:
        return reason
    path_loss = fit_path_loss(distance_m, rssi_dbm, _pairs(log)[log.received])
    return implausibility(path_loss) or path_loss


def _shadowing(log: PacketLog, path_loss: PathLossFit | str) -> ShadowingFit | str:
    if isinstance(path_loss, str):
        return "needs a fit of path loss"
    if log.ends_m is None:
        return "needs positions of sender and receiver, distance_m is not enough"
    return fit_shadowing(location_means(log))


def _pairs(log: PacketLog) -> IntArray:
    """Return a number per packet, equal for both directions between two robots, (n,)."""
    pairs = {pair: i for i, pair in enumerate(sorted({tuple(sorted(link)) for link in log.links}))}
    return np.array([pairs[tuple(sorted(link))] for link in log.links], np.int64)[log.link]


def _notes(log: PacketLog, losses: LossFit | str, shadowing: ShadowingFit | str, packets: int) -> tuple[str, ...]:
    notes: list[str] = []
    share = _lost_far_out(log)
    if share > BIASED_BY_LOSS:
        notes.append(
            f"{share:.0%} of the packets from the farthest quarter were lost and have no RSSI; if they were too weak, "
            "exponent, sigma and the RSSI far out are biased (exponent and sigma too small): "
            "--within M leaves far packets out"
        )
    if isinstance(losses, LossFit) and losses.loss.value > 0.0:
        notes.append(
            "all losses count here, those of weak signals and of collisions too; a scenario whose reception or access "
            "makes such losses itself counts them twice"
        )
    if packets > MAX_PACKETS:
        notes.append(f"models of loss were fitted to {MAX_PACKETS} packets at most, in stretches chosen evenly")
    if log.ends_m is None and isinstance(shadowing, str):
        notes.append("without positions the residuals' deviation is shadowing, fading and measurement together")
    return tuple(notes)


def _lost_far_out(log: PacketLog) -> float:
    """Return the share of lost packets among those at distances of the farthest quarter of received packets."""
    distance_m = log.distance_m[log.received]
    if not len(distance_m):
        return 0.0
    # The packets of a gap were sent near the position of the next row.
    far = log.last_distance_m >= np.quantile(distance_m, 0.75)
    lost = float(log.gaps[far].sum() + (far & ~log.received).sum())
    return lost / (lost + float((far & log.received).sum()))


@dataclass(frozen=True)
class RangeFit:
    """The range fitted to deliveries over distance."""

    range_m: EstimatedValue
    reached: bool  # packets were sent from farther away; else the range is at least this
    beyond: int  # packets sent from farther away, nearly all lost


def fit_range(distance_m: FloatArray, lost: BoolArray) -> RangeFit | str:
    """Fit a step to delivery over distance (n,), NaN: unknown; or return a sentence on missing data.

    The range is the maximum-likelihood step between two PDR, one within it and one of at most STRAY beyond. Its error
    is the mean distance between consecutive packets received near the range.
    """
    finite = np.isfinite(distance_m)
    order = np.argsort(distance_m[finite], kind="stable")
    distance, received = distance_m[finite][order], ~lost[finite][order]
    if len(distance) < MIN_PACKETS:
        return f"needs {MIN_PACKETS} packets with a distance, got {len(distance)}"
    if not received.any():
        return "needs packets that were received"
    count, total = np.arange(1.0, len(received) + 1.0), np.cumsum(received, dtype=np.float64)
    beyond, received_beyond = len(received) - count, total[-1] - total
    gain = _log_likelihood(total, count, 1.0) + _log_likelihood(received_beyond, beyond, STRAY)
    best = int(np.argmax(np.where(received, gain, -np.inf)))  # a range ends at a received packet
    reached = int(beyond[best]) >= MIN_BEYOND
    if not reached:
        best = int(np.flatnonzero(received)[-1])
    near = distance[: best + 1][received[: best + 1]][-MIN_BEYOND:]
    error_m = float(near[-1] - near[0]) / max(len(near) - 1, 1)
    return RangeFit(
        EstimatedValue(float(distance[best]), error_m if reached else float("nan")), reached, int(beyond[best])
    )


def _log_likelihood(successes: FloatArray, count: FloatArray, max_share: float) -> FloatArray:
    """Return the log likelihood of successes at their most likely share up to `max_share`."""
    share = np.minimum(successes / np.maximum(count, 1), max_share)
    return _entropy(successes, share) + _entropy(count - successes, 1.0 - share)


def _entropy(count: FloatArray, share: FloatArray) -> FloatArray:
    return np.where(count > 0, count * np.log(np.maximum(share, 1e-300)), 0.0)


@dataclass(frozen=True)
class LinkDelivery:
    """Numbers of sent and received packets of a link."""

    sender: str
    receiver: str
    packets: int
    received: int

    @property
    def pdr(self) -> float:
        """Share of received packets."""
        return self.received / self.packets


@dataclass(frozen=True)
class NetworkFit:
    """The fit of a network to a log. A part without enough data is a sentence on the missing data."""

    log: NetworkLog
    range: RangeFit | str
    latency: LatencyFit | str
    losses: LossFit | str
    sequences: LossSequences  # losses within range
    links: tuple[LinkDelivery, ...]
    notes: tuple[str, ...]

    @property
    def neighbours(self) -> dict[str, tuple[str, ...]]:
        """Neighbours of each robot: at least NEIGHBOURS of the packets arrived in both directions.

        Without the log of a robot its receptions are unknown, and only the other direction counts.
        """
        pdr = {(link.sender, link.receiver): link.pdr for link in self.links}

        def are_neighbours(a: str, b: str) -> bool:
            both_pdr = [pdr[link] for link in ((a, b), (b, a)) if link in pdr]
            return bool(both_pdr) and min(both_pdr) >= NEIGHBOURS

        names = self.log.names
        return {name: tuple(other for other in names if are_neighbours(name, other)) for name in names}


def fit_network(log: NetworkLog) -> NetworkFit:
    """Fit each part that has enough data; never raises for too little data."""
    range_fit = fit_range(log.distance_m, log.lost)
    sequences = log.sequences(_within(log, range_fit))
    latency = fit_latency(log.packets.latency_s)
    losses = fit_losses(sequences)
    notes = (*log.notes, *_notes_network_fit(range_fit, latency, losses, len(sequences.lost)))
    return NetworkFit(log, range_fit, latency, losses, sequences, deliveries(log), notes)


def _within(log: NetworkLog, range_fit: RangeFit | str) -> BoolArray:
    """Return True for packets within range, (n,); True for all without a range."""
    if isinstance(range_fit, str):
        return np.ones(len(log.lost), np.bool_)
    return ~(log.distance_m > range_fit.range_m.value)


def deliveries(log: NetworkLog) -> tuple[LinkDelivery, ...]:
    """Return the numbers of packets of each link with packets, by sender and then receiver."""
    robots = len(log.names)
    link: IntArray = log.packets.sender * robots + log.packets.receiver
    count, received = np.bincount(link), np.bincount(link, ~log.lost)
    return tuple(
        LinkDelivery(log.names[n // robots], log.names[n % robots], int(count[n]), int(received[n]))
        for n in np.flatnonzero(count).tolist()
    )


def _notes_network_fit(
    range_fit: RangeFit | str, latency: LatencyFit | str, losses: LossFit | str, packets: int
) -> list[str]:
    notes: list[str] = []
    if isinstance(range_fit, RangeFit) and not range_fit.reached:
        notes.append(f"packets were received at all distances: the range is {range_fit.range_m.value:.3g} m or more")
    if isinstance(range_fit, RangeFit) and range_fit.reached:
        notes.append(f"{range_fit.beyond} packets from beyond the range count as out of range, not as lost")
    if isinstance(latency, LatencyFit) and latency.negative > 0.0:
        notes.append(f"{latency.negative:.1%} of the packets came before they were sent: clocks differ")
    if isinstance(latency, LatencyFit) and (latency.delays is not None or latency.ks_distance > OTHER_SHAPE):
        percentiles = ", ".join(f"{1e3 * value:.3g}" for value in latency.percentiles_s)
        other = "no distribution of [radio.delays] fits clearly better"
        if latency.delays is not None:
            other = (
                f"[radio.delays] is {latency.delays.distribution}, with a Kolmogorov-Smirnov distance of "
                f"{latency.delays.ks_distance:.2g}, uniform jitter {latency.ks_distance:.2g}"
            )
        notes.append(f"latencies are not uniform (p50, p90, p99: {percentiles} ms): {other}")
    if isinstance(losses, LossFit) and losses.loss.value > 0.0:
        notes.append(
            "all losses count here, those of obstacles and of collisions too; a scenario that makes such losses itself "
            "counts them twice"
        )
    if packets > MAX_PACKETS:
        notes.append(f"models of loss were fitted to {MAX_PACKETS} packets at most, in stretches chosen evenly")
    return notes


def delivery_over_distance(log: NetworkLog, edges_m: FloatArray) -> tuple[FloatArray, IntArray]:
    """Return PDR and number of packets by bins of distance, (bins,) each; the PDR of an empty bin is NaN."""
    finite = np.isfinite(log.distance_m)
    sent = np.histogram(log.distance_m[finite], edges_m)[0]
    received = np.histogram(log.distance_m[finite & ~log.lost], edges_m)[0]
    return received / np.where(sent > 0, sent, np.nan), sent
