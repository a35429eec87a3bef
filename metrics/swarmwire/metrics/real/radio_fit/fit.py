"""The fit of a whole log: of a radio with RSSI, or of a network with delivery and latency alone."""

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.base.arrays import BoolArray, FloatArray, IntArray
from swarmwire.metrics.real.radio_fit.delay import OTHER_SHAPE, LatencyFit, fit_latency
from swarmwire.metrics.real.radio_fit.logs import NetworkLog, PacketLog, loss_sequences
from swarmwire.metrics.real.radio_fit.losses import MAX_PACKETS, LossFit, LossSequences, fit_losses
from swarmwire.metrics.real.radio_fit.path_loss import EstimatedValue, PathLossFit, fit_path_loss, why_none, why_not
from swarmwire.metrics.real.radio_fit.shadowing import ShadowingFit, fit_shadowing, places_of

BIASED_BY_LOSS = 0.05  # share of lost packets in the farthest quarter from which the missing RSSI are worth a word
MIN_PACKETS = 100
MIN_BEYOND = 30  # packets in a row that were all lost farther out, for a range to have been seen
STRAY = 0.01  # share of the packets beyond the range that may arrive nevertheless
NEIGHBOURS = 0.1  # delivered both ways at least: neighbours, as edges of the emulator's radio graph


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
        """Of each received packet, (n,)."""
        return self.log.distance_m[self.log.received]

    @property
    def rssi_dbm(self) -> FloatArray:
        """Of each received packet, (n,)."""
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
        at_1_m, exponent = shadowing.line_errors
        path_loss = PathLossFit(
            EstimatedValue(path_loss.exponent.value, exponent), EstimatedValue(path_loss.rssi_at_1_m_dbm.value, at_1_m)
        )
    losses = fit_losses(sequences)
    notes = _notes(log, losses, shadowing, len(sequences.lost))
    return RadioFit(log, path_loss, shadowing, losses, sequences, notes)


def _path_loss(log: PacketLog, distance_m: FloatArray, rssi_dbm: FloatArray) -> PathLossFit | str:
    lack = why_not(distance_m)
    if lack is not None:
        return lack
    found = fit_path_loss(distance_m, rssi_dbm, _pairs(log)[log.received])
    return why_none(found) or found


def _shadowing(log: PacketLog, path_loss: PathLossFit | str) -> ShadowingFit | str:
    if isinstance(path_loss, str):
        return "needs a fit of path loss"
    if log.ends_m is None:
        return "needs positions of sender and receiver, distance_m is not enough"
    return fit_shadowing(places_of(log))


def _pairs(log: PacketLog) -> IntArray:
    """The same number for both directions between two robots, (n,)."""
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
    """The share of packets lost among those around the farthest quarter of the received ones."""
    distance_m = log.distance_m[log.received]
    if not len(distance_m):
        return 0.0
    # A gap's packets were sent about where the row after it was.
    far = log.last_distance_m >= np.quantile(distance_m, 0.75)
    lost = float(log.gaps[far].sum() + (far & ~log.received).sum())
    return lost / (lost + float((far & log.received).sum()))


@dataclass(frozen=True)
class RangeFit:
    """The range fitted to deliveries over distance."""

    range_m: EstimatedValue
    reached: bool  # whether packets were sent from farther; else the range is at least this
    beyond: int  # packets that were sent from farther, nearly all lost


