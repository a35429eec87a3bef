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
MAX_PACKETS = 200_000  # limits the search for bursts, some hundred passes, to a few seconds
BURSTY_Z = -3.0  # threshold of the runs test: false alarm 1 in 700
MAX_LOG_STEP, MAX_LOGIT = 8.0, 9.0  # bounds of logarithms of durations around the start, and of logits
IMPOSSIBLE = 1e300  # cost of a likelihood of 0
STEP = 0.02  # step of logarithms and logits for the curvature
NAMES = ("bad_s", "good_s", "loss_bad", "loss_good")
KINDS = {2: "bursts that lose all", 3: "bursts that lose a share", 4: "bursts, and single losses between"}


@dataclass(frozen=True)
class LossSequences:
    """A row per packet, link after link, in the order of time within each."""

    link: IntArray  # (n,)
    since_s: FloatArray  # (n,) time since the link's previous packet; inf for its first, which is independent
    lost: BoolArray  # (n,)

    @property
    def interval_s(self) -> float:
        """Median time between two packets of a link; NaN if no link has two."""
        finite_s = self.since_s[np.isfinite(self.since_s)]
        return float(np.median(finite_s)) if len(finite_s) else float("nan")

    @property
    def burst_lengths(self) -> IntArray:
        """Numbers of packets in each run of losses; a link's end also ends a run."""
        begins = self.lost & ~(np.append(False, self.lost[:-1]) & np.isfinite(self.since_s))
        run = np.cumsum(begins)[self.lost]
        return np.bincount(run)[1:] if len(run) else np.zeros(0, np.int64)

    def thinned(self, max_packets: int) -> "LossSequences":
        """Return at most this many packets: evenly spaced stretches of STRETCH packets, independent of one another."""
        step = -(-len(self.lost) // max_packets)
        if step <= 1:
            return self
        row = np.arange(len(self.lost))
        selected = (row // STRETCH) % step == 0
        since_s = np.where(row % STRETCH == 0, np.inf, self.since_s)
        return LossSequences(self.link[selected], since_s[selected], self.lost[selected])


def log_likelihood(sequences: LossSequences, bursts: Bursts) -> float:
    """Return the log likelihood of these losses, all links together, each starting from the stationary state."""
    steps, total = _steps(sequences, bursts), 0.0
    while len(steps[0]) > 1:
        even = len(steps[0]) // 2 * 2
        pairs = _matrix_products([column[:even:2] for column in steps], [column[1:even:2] for column in steps])
        steps = [np.append(pair, column[even:]) for pair, column in zip(pairs, steps, strict=True)]
        largest = np.max(steps, axis=0)
        if not (largest > 0.0).all():
            return -math.inf
        total += float(np.log(largest).sum())
        steps = [column / largest for column in steps]
    gg, bg, gb, bb = (float(column[0]) for column in steps)
    likelihood = (gg + gb) * (1.0 - bursts.bad_share) + (bg + bb) * bursts.bad_share
    return total + math.log(likelihood) if likelihood > 0.0 else -math.inf


def _steps(sequences: LossSequences, bursts: Bursts) -> list[FloatArray]:
    """Return the elements of each packet's matrix; the first packet of a link starts from the stationary state."""
    share = bursts.bad_share
    memory = np.exp(-sequences.since_s * (1.0 / bursts.bad_s + 1.0 / bursts.good_s))  # correlation of states; 0 for inf
    bad_from_good, bad_from_bad = share * (1.0 - memory), share + (1.0 - share) * memory
    if_good = np.where(sequences.lost, bursts.loss_good, 1.0 - bursts.loss_good)
    if_bad = np.where(sequences.lost, bursts.loss_bad, 1.0 - bursts.loss_bad)
    return [
        if_good * (1.0 - bad_from_good),
        if_good * (1.0 - bad_from_bad),
        if_bad * bad_from_good,
        if_bad * bad_from_bad,
    ]


def _matrix_products(first: list[FloatArray], second: list[FloatArray]) -> list[FloatArray]:
    """Return the elements of the matrix products second x first."""
    gg, bg, gb, bb = first
    gg2, bg2, gb2, bb2 = second
    return [gg2 * gg + bg2 * gb, gg2 * bg + bg2 * bb, gb2 * gg + bb2 * gb, gb2 * bg + bb2 * bb]


def expected_runs(bursts: Bursts, interval_s: float, longest: int) -> FloatArray:
    """Return the shares (longest,) of runs of 1, 2, … packets; longer runs are missing from their sum of 1."""
    share = bursts.bad_share
    memory = math.exp(-interval_s * (1.0 / bursts.bad_s + 1.0 / bursts.good_s))
    stationary = np.array([1.0 - share, share])
    step = (1.0 - memory) * stationary[:, None] + memory * np.eye(2)  # [next state, state], good and bad
    loss = np.array([bursts.loss_good, bursts.loss_bad])
    state = loss * (step @ ((1.0 - loss) * stationary))  # received, then lost
    state = state / state.sum()
    shares = np.empty(longest)
    for i in range(longest):
        shares[i] = ((1.0 - loss) * (step @ state)).sum()
        state = loss * (step @ state)
    return shares


def runs_z(sequences: LossSequences) -> float:
    """Return the statistic of the runs test: standard normal for independent losses, negative for bursts.

    It is conditional on the number of lost packets of each link, so links may differ in loss. NaN if no link has both
    losses and receptions.
    """
    links = int(sequences.link.max()) + 1
    packets = np.bincount(sequences.link, minlength=links).astype(np.float64)
    lost = np.bincount(sequences.link, sequences.lost, minlength=links)
    changes = np.diff(sequences.lost, prepend=False) | np.isinf(sequences.since_s)
    runs = np.bincount(sequences.link, changes, minlength=links)
    both = 2.0 * lost * (packets - lost)
    mixed = both > 0.0  # links with losses and receptions
    both, packets, runs = both[mixed], packets[mixed], runs[mixed]
    variance = both * (both - packets) / (packets**2 * np.maximum(packets - 1.0, 1.0))
    total = float(variance.sum())
    return float((runs - both / packets - 1.0).sum()) / math.sqrt(total) if total > 0.0 else math.nan


@dataclass(frozen=True)
class FittedLossModel:
    """A model of the losses."""

    name: str
    free: int  # number of fitted parameters
    log_likelihood: float
    bursts: Bursts | None  # None: losses are single
    errors: dict[str, float]  # standard errors of fitted parameters, by NAMES

    @property
    def aic(self) -> float:
        """Akaike's information criterion (IEEE Trans. Autom. Control 19, 1974); the least is best."""
        return 2.0 * self.free - 2.0 * self.log_likelihood


@dataclass(frozen=True)
class LossFit:
    """All models, and the best model."""

    loss: EstimatedValue  # probability of loss, if losses are single
    models: tuple[FittedLossModel, ...]
    runs_z: float
    chosen: FittedLossModel


def fit_losses(sequences: LossSequences) -> LossFit | str:
    """Fit all models, or return a sentence on missing data."""
    packets, lost = len(sequences.lost), int(sequences.lost.sum())
    if packets < MIN_PACKETS:
        return f"needs {MIN_PACKETS} packets, got {packets}"
    if lost == packets:
        return f"needs packets that were received; all {packets} were lost"
    share = lost / packets
    loss = EstimatedValue(share, math.sqrt(share * (1.0 - share) / packets))
    sequences = sequences.thinned(MAX_PACKETS)
    packets, lost = len(sequences.lost), int(sequences.lost.sum())
    single = FittedLossModel("single losses", 1, _single_log_likelihood(lost, packets), None, {})
    if min(lost, packets - lost) < MIN_LOST:
        return LossFit(loss, (single,), math.nan, single)
    per_link = _single_per_link(sequences)
    bursts = _fit_all_bursts(sequences)
    z = runs_z(sequences)
    likeliest = min([single, *bursts], key=lambda model: model.aic)
    # A chain with the same loss for all links mistakes different losses for bursts; the runs test does not.
    chosen = likeliest if z < BURSTY_Z and likeliest.aic < per_link.aic else single
    return LossFit(loss, (single, per_link, *bursts), z, chosen)


def _single_log_likelihood(lost: float, packets: float) -> float:
    return float(special.xlogy(lost, lost / packets) + special.xlogy(packets - lost, 1.0 - lost / packets))


def _single_per_link(sequences: LossSequences) -> FittedLossModel:
    packets, lost = np.bincount(sequences.link), np.bincount(sequences.link, sequences.lost)
    links = np.flatnonzero(packets)
    likelihood = sum(_single_log_likelihood(float(lost[i]), float(packets[i])) for i in links)
    return FittedLossModel("single losses, each link its own share", len(links), likelihood, None, {})


def _fit_all_bursts(sequences: LossSequences) -> list[FittedLossModel]:
    """Fit bursts with two, three and four free parameters: the durations, the loss in bursts, the loss between them."""
    lost = float(sequences.lost.mean())
    bad_s = float(sequences.burst_lengths.mean()) * sequences.interval_s
    # Bursts of the mean length of runs of losses, and longer bursts with fewer losses.
    short, long = (_point(*start) for start in ((bad_s, lost, 0.9), (4.0 * bad_s, min(1.6 * lost, 0.8), 0.6)))
    models, best = list[FittedLossModel](), short[:2]
    for free in (2, 3, 4):
        model, best = _fit_bursts(sequences, [np.append(best, short[len(best) : free]), long[:free]])
        models.append(model)
    return models


def _point(bad_s: float, bad_share: float, loss_bad: float) -> FloatArray:
    """Return logarithms of durations and logits of losses, which have no bounds."""
    good_s = bad_s * (1.0 - bad_share) / bad_share
    return np.array([math.log(bad_s), math.log(good_s), special.logit(loss_bad), special.logit(0.1 * bad_share)])


def _fit_bursts(sequences: LossSequences, starts: list[FloatArray]) -> tuple[FittedLossModel, FloatArray]:
    """Return the likeliest bursts of searches from these starts, and their point."""

    def cost(point: FloatArray) -> float:
        value = -log_likelihood(sequences, _bursts(point))
        return value if math.isfinite(value) else IMPOSSIBLE

    free = len(starts[0])
    best = min((_minimum(cost, start) for start in starts), key=cost)
    bursts, errors = _bursts(best), standard_errors(cost, best, STEP)
    slopes = (
        bursts.bad_s,
        bursts.good_s,
        bursts.loss_bad * (1.0 - bursts.loss_bad),
        bursts.loss_good * (1.0 - bursts.loss_good),
    )
    errors_by_name = {NAMES[i]: float(slopes[i] * errors[i]) for i in range(free)}
    return FittedLossModel(KINDS[free], free, -cost(best), bursts, errors_by_name), best


def _minimum(cost: Callable[[FloatArray], float], start: FloatArray) -> FloatArray:
    bounds = [
        *((value - MAX_LOG_STEP, value + MAX_LOG_STEP) for value in start[:2]),
        *((-MAX_LOGIT, MAX_LOGIT) for _ in start[2:]),
    ]
    return cast("Any", optimize).minimize(cost, start, method="L-BFGS-B", bounds=bounds, options={"ftol": 1e-9}).x


def _bursts(point: FloatArray) -> Bursts:
    losses = [float(special.expit(value)) for value in point[2:]]
    loss_bad, loss_good = [*losses, 1.0, 0.0][:2] if len(losses) != 1 else (losses[0], 0.0)
    return Bursts(math.exp(point[0]), math.exp(point[1]), loss_bad, loss_good)
