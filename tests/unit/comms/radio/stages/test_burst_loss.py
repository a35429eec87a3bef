"""Bursts: the two-state chain's loss, spells and correlations, whatever the packet rate and the batches.

Keys are fixed. Statistics are taken link by link and held to 4.4 standard errors over independent links: false alarm
1 in 90 000 each.
"""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from swarmwire.comms.clock import NS_PER_S
from swarmwire.comms.draws import derive_key
from swarmwire.comms.radio.config.impairments import Bursts, bursts_from_steps, bursts_of_mean
from swarmwire.comms.radio.stages.burst_loss import MIN_CAPACITY, bad_after
from tests.support.comms.radio.bursts import BurstLinks

KEYS = np.array([derive_key("bursts", arena) for arena in range(2)], np.uint64)
ROBOTS = 20
LINKS = 400
STANDARD_ERRORS = 4.4
LOSSY = (0.01, 0.1, 1.0, 0.0)  # p, r, 1-h, 1-k
LEAKY = (0.02, 0.25, 0.7, 0.01)
RATES = st.floats(1e-3, 1e3)


def losses(bursts: Bursts, interval_s: float, packets: int, keys: np.ndarray = KEYS[:1]) -> np.ndarray:
    """Which packets of each of LINKS links are lost, (links, packets), sent every `interval_s`."""
    states = BurstLinks(bursts, keys, ROBOTS)
    sender, receiver = np.arange(LINKS) // ROBOTS, np.arange(LINKS) % ROBOTS
    told = [
        states.lost(sender, receiver, np.full(LINKS, n), np.full(LINKS, round(n * interval_s * NS_PER_S)))
        for n in range(packets)
    ]
    return np.stack(told, axis=1)


def is_mean(by_link: np.ndarray, expected: float) -> bool:
    return bool(abs(by_link.mean() - expected) < STANDARD_ERRORS * by_link.std() / np.sqrt(len(by_link)))


def turns_bad(bursts: Bursts, was_bad: bool, dt_s: float) -> float:
    """The probability that a link is bad after dt, read off the draw at which it changes (bisection)."""
    low, high = 0.0, 1.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        if bad_after(was_bad, dt_s, 1.0 / bursts.good_s, 1.0 / bursts.bad_s, middle):
            low = middle
        else:
            high = middle
    return low


@pytest.mark.parametrize(("p", "r", "loss_bad", "loss_good"), [LOSSY, LEAKY])
@pytest.mark.parametrize("interval_s", [0.01, 0.1, 3.0])
def test_steps_at_an_interval_become_rates_and_back(p, r, loss_bad, loss_good, interval_s):
    bursts = bursts_from_steps(p, r, loss_bad, loss_good, interval_s)
    assert turns_bad(bursts, False, interval_s) == pytest.approx(p, rel=1e-12)
    assert turns_bad(bursts, True, interval_s) == pytest.approx(1.0 - r, rel=1e-12)
    assert bursts.bad_share == pytest.approx(p / (p + r), rel=1e-12)


@pytest.mark.parametrize(("steps", "stated"), [(LOSSY, 0.090909), (LEAKY, 0.061111)])
def test_the_long_run_loss_is_that_of_the_table(steps, stated: float):
    assert bursts_from_steps(*steps, 0.1).loss == pytest.approx(stated, abs=5e-7)


@given(RATES, RATES, st.floats(1e-6, 10.0), st.floats(1e-6, 10.0), st.booleans())
def test_two_steps_are_one_of_their_sum(bad_s: float, good_s: float, first_s: float, then_s: float, was_bad: bool):
    bursts = Bursts(bad_s, good_s)
    after_first = turns_bad(bursts, was_bad, first_s)
    both = after_first * turns_bad(bursts, True, then_s) + (1.0 - after_first) * turns_bad(bursts, False, then_s)
    assert both == pytest.approx(turns_bad(bursts, was_bad, first_s + then_s), rel=1e-9, abs=1e-12)


@given(RATES, RATES, st.booleans())
def test_no_time_changes_nothing_and_much_time_forgets(bad_s: float, good_s: float, was_bad: bool):
    bursts = Bursts(bad_s, good_s)
    assert turns_bad(bursts, was_bad, 0.0) == pytest.approx(float(was_bad), abs=1e-15)
    assert turns_bad(bursts, was_bad, 1e6) == turns_bad(bursts, not was_bad, np.inf)
    assert turns_bad(bursts, was_bad, np.inf) == pytest.approx(bursts.bad_share, rel=1e-12)


@pytest.mark.parametrize(
    ("steps", "lags", "after_loss"),
    [
        (LOSSY, {1: 0.8900, 2: 0.7921, 5: 0.5584, 10: 0.3118}, 0.90000),
        (LEAKY, {1: 0.41546, 2: 0.30329, 5: 0.11798, 10: 0.02446}, 0.45118),
    ],
)
def test_losses_are_as_frequent_and_as_correlated_as_stated(steps, lags: dict[int, float], after_loss: float):
    bursts = bursts_from_steps(*steps, 0.05)
    lost = losses(bursts, 0.05, 1500).astype(float)
    assert is_mean(lost.mean(axis=1), bursts.loss)
    about = lost - bursts.loss
    for lag, correlation in lags.items():
        covariance = (about[:, lag:] * about[:, :-lag]).mean(axis=1)
        # The stated correlations have four or five digits.
        assert is_mean(covariance / (bursts.loss * (1.0 - bursts.loss)), correlation)
    assert is_mean((lost[:, :-1] * (lost[:, 1:] - after_loss)).mean(axis=1), 0.0)


