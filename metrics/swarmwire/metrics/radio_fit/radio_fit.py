"""The whole fit of a log: path loss, shadowing and losses, what was left out, and what may be biased."""

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.arrays import FloatArray, IntArray
from swarmwire.metrics.radio_fit.estimate import Estimate
from swarmwire.metrics.radio_fit.loss_fit import MAX_PACKETS, LossFit, fit_losses
from swarmwire.metrics.radio_fit.loss_sequences import LossSequences, loss_sequences
from swarmwire.metrics.radio_fit.path_loss_fit import PathLossFit, fit_path_loss, why_none, why_not
from swarmwire.metrics.radio_fit.places import places_of
from swarmwire.metrics.radio_fit.radio_log import RadioLog
from swarmwire.metrics.radio_fit.shadowing_fit import ShadowingFit, fit_shadowing

BIASED_BY_LOSS = 0.05  # share of lost packets in the farthest quarter from which the missing RSSI are worth a word


@dataclass(frozen=True)
class RadioFit:
    """What a log says of a radio. A fit that the log is too small for is the sentence that says what it lacks."""

    log: RadioLog
    path_loss: PathLossFit | str
    shadowing: ShadowingFit | str
    losses: LossFit | str
    sequences: LossSequences
    notes: tuple[str, ...]  # what may be biased

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


def fit_radio(log: RadioLog) -> RadioFit:
    """Fit what can be fitted; never raises for too little data."""
    sequences = loss_sequences(log)
    distance_m, rssi_dbm = log.distance_m[log.received], log.rssi_dbm[log.received]
    path_loss = _path_loss(log, distance_m, rssi_dbm)
    shadowing = _shadowing(log, path_loss)
    if isinstance(path_loss, PathLossFit) and isinstance(shadowing, ShadowingFit):
        # The fitted field knows better than clusters of packets how much the log tells of the line.
        at_1_m, exponent = shadowing.line_errors
        path_loss = PathLossFit(
            Estimate(path_loss.exponent.value, exponent), Estimate(path_loss.rssi_at_1_m_dbm.value, at_1_m)
        )
    losses = fit_losses(sequences)
    notes = _notes(log, losses, shadowing, len(sequences.lost))
    return RadioFit(log, path_loss, shadowing, losses, sequences, notes)


def _path_loss(log: RadioLog, distance_m: FloatArray, rssi_dbm: FloatArray) -> PathLossFit | str:
    lack = why_not(distance_m)
    if lack is not None:
        return lack
    found = fit_path_loss(distance_m, rssi_dbm, _pairs(log)[log.received])
    return why_none(found) or found


def _shadowing(log: RadioLog, path_loss: PathLossFit | str) -> ShadowingFit | str:
    if isinstance(path_loss, str):
        return "needs a fit of path loss"
    if log.ends_m is None:
        return "needs positions of sender and receiver, of which distance_m tells too little"
    return fit_shadowing(places_of(log))


def _pairs(log: RadioLog) -> IntArray:
    """The same number for both directions between two robots, (n,)."""
    pairs = {pair: i for i, pair in enumerate(sorted({tuple(sorted(link)) for link in log.links}))}
    return np.array([pairs[tuple(sorted(link))] for link in log.links], np.int64)[log.link]


def _notes(log: RadioLog, losses: LossFit | str, shadowing: ShadowingFit | str, packets: int) -> tuple[str, ...]:
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


def _lost_far_out(log: RadioLog) -> float:
    """The share of packets lost among those around the farthest quarter of the received ones."""
    distance_m = log.distance_m[log.received]
    if not len(distance_m):
        return 0.0
    # A gap's packets were sent about where the row after it was.
    far = log.last_distance_m >= np.quantile(distance_m, 0.75)
    lost = float(log.gaps[far].sum() + (far & ~log.received).sum())
    return lost / (lost + float((far & log.received).sum()))
