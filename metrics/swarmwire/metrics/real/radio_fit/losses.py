"""Single losses and loss bursts fitted to sequences of received and lost packets."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
from scipy import optimize, special

from swarmwire.comms.base.arrays import BoolArray, FloatArray, IntArray
from swarmwire.comms.radio.config.impairments import Bursts
from swarmwire.metrics.real.radio_fit.path_loss import EstimatedValue, standard_errors

STRETCH = 1000
MIN_PACKETS, MIN_LOST = 100, 10
MAX_PACKETS = 200_000  # that the search for bursts goes through some hundred times: a few seconds
BURSTY_Z = -3.0  # of the runs test: false alarm 1 in 700
WIDEST, WIDEST_LOGIT = 8.0, 9.0  # how far logarithms of durations may go from the start, and logits from 0
IMPOSSIBLE = 1e300  # the cost where the likelihood is 0
STEP = 0.02  # of the same, for the curvature
NAMES = ("bad_s", "good_s", "loss_bad", "loss_good")
KINDS = {2: "bursts that lose all", 3: "bursts that lose a share", 4: "bursts, and single losses between"}


@dataclass(frozen=True)
class LossSequences:
    """A row per packet, link after link, in the order of time within each."""

    link: IntArray  # (n,)
    since_s: FloatArray  # (n,) time since the link's packet before; inf for its first, before which all is forgotten
    lost: BoolArray  # (n,)

    @property
    def interval_s(self) -> float:
        """The usual time between two packets of a link: the median; NaN if no link has two."""
        known = self.since_s[np.isfinite(self.since_s)]
        return float(np.median(known)) if len(known) else float("nan")

    @property
    def burst_lengths(self) -> IntArray:
        """How many packets in a row were lost, for every run of losses; a link's end ends a run, too."""
        begins = self.lost & ~(np.append(False, self.lost[:-1]) & np.isfinite(self.since_s))
        run = np.cumsum(begins)[self.lost]
        return np.bincount(run)[1:] if len(run) else np.zeros(0, np.int64)

    def thinned(self, most: int) -> "LossSequences":
        """At most this many packets: stretches of a thousand, evenly chosen, each of which starts without a past."""
        every = -(-len(self.lost) // most)
        if every <= 1:
            return self
        row = np.arange(len(self.lost))
        kept = (row // STRETCH) % every == 0
        since_s = np.where(row % STRETCH == 0, np.inf, self.since_s)
        return LossSequences(self.link[kept], since_s[kept], self.lost[kept])


def log_likelihood(sequences: LossSequences, bursts: Bursts) -> float:
    """The logarithm of the probability of these losses, all links together, each from its long-run state."""
    steps, total = _steps(sequences, bursts), 0.0
    while len(steps[0]) > 1:
        even = len(steps[0]) // 2 * 2
        pairs = _after([column[:even:2] for column in steps], [column[1:even:2] for column in steps])
        steps = [np.append(pair, column[even:]) for pair, column in zip(pairs, steps, strict=True)]
        largest = np.max(steps, axis=0)
        if not (largest > 0.0).all():
            return -math.inf
        total += float(np.log(largest).sum())
        steps = [column / largest for column in steps]
    gg, bg, gb, bb = (float(column[0]) for column in steps)
    whole = (gg + gb) * (1.0 - bursts.bad_share) + (bg + bb) * bursts.bad_share
    return total + math.log(whole) if whole > 0.0 else -math.inf


def _steps(sequences: LossSequences, bursts: Bursts) -> list[FloatArray]:
    """Each packet's matrix. A link's first packet comes from the long run, independent of the packets before."""
    share = bursts.bad_share
    kept = np.exp(-sequences.since_s * (1.0 / bursts.bad_s + 1.0 / bursts.good_s))  # 0 for inf
    bad_from_good, bad_from_bad = share * (1.0 - kept), share + (1.0 - share) * kept
    if_good = np.where(sequences.lost, bursts.loss_good, 1.0 - bursts.loss_good)
    if_bad = np.where(sequences.lost, bursts.loss_bad, 1.0 - bursts.loss_bad)
    return [
        if_good * (1.0 - bad_from_good),
        if_good * (1.0 - bad_from_bad),
        if_bad * bad_from_good,
        if_bad * bad_from_bad,
    ]


def _after(first: list[FloatArray], then: list[FloatArray]) -> list[FloatArray]:
    """The products of matrices: `then` after `first`."""
    gg, bg, gb, bb = first
    to_gg, to_bg, to_gb, to_bb = then
    return [to_gg * gg + to_bg * gb, to_gg * bg + to_bg * bb, to_gb * gg + to_bb * gb, to_gb * bg + to_bb * bb]


def expected_runs(bursts: Bursts, interval_s: float, longest: int) -> FloatArray:
    """The shares (longest,) of runs of 1, 2, … packets; those of longer runs are missing from their sum of 1."""
    share = bursts.bad_share
    kept = math.exp(-interval_s * (1.0 / bursts.bad_s + 1.0 / bursts.good_s))
    long_run = np.array([1.0 - share, share])
    step = (1.0 - kept) * long_run[:, None] + kept * np.eye(2)  # to good and bad, from good and bad
    loss = np.array([bursts.loss_good, bursts.loss_bad])
    state = loss * (step @ ((1.0 - loss) * long_run))  # received, then lost
    state = state / state.sum()
    shares = np.empty(longest)
    for i in range(longest):
        shares[i] = ((1.0 - loss) * (step @ state)).sum()
        state = loss * (step @ state)
    return shares


def runs_z(sequences: LossSequences) -> float:
    """Standard normal if the losses of each link come in any order; negative where they come in bursts.

    Given how many packets of a link were lost, so that links may differ in that. NaN if no link
    has both losses and receptions.
    """
    links = int(sequences.link.max()) + 1
    packets = np.bincount(sequences.link, minlength=links).astype(np.float64)
    lost = np.bincount(sequences.link, sequences.lost, minlength=links)
    changes = np.diff(sequences.lost, prepend=False) | np.isinf(sequences.since_s)
    runs = np.bincount(sequences.link, changes, minlength=links)
    both = 2.0 * lost * (packets - lost)
    tells = both > 0.0
    both, packets, runs = both[tells], packets[tells], runs[tells]
    variance = both * (both - packets) / (packets**2 * np.maximum(packets - 1.0, 1.0))
    total = float(variance.sum())
    return float((runs - both / packets - 1.0).sum()) / math.sqrt(total) if total > 0.0 else math.nan


@dataclass(frozen=True)
class FittedLossModel:
    """A model of the losses."""

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
    """All models, and the one that fits best."""

    loss: EstimatedValue  # probability that a packet is lost, if losses are single
    models: tuple[FittedLossModel, ...]
    runs_z: float
    chosen: FittedLossModel


def fit_losses(sequences: LossSequences) -> LossFit | str:
    """The fits, or a sentence on missing data."""
    packets, lost = len(sequences.lost), int(sequences.lost.sum())
    if packets < MIN_PACKETS:
        return f"needs {MIN_PACKETS} packets, got {packets}"
    if lost == packets:
        return f"needs packets that were received; all {packets} were lost"
    share = lost / packets
    loss = EstimatedValue(share, math.sqrt(share * (1.0 - share) / packets))
    sequences = sequences.thinned(MAX_PACKETS)
    packets, lost = len(sequences.lost), int(sequences.lost.sum())
    single = FittedLossModel("single losses", 1, _of_coin(lost, packets), None, {})
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


def _single_per_link(sequences: LossSequences) -> FittedLossModel:
    packets, lost = np.bincount(sequences.link), np.bincount(sequences.link, sequences.lost)
    links = np.flatnonzero(packets)
    likelihood = sum(_of_coin(float(lost[i]), float(packets[i])) for i in links)
    return FittedLossModel("single losses, each link its own share", len(links), likelihood, None, {})


def _fit_all_bursts(sequences: LossSequences) -> list[FittedLossModel]:
    """Bursts with two, three and four free parameters: the durations, the loss in bursts, that between them."""
    lost = float(sequences.lost.mean())
    bad_s = float(sequences.burst_lengths.mean()) * sequences.interval_s
    # Bursts as long as runs of losses are, and longer ones that lose half.
    short, long = (_point(*start) for start in ((bad_s, lost, 0.9), (4.0 * bad_s, min(1.6 * lost, 0.8), 0.6)))
    models, found = list[FittedLossModel](), short[:2]
    for free in (2, 3, 4):
        model, found = _fit_bursts(sequences, [np.append(found, short[len(found) : free]), long[:free]])
        models.append(model)
    return models


def _point(bad_s: float, bad_share: float, loss_bad: float) -> FloatArray:
    """Logarithms of durations, logits of losses: any values of these make sense."""
    good_s = bad_s * (1.0 - bad_share) / bad_share
    return np.array([math.log(bad_s), math.log(good_s), special.logit(loss_bad), special.logit(0.1 * bad_share)])


def _fit_bursts(sequences: LossSequences, starts: list[FloatArray]) -> tuple[FittedLossModel, FloatArray]:
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
    return FittedLossModel(KINDS[free], free, -cost(found), bursts, named), found


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
