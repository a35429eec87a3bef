"""Shadowing and fading of links."""

from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numba import njit
from scipy import special, stats

from swarmwire.comms.base.draws import derive_key
from swarmwire.comms.radio.config.phy import Fading, Shadowing
from swarmwire.comms.radio.propagation.fading import (
    WAVES,
    fading_gain,
    fading_model,
    gamma_quantile,
    gamma_tails,
    nakagami_gain,
    scattered_between,
)
from swarmwire.comms.radio.propagation.shadowing import (
    SUMS,
    amplitude_db,
    cosine,
    field_waves,
    shadowing_db,
    sine,
    total,
)

# Keys are fixed; each statistic is taken over independent pairs or arenas.
# Means are held to 4.4 standard errors (false alarm
# 1 in 90 000), Kolmogorov-Smirnov tests to 1 in 1000. |h|^2 of 32 waves differs from the exponential by 0.004 at most,
# which 15 000 pairs do not show.
KEY = np.uint64(derive_key("fading"))
PER_M = 2.44e9 / 299_792_458.0
RAYLEIGH = fading_model(Fading(), 2.44e9)
PAIRS = 15_000
STANDARD_ERRORS = 4.4
ENDS = np.random.default_rng(5).uniform(-50.0, 50.0, (PAIRS, 4))
ROBOTS = [(pair % 150, 150 + pair // 150) for pair in range(PAIRS)]
METRES = st.floats(-100.0, 100.0)
INDICES = st.integers(0, 999)
ARENAS = 3000
DELTA_M = 5.0
UNIT = Shadowing(deviation_db=1.0, correlation_m=DELTA_M)
KEYS = np.array([derive_key("shadowing", arena) for arena in range(ARENAS)], np.uint64)
AMPLITUDE_DB = amplitude_db(UNIT)
SLOW = 64  # a power of two, as sums go by halves
COORDINATES = st.floats(-200.0, 200.0)


@cache  # not as the file is imported: every worker would compile it then
def shadow_waves() -> np.ndarray:
    """The waves of every arena."""
    return field_waves(KEYS, UNIT)


def rayleigh_gain(key: np.uint64, a: int, b: int, per_m: float, *ends: float) -> float:
    return float(fading_gain(RAYLEIGH._replace(wave_number=per_m), key, a, b, *ends))


def rician_gain(key: np.uint64, a: int, b: int, per_m: float, ax: float, ay: float, bx: float, by: float, k: float):
    law = fading_model(Fading("rician", k=k), 2.44e9)._replace(wave_number=per_m)
    return float(fading_gain(law, key, a, b, ax, ay, bx, by))


@pytest.fixture(scope="module")
def rayleigh() -> np.ndarray:
    """The gain of every pair at its place."""
    gains = [rayleigh_gain(KEY, a, b, PER_M, *ends) for (a, b), ends in zip(ROBOTS, ENDS, strict=True)]
    return np.array(gains)


def is_mean(values: np.ndarray, expected: float) -> bool:
    return bool(abs(values.mean() - expected) < STANDARD_ERRORS * values.std() / np.sqrt(len(values)))


def waves(ends: np.ndarray, pairs: int) -> np.ndarray:
    """h of the first pairs with its ends at `place`, complex."""
    return np.array([h_of(a, b, ends) for a, b in ROBOTS[:pairs]])


def h_of(a: int, b: int, ends: np.ndarray) -> complex:
    return complex(*scattered_between(KEY, PER_M, a, b, *ends))


def test_rayleigh_power_is_exponential(rayleigh: np.ndarray):
    assert stats.kstest(rayleigh, "expon").pvalue > 1e-3
    assert is_mean(rayleigh, 1.0)
    assert is_mean(rayleigh**2, 2.0 - 1.0 / WAVES)


@pytest.mark.parametrize(
    ("margin_db", "stated"), [(0, 0.63212), (3, 0.39419), (5, 0.27111), (10, 0.09516), (20, 0.00995), (30, 0.00100)]
)
def test_rayleigh_outage_by_margin_matches_the_table(rayleigh: np.ndarray, margin_db: float, stated: float):
    assert is_mean((rayleigh < 10.0 ** (-margin_db / 10.0)).astype(float), stated)


@pytest.mark.parametrize("k", [0.0, 0.5, 3.0, 20.0])
def test_rician_power_is_noncentral_chi_square(k: float):
    """g is half a noncentral chi-square of two degrees and 2 K, over K + 1: variance (1 + 2 K) / (1 + K)^2."""
    g = np.array([rician_gain(KEY, a, b, PER_M, *at, k) for (a, b), at in zip(ROBOTS, ENDS, strict=True)])
    assert is_mean(g, 1.0)
    assert is_mean((g - 1.0) ** 2, ((1.0 + 2.0 * k) - 1.0 / WAVES) / (1.0 + k) ** 2)
    law = stats.ncx2(2, 2.0 * k) if k else stats.chi2(2)
    assert stats.kstest(2.0 * (k + 1.0) * g, law.cdf).pvalue > 1e-3


def test_rician_k_of_zero_is_rayleigh_and_a_great_k_does_not_fade():
    link = KEY, 3, 8, PER_M, 1.0, 2.0, 3.0, 4.0
    assert rician_gain(*link, 0.0) == pytest.approx(rayleigh_gain(*link), rel=1e-12)
    assert rician_gain(*link, 1e12) == pytest.approx(1.0, abs=1e-5)


@pytest.mark.parametrize("m", [0.5, 0.75, 1.5, 4.0, 50.0])
def test_nakagami_power_is_gamma(rayleigh: np.ndarray, m: float):
    g = np.array([nakagami_gain(gain, m) for gain in rayleigh])
    assert is_mean(g, 1.0)
    # The variance shows the waves' 1/N more than the mean does, by up to a twentieth.
    assert np.var(g) == pytest.approx(1.0 / m, rel=0.1)
    assert stats.kstest(g, stats.gamma(m, scale=1.0 / m).cdf).pvalue > 1e-3


def test_nakagami_of_one_is_rayleigh_and_keeps_the_order(rayleigh: np.ndarray):
    assert nakagami_gain(0.7, 1.0) == 0.7
    ordered = [nakagami_gain(gain, 0.75) for gain in np.sort(rayleigh[:500])]
    assert np.all(np.diff(ordered) > 0.0)


@pytest.mark.parametrize("wavelengths", [0.05, 0.1914, 0.3827, 0.61, 1.5, 4.0])
def test_fading_decorrelates_with_distance_by_jakes(wavelengths: float):
    before = waves(np.array([1.0, 2.0, 30.0, -7.0]), 2500)
    for direction in (0.0, 1.1):
        way = wavelengths / PER_M * np.array([np.cos(direction), np.sin(direction)])
        product = (waves(np.array([1.0, 2.0, 30.0 + way[0], -7.0 + way[1]]), 2500) * before.conj()).real
        assert is_mean(product, float(special.j0(2.0 * np.pi * wavelengths)))


def test_fading_correlations_multiply_when_both_robots_move():
    before = waves(np.array([1.0, 2.0, 30.0, -7.0]), 2500)
    for first, second in ((0.1, 0.1), (0.1, 0.3), (0.25, 0.15)):
        after = waves(np.array([1.0 + first / PER_M, 2.0, 30.0, -7.0 - second / PER_M]), 2500)
        expected = special.j0(2.0 * np.pi * first) * special.j0(2.0 * np.pi * second)
        assert is_mean((after * before.conj()).real, float(expected))


def test_fading_of_a_single_link_decorrelates_like_the_ensemble():
    """Averaged over 4000 places of one pair's ends: 0.016 of deviation, and 0.01 for a link's 32 waves."""
    positions = np.random.default_rng(6).uniform(-1000.0, 1000.0, (4000, 4))
    step = np.array([0.25, 0.0, 0.0, 0.25]) / PER_M
    expected = special.j0(0.5 * np.pi) ** 2
    for a, b in ROBOTS[::2500]:
        before, after = (np.array([h_of(a, b, at) for at in xs]) for xs in (positions, positions + step))
        assert np.mean((after * before.conj()).real) == pytest.approx(expected, abs=0.08)


def test_fading_of_a_single_link_has_the_mean_power():
    """Over 200 m; the deviation of such a mean is that of some 1600 fades, 3 % at most."""
    metres = np.arange(0.0, 200.0, 0.05)
    for a, b in ROBOTS[::3000]:
        power = [rayleigh_gain(KEY, a, b, PER_M, 3.0, 1.0, x, 0.3 * x) for x in metres]
        assert np.mean(power) == pytest.approx(1.0, abs=0.15)


@given(INDICES, INDICES, METRES, METRES, METRES, METRES, st.floats(0.0, 30.0))
def test_fading_is_equal_in_both_directions(a, b, ax, ay, bx, by, k):
    forth, back = (a, b + 1000, PER_M, ax, ay, bx, by), (b + 1000, a, PER_M, bx, by, ax, ay)
    assert rayleigh_gain(KEY, *forth) == rayleigh_gain(KEY, *back)
    assert rician_gain(KEY, *forth, k) == rician_gain(KEY, *back, k)


@pytest.mark.parametrize("ends", [(1.0, 2.0, 30.0, -7.0), (0.0, 0.0, 0.0, 0.0)])
def test_fading_of_pairs_is_independent(ends: tuple[float, ...]):
    gains = np.array([[rayleigh_gain(KEY, a, b, PER_M, *ends) for b in range(100, 103)] for a in range(100)])
    first, other = gains[:, 0], gains[:, 1]
    assert is_mean((first - 1.0) * (other - 1.0), 0.0)
    assert is_mean((gains[1:, 0] - 1.0) * (gains[:-1, 0] - 1.0), 0.0)


def test_fading_gain_uses_the_configured_distribution():
    ends = 1.0, 2.0, 30.0, -7.0
    gain = rayleigh_gain(KEY, 3, 8, PER_M, *ends)
    for fading, expected in (
        (Fading(), gain),
        (Fading("rician", k=2.0), rician_gain(KEY, 3, 8, PER_M, *ends, 2.0)),
        (Fading("nakagami", m=0.75), nakagami_gain(gain, 0.75)),
    ):
        assert fading_gain(fading_model(fading, 2.44e9), KEY, 3, 8, *ends) == expected


@pytest.mark.parametrize("shape", [0.5, 0.6, 0.75, 1.0, 1.5, 3.0, 10.0, 200.0])
def test_gamma_quantile_agrees_with_scipy(shape: float):
    for small in (*np.geomspace(1e-15, 0.4999, 40), 0.5):
        low, high = gamma_quantile(shape, small, 1.0 - small), gamma_quantile(shape, 1.0 - small, small)
        assert low == pytest.approx(special.gammaincinv(shape, small), rel=1e-11)
        assert high == pytest.approx(special.gammainccinv(shape, small), rel=1e-11)


@given(st.floats(0.5, 200.0), st.floats(0.0, 600.0))
def test_gamma_tails_agree_with_scipy(shape: float, x: float):
    below, above = gamma_tails(shape, x)
    assert below + above == pytest.approx(1.0, rel=1e-15)
    smaller = (below, special.gammainc(shape, x)) if below < above else (above, special.gammaincc(shape, x))
    assert smaller[0] == pytest.approx(smaller[1], rel=2e-12, abs=1e-290)


def test_gamma_quantile_has_the_ends_of_its_range():
    for shape in (0.75, 1.5):
        assert (gamma_quantile(shape, 0.0, 1.0), gamma_quantile(shape, 1.0, 0.0)) == (0.0, np.inf)
        assert gamma_tails(shape, 0.0) == (0.0, 1.0)
    assert nakagami_gain(0.0, 0.75) == 0.0
    assert np.isfinite(nakagami_gain(32.0, 0.5))


def over_arenas(*link: float) -> np.ndarray:
    """X of one link (ax, ay, bx, by) in every arena."""
    return np.array([shadowing_db(waves, AMPLITUDE_DB, *link) for waves in shadow_waves()])


def covariance(first: tuple[float, ...], other: tuple[float, ...], steps: int = 400) -> float:
    """E[X X'] of two links by the midpoint rule over the definition's double integral, sigma = 1."""
    share = (np.arange(steps) + 0.5)[:, None] / steps
    p, q = (np.array(link[:2]) + share * (np.array(link[2:]) - np.array(link[:2])) for link in (first, other))
    lengths = [np.hypot(link[2] - link[0], link[3] - link[1]) for link in (first, other)]
    apart = np.hypot(*(p[:, None] - q[None]).transpose(2, 0, 1))
    return float(np.sqrt(lengths[0] * lengths[1]) * np.mean(np.exp(-apart / DELTA_M)) / (2.0 * DELTA_M))


@pytest.mark.parametrize(
    ("length_m", "stated"), [(1, 0.0937), (5, 0.3679), (10, 0.5677), (20, 0.7546), (50, 0.900), (100, 0.950)]
)
def test_shadowing_variance_grows_with_link_length(length_m: float, stated: float):
    exact = 1.0 - DELTA_M / length_m * (1.0 - np.exp(-length_m / DELTA_M))
    assert exact == pytest.approx(stated, abs=5e-5)
    turn = 0.7 * length_m
    link = (3.0, -4.0, 3.0 + length_m * np.cos(turn), -4.0 + length_m * np.sin(turn))
    x2 = over_arenas(*link) ** 2
    assert is_mean(x2, exact)


@pytest.mark.parametrize(
    "other",
    [
        (0.0, 0.0, 5.0, 8.660254),  # from the same robot, 60 degrees apart
        (0.0, 1.0, 10.0, 1.0),  # side by side
        (0.0, 5.0, 10.0, 5.0),
        (0.0, 15.0, 10.0, 15.0),
        (5.0, -5.0, 5.0, 5.0),  # across
        (10.0, 0.0, 20.0, 0.0),  # one after the other
    ],
)
def test_shadowing_of_links_is_correlated_by_shared_region(other: tuple[float, ...]):
    first = (0.0, 0.0, 10.0, 0.0)
    product = over_arenas(*first) * over_arenas(*other)
    assert is_mean(product, covariance(first, other))


def test_shadowing_field_decays_exponentially_with_distance():
    """Links of 1 cm stand for points: half the mean squared change over the variance is 1 - exp(-d / delta)."""
    before = over_arenas(0.0, 0.0, 0.01, 0.0)
    variance = 0.01 / (2.0 * DELTA_M)  # of 1/sqrt(d) times d of a field with variance sigma^2 / (2 delta)
    for moved_m in (0.5, 1.0, 2.5, 5.0, 10.0, 20.0):
        x_m, y_m = 0.8 * moved_m, 0.6 * moved_m
        half_square = 0.5 * (over_arenas(x_m, y_m, x_m + 0.01, y_m) - before) ** 2
        assert is_mean(half_square, variance * (1.0 - np.exp(-moved_m / DELTA_M)))


@pytest.mark.parametrize("link", [(0.0, 0.0, 3.0, 1.0), (-20.0, 5.0, 12.0, -9.0), (4.0, 4.0, 4.0, 4.2)])
def test_shadowing_is_the_integral_of_waves_along_the_link(link: tuple[float, ...]):
    """By quadrature, with the library's cosine, of the waves that have less than 20 turns in 40 m."""
    ax, ay, bx, by = link
    length_m = np.hypot(bx - ax, by - ay)
    nodes, weights = np.polynomial.legendre.leggauss(400)
    share = 0.5 * (nodes + 1.0)[:, None]
    for kx, ky, phase in shadow_waves()[:3, :, :SLOW]:
        p = np.cos(2.0 * np.pi * (kx * (ax + share * (bx - ax)) + ky * (ay + share * (by - ay)) + phase)).sum(axis=1)
        integral = 0.5 * length_m * (weights @ p) * AMPLITUDE_DB
        waves = np.zeros(shadow_waves().shape[1:])
        waves[2] = 0.25  # the others are 0 everywhere
        waves[:, :SLOW] = kx, ky, phase
        value = shadowing_db(waves, AMPLITUDE_DB, *link)
        assert value == pytest.approx(integral / np.sqrt(length_m), rel=1e-8, abs=1e-8)


def test_shadowing_counts_each_wave_once():
    """`between_db` has its waves written out: one that it left out or took twice would show as it stands alone."""
    count = shadow_waves().shape[2]
    alone = np.array([0.05, 0.02, 0.1])[:, None] * np.eye(count)[:, None, :]  # (which, 3, waves)
    value = np.array([shadowing_db(waves, AMPLITUDE_DB, -3.0, 1.0, 2.0, 0.5) for waves in alone])
    assert value[0] != 0.0
    assert (value == value[0]).all()


def test_shadowing_wave_numbers_are_stratified_quantiles():
    """F(k) = 1 - 1 / sqrt(1 + (2 pi delta k)^2) for the exponential covariance of scale delta."""
    k = np.hypot(shadow_waves()[:50, 0], shadow_waves()[:50, 1])
    share = 1.0 - 1.0 / np.sqrt(1.0 + (2.0 * np.pi * DELTA_M * k) ** 2)
    count = k.shape[1]
    assert np.all(np.abs(share * count - np.arange(count) - 0.5) <= 0.5 + 1e-9)


@pytest.mark.parametrize("length_m", [2.0, 20.0, 80.0])
def test_shadowing_is_normal(length_m: float):
    """Kolmogorov-Smirnov, false alarm 1 in 1000."""
    deviation = np.sqrt(1.0 - DELTA_M / length_m * (1.0 - np.exp(-length_m / DELTA_M)))
    assert stats.kstest(over_arenas(-9.0, 1.0, -9.0, 1.0 + length_m) / deviation, "norm").pvalue > 1e-3


def test_shadowing_of_a_single_arena_has_the_expected_variance():
    """Links of 10 m strewn over 100 m x 100 m: about 60 independent patches, so a deviation of about a sixth."""
    draws = np.random.default_rng(4)
    ratios = []
    for waves in shadow_waves()[:20]:
        start, turn = draws.uniform(-50, 50, (300, 2)), draws.uniform(0, 2 * np.pi, 300)
        end = start + 10.0 * np.stack([np.cos(turn), np.sin(turn)], axis=1)
        x = [shadowing_db(waves, AMPLITUDE_DB, *a, *b) for a, b in zip(start, end, strict=True)]
        ratios.append(np.mean(np.square(x)) / 0.5677)
    assert 0.5 < min(ratios) < max(ratios) < 1.6
    assert np.std(ratios) < 0.3


@given(COORDINATES, COORDINATES, COORDINATES, COORDINATES)
def test_shadowing_is_equal_in_both_directions(ax: float, ay: float, bx: float, by: float):
    forth, back = (
        shadowing_db(shadow_waves()[0], AMPLITUDE_DB, *ends) for ends in ((ax, ay, bx, by), (bx, by, ax, ay))
    )
    assert forth == back


def test_shadowing_of_touching_robots_is_zero():
    assert shadowing_db(shadow_waves()[0], AMPLITUDE_DB, 3.0, 4.0, 3.0, 4.0) == 0.0
    assert over_arenas(3.0, 4.0, 3.0, 4.001).std() < 0.02


def test_shadowing_field_depends_on_the_arena_key_alone():
    alone = field_waves(KEYS[7:8], UNIT)[0]
    assert np.array_equal(alone, shadow_waves()[7])
    assert not np.array_equal(shadow_waves()[7], shadow_waves()[8])


def test_shadowing_scales_with_deviation_and_correlation_length():
    """Twice the deviation, ten times all lengths: the same field doubled."""
    larger = Shadowing(2.0, 10.0 * DELTA_M)
    waves = field_waves(KEYS[:1], larger)[0]
    doubled = shadowing_db(waves, amplitude_db(larger), 10.0, 20.0, -70.0, 30.0)
    assert doubled == pytest.approx(2.0 * shadowing_db(shadow_waves()[0], AMPLITUDE_DB, 1.0, 2.0, -7.0, 3.0), rel=1e-6)


@given(st.floats(-1e4, 1e4))
def test_shadowing_sines_agree_with_numpy(turns: float):
    fraction = turns - np.rint(turns)
    assert abs(sine(turns) - np.sin(2.0 * np.pi * fraction)) < 3e-11
    assert abs(cosine(turns) - np.cos(2.0 * np.pi * fraction)) < 3e-11
    assert sine(-turns) == -sine(turns)
    assert cosine(-turns) == cosine(turns)


@njit  # pyright: ignore[reportUntypedFunctionDecorator] - numba is untyped
def total_of(s):
    return total(s)


def test_shadowing_total_adds_each_sum_once():
    powers = 2.0 ** np.arange(SUMS)
    assert total_of(powers) == 2.0**SUMS - 1.0