@pytest.mark.parametrize("mean_loss", [0.0, 0.3, 0.9])
def test_as_much_is_lost_as_the_mean_says(mean_loss: float):
    lost = losses(bursts_of_mean(mean_loss, 1.0, 0.0, 0.5), 0.1, 800).astype(float)
    assert is_mean(lost.mean(axis=1), mean_loss) if mean_loss else not lost.any()


@pytest.mark.parametrize("interval_s", [0.02, 0.1, 0.4])
def test_a_burst_lasts_as_long_however_often_robots_speak(interval_s: float):
    """The share of bad time, and the correlation over 0.4 s, do not depend on the packets in between."""
    bursts = Bursts(bad_s=0.5, good_s=2.0)
    lost = losses(bursts, interval_s, round(80.0 / interval_s)).astype(float)
    assert is_mean(lost.mean(axis=1), 0.2)
    lag = round(0.4 / interval_s)
    after_04_s = (lost[:, lag:] * lost[:, :-lag]).mean(axis=1)
    assert is_mean(after_04_s, 0.2 * (0.2 + 0.8 * np.exp(-(1.0 / 0.5 + 1.0 / 2.0) * 0.4)))


def test_spells_of_loss_are_geometric():
    """Chi-square over lengths 1 to 15 and more; false alarm 1 in 1000."""
    lost = losses(bursts_from_steps(0.02, 0.2, 1.0, 0.0, 0.1), 0.1, 1000)
    edges = np.diff(np.pad(lost.astype(np.int8), ((0, 0), (1, 1))), axis=1)
    begins, ends = np.nonzero(edges == 1), np.nonzero(edges == -1)
    whole = (begins[1] > 0) & (begins[1] < 900)  # by where they begin, so that long ones are not left out
    lengths = (ends[1] - begins[1])[whole]
    counts = np.bincount(np.minimum(lengths, 16), minlength=17)[1:]
    shares = np.append(0.2 * 0.8 ** np.arange(15), 0.8**15)
    assert lengths.size > 3000
    assert stats.chisquare(counts, shares * lengths.size).pvalue > 1e-3


def test_losses_of_links_arenas_and_directions_are_their_own():
    bursts = Bursts(0.5, 0.5)
    one, other = (losses(bursts, 0.1, 400, keys) for keys in (KEYS[:1], KEYS[1:]))
    both = (one == other).mean(axis=1)
    assert is_mean(both, 0.5)
    there = one.reshape(ROBOTS, ROBOTS, -1)
    pairs = np.triu_indices(ROBOTS, 1)
    assert is_mean((there == there.transpose(1, 0, 2)).mean(axis=2)[pairs], 0.5)


def packets(seed: int, count: int) -> tuple[np.ndarray, ...]:
    """Packets of random links in the order of their time, with the sequence numbers of their senders."""
    draws = np.random.default_rng(seed)
    sender, receiver = draws.integers(0, 2 * ROBOTS, (2, count))
    receiver = sender - sender % ROBOTS + receiver % ROBOTS
    at_ns = np.sort(draws.integers(0, 300 * NS_PER_S, count))
    sequence = np.array([int(np.sum(sender[:i] == sender[i])) for i in range(count)])
    return sender, receiver, sequence, at_ns


@pytest.mark.parametrize("batch", [1, 7, 400])
def test_batches_do_not_change_fates(batch: int):
    table = packets(1, 2000)
    bursts = Bursts(0.8, 0.8, 0.9, 0.1)
    whole = BurstLinks(bursts, KEYS, ROBOTS).lost(*table)
    states = BurstLinks(bursts, KEYS, ROBOTS)
    parts = [states.lost(*(column[i : i + batch] for column in table)) for i in range(0, 2000, batch)]
    assert np.array_equal(np.concatenate(parts), whole)
    assert 0.4 < whole.mean() < 0.6


def test_what_is_forgotten_does_not_change_fates_and_frees_room():
    """A thousand robots whose links come and go; the past counts for 40 x 0.025 s, ten ticks."""
    draws = np.random.default_rng(2)
    robots, per_tick, ticks = 1000, 900, 60
    sender, receiver = draws.integers(0, robots, (2, ticks * per_tick))
    at_ns = np.repeat(np.arange(ticks) * NS_PER_S // 10, per_tick)
    # Some links go on from tick to tick, so that there is a past that counts.
    sender.reshape(ticks, -1)[:, :300], receiver.reshape(ticks, -1)[:, :300] = sender[:300], receiver[:300]
    table = sender, receiver, np.repeat(np.arange(ticks), per_tick), at_ns
    bursts = Bursts(0.05, 0.05)
    whole = BurstLinks(bursts, KEYS[:1], robots)
    states = BurstLinks(bursts, KEYS[:1], robots)
    kept, parts = [], []
    for tick in range(ticks):
        parts.append(states.lost(*(column[tick * per_tick : (tick + 1) * per_tick] for column in table)))
        kept.append(len(states))
    assert np.array_equal(np.concatenate(parts), whole.lost(*table))
    assert len(whole) > 30_000
    assert max(kept) < 20 * per_tick
    assert max(kept) > MIN_CAPACITY


def test_no_packets_lose_nothing():
    nothing = np.empty(0, np.int64)
    assert BurstLinks(Bursts(), KEYS, ROBOTS).lost(nothing, nothing, nothing, nothing).shape == (0,)