def fit_range(distance_m: FloatArray, lost: BoolArray) -> RangeFit | str:
    """The step of delivery over distance (n,), NaN: unknown; or a sentence on missing data.

    The range is where two shares, one within it and one of at most a hundredth beyond, explain the losses best: maximum
    likelihood. Its error is the usual distance from one packet received out there to the next.
    """
    known = np.isfinite(distance_m)
    order = np.argsort(distance_m[known], kind="stable")
    distance, received = distance_m[known][order], ~lost[known][order]
    if len(distance) < MIN_PACKETS:
        return f"needs {MIN_PACKETS} packets with a distance, got {len(distance)}"
    if not received.any():
        return "needs packets that were received"
    count, total = np.arange(1.0, len(received) + 1.0), np.cumsum(received, dtype=np.float64)
    beyond, received_beyond = len(received) - count, total[-1] - total
    gain = _log_likelihood(total, count) + _log_likelihood_of(received_beyond, beyond, STRAY)
    best = int(np.argmax(np.where(received, gain, -np.inf)))  # a range ends where a packet was received
    reached = int(beyond[best]) >= MIN_BEYOND
    if not reached:
        best = int(np.flatnonzero(received)[-1])
    near = distance[: best + 1][received[: best + 1]][-MIN_BEYOND:]
    error_m = float(near[-1] - near[0]) / max(len(near) - 1, 1)
    return RangeFit(
        EstimatedValue(float(distance[best]), error_m if reached else float("nan")), reached, int(beyond[best])
    )


def _log_likelihood(successes: FloatArray, count: FloatArray) -> FloatArray:
    """Of these successes at their most likely share."""
    share = successes / np.maximum(count, 1)
    return _entropy(successes, share) + _entropy(count - successes, 1.0 - share)


def _log_likelihood_of(successes: FloatArray, count: FloatArray, most: float) -> FloatArray:
    """The same at a share that is `most` at most."""
    share = np.minimum(successes / np.maximum(count, 1), most)
    return _entropy(successes, share) + _entropy(count - successes, 1.0 - share)


def _entropy(count: FloatArray, share: FloatArray) -> FloatArray:
    return np.where(count > 0, count * np.log(np.maximum(share, 1e-300)), 0.0)


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
    """The fit of a network to a log. A part without enough data is a sentence on the missing data."""

    log: NetworkLog
    range: RangeFit | str
    latency: LatencyFit | str
    losses: LossFit | str
    sequences: LossSequences  # of packets within range
    links: tuple[LinkDelivery, ...]
    notes: tuple[str, ...]

    @property
    def neighbours(self) -> dict[str, tuple[str, ...]]:
        """By robot: the robots with which it exchanged packets, a tenth of them each way at least.

        Without the log of a robot its receptions are unknown, and only the other direction counts.
        """
        pdr = {(link.sender, link.receiver): link.pdr for link in self.links}

        def are_neighbours(one: str, other: str) -> bool:
            known = [pdr[way] for way in ((one, other), (other, one)) if way in pdr]
            return bool(known) and min(known) >= NEIGHBOURS

        names = self.log.names
        return {name: tuple(other for other in names if are_neighbours(name, other)) for name in names}


def fit_network(log: NetworkLog) -> NetworkFit:
    """Fit each part that has enough data; never raises for too little data."""
    found = fit_range(log.distance_m, log.lost)
    sequences = log.sequences(_within(log, found))
    latency = fit_latency(log.packets.latency_s)
    losses = fit_losses(sequences)
    notes = (*log.notes, *_notes_network_fit(found, latency, losses, len(sequences.lost)))
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


def _notes_network_fit(
    found: RangeFit | str, latency: LatencyFit | str, losses: LossFit | str, packets: int
) -> list[str]:
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
        percentiles = ", ".join(f"{1e3 * value:.3g}" for value in latency.percentiles_s)
        other = "no distribution of [radio.delays] fits clearly better"
        if latency.delays is not None:
            other = (
                f"[radio.delays] is {latency.delays.distribution}, {latency.delays.apart:.2g} from them by Kolmogorov "
                f"and Smirnov's distance, uniform jitter {latency.apart:.2g}"
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
    """The share of packets that arrived and how many were sent, by bins of distance, (bins,) each; NaN of none."""
    known = np.isfinite(log.distance_m)
    sent = np.histogram(log.distance_m[known], edges_m)[0]
    received = np.histogram(log.distance_m[known & ~log.lost], edges_m)[0]
    return received / np.where(sent > 0, sent, np.nan), sent
