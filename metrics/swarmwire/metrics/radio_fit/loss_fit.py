"""Losses: single ones with one probability, or bursts; by maximum likelihood, and which of them the data speak for."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
from scipy import optimize, special

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.radio.config.impairments import Bursts
from swarmwire.metrics.radio_fit.curvature import standard_errors
from swarmwire.metrics.radio_fit.estimate import Estimate
from swarmwire.metrics.radio_fit.loss_sequences import LossSequences
from swarmwire.metrics.radio_fit.runs_test import runs_z
from swarmwire.metrics.radio_fit.two_states import log_likelihood

MIN_PACKETS, MIN_LOST = 100, 10
MAX_PACKETS = 200_000  # that the search for bursts goes through some hundred times: a few seconds
BURSTY_Z = -3.0  # of the runs test: false alarm 1 in 700
WIDEST, WIDEST_LOGIT = 8.0, 9.0  # how far logarithms of durations may go from the start, and logits from 0
IMPOSSIBLE = 1e300  # the cost where the likelihood is 0
STEP = 0.02  # of the same, for the curvature
NAMES = ("bad_s", "good_s", "loss_bad", "loss_good")
KINDS = {2: "bursts that lose all", 3: "bursts that lose a share", 4: "bursts, and single losses between"}


@dataclass(frozen=True)
class LossModel:
    """One way to tell the losses."""

    name: str
    free: int  # parameters that were fitted
    log_likelihood: float
    bursts: Bursts | None  # None: losses are single
    errors: dict[str, float]  # standard errors of the fitted ones among NAMES

    @property
    def aic(self) -> float:
        """Akaike's criterion (IEEE Trans. Autom. Control 19, 1974); the least is best."""
        return 2.0 * self.free - 2.0 * self.log_likelihood


@dataclass(frozen=True)
class LossFit:
    """All models, and the one that the data speak for."""

    loss: Estimate  # probability that a packet is lost, if losses are single
    models: tuple[LossModel, ...]
    runs_z: float
    chosen: LossModel


def fit_losses(sequences: LossSequences) -> LossFit | str:
    """The fits, or what they lack."""
    packets, lost = len(sequences.lost), int(sequences.lost.sum())
    if packets < MIN_PACKETS:
        return f"needs {MIN_PACKETS} packets, got {packets}"
    if lost == packets:
        return f"needs packets that were received; all {packets} were lost"
    share = lost / packets
    loss = Estimate(share, math.sqrt(share * (1.0 - share) / packets))
    sequences = sequences.thinned(MAX_PACKETS)
    packets, lost = len(sequences.lost), int(sequences.lost.sum())
    single = LossModel("single losses", 1, _of_coin(lost, packets), None, {})
    if min(lost, packets - lost) < MIN_LOST:
        return LossFit(loss, (single,), math.nan, single)
    per_link = _single_per_link(sequences)
    bursts = _fit_all_bursts(sequences)
    z = runs_z(sequences)
    likeliest = min([single, *bursts], key=lambda model: model.aic)
    # Links that differ in loss look like bursts to a chain with one loss for all; runs within links do not.
    chosen = likeliest if z < BURSTY_Z and likeliest.aic < per_link.aic else single
    return LossFit(loss, (single, per_link, *bursts), z, chosen)


def _of_coin(lost: float, packets: float) -> float:
    return float(special.xlogy(lost, lost / packets) + special.xlogy(packets - lost, 1.0 - lost / packets))


def _single_per_link(sequences: LossSequences) -> LossModel:
    packets, lost = np.bincount(sequences.link), np.bincount(sequences.link, sequences.lost)
    links = np.flatnonzero(packets)
    likelihood = sum(_of_coin(float(lost[i]), float(packets[i])) for i in links)
    return LossModel("single losses, each link its own share", len(links), likelihood, None, {})


def _fit_all_bursts(sequences: LossSequences) -> list[LossModel]:
    """Bursts with two, three and four free parameters: the durations, the loss in bursts, that between them."""
    lost = float(sequences.lost.mean())
    bad_s = float(sequences.burst_lengths.mean()) * sequences.interval_s
    # Bursts as long as runs of losses are, and longer ones that lose half.
    short, long = (_point(*start) for start in ((bad_s, lost, 0.9), (4.0 * bad_s, min(1.6 * lost, 0.8), 0.6)))
    models, found = list[LossModel](), short[:2]
    for free in (2, 3, 4):
        model, found = _fit_bursts(sequences, [np.append(found, short[len(found) : free]), long[:free]])
        models.append(model)
    return models


def _point(bad_s: float, bad_share: float, loss_bad: float) -> FloatArray:
    """Logarithms of durations, logits of losses: any values of these make sense."""
    good_s = bad_s * (1.0 - bad_share) / bad_share
    return np.array([math.log(bad_s), math.log(good_s), special.logit(loss_bad), special.logit(0.1 * bad_share)])


def _fit_bursts(sequences: LossSequences, starts: list[FloatArray]) -> tuple[LossModel, FloatArray]:
    """The likeliest bursts that a search from these places finds, and the point where they are."""

    def cost(point: FloatArray) -> float:
        value = -log_likelihood(sequences, _bursts(point))
        return value if math.isfinite(value) else IMPOSSIBLE

    free = len(starts[0])
    found = min((_least(cost, start) for start in starts), key=cost)
    bursts, errors = _bursts(found), standard_errors(cost, found, STEP)
    slopes = (
        bursts.bad_s,
        bursts.good_s,
        bursts.loss_bad * (1.0 - bursts.loss_bad),
        bursts.loss_good * (1.0 - bursts.loss_good),
    )
    named = {NAMES[i]: float(slopes[i] * errors[i]) for i in range(free)}
    return LossModel(KINDS[free], free, -cost(found), bursts, named), found


def _least(cost: Callable[[FloatArray], float], start: FloatArray) -> FloatArray:
    bounds = [
        *((value - WIDEST, value + WIDEST) for value in start[:2]),
        *((-WIDEST_LOGIT, WIDEST_LOGIT) for _ in start[2:]),
    ]
    return cast("Any", optimize).minimize(cost, start, method="L-BFGS-B", bounds=bounds, options={"ftol": 1e-9}).x


def _bursts(point: FloatArray) -> Bursts:
    losses = [float(special.expit(value)) for value in point[2:]]
    loss_bad, loss_good = [*losses, 1.0, 0.0][:2] if len(losses) != 1 else (losses[0], 0.0)
    return Bursts(math.exp(point[0]), math.exp(point[1]), loss_bad, loss_good)
