"""Shadowing: what the field's definition says of variance and correlation, and that both directions agree."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numba import njit
from scipy import stats

from swarmwire.comms.draws import derive_key
from swarmwire.comms.radio.config.phy import Shadowing
from swarmwire.comms.radio.propagation.shadowing import (
    SUMS,
    amplitude_db,
    cosine,
    field_waves,
    shadowing_db,
    sine,
    total,
)

# Keys are fixed. Each statistic is taken over independent arenas and held to 4.4 standard errors (false alarm
# 1 in 90 000).
ARENAS = 3000
DELTA_M = 5.0
UNIT = Shadowing(deviation_db=1.0, correlation_m=DELTA_M)
KEYS = np.array([derive_key("shadowing", arena) for arena in range(ARENAS)], np.uint64)
WAVES = field_waves(KEYS, UNIT)
AMPLITUDE_DB = amplitude_db(UNIT)
STANDARD_ERRORS = 4.4
SLOW = 64  # a power of two, as sums go by halves
PLACES = st.floats(-200.0, 200.0)


def over_arenas(*link: float) -> np.ndarray:
    """X of one link (ax, ay, bx, by) in every arena."""
    return np.array([shadowing_db(waves, AMPLITUDE_DB, *link) for waves in WAVES])


def covariance(one: tuple[float, ...], other: tuple[float, ...], steps: int = 400) -> float:
    """E[X X'] of two links by the midpoint rule over the definition's double integral, sigma = 1."""
    share = (np.arange(steps) + 0.5)[:, None] / steps
    p, q = (np.array(link[:2]) + share * (np.array(link[2:]) - np.array(link[:2])) for link in (one, other))
    lengths = [np.hypot(link[2] - link[0], link[3] - link[1]) for link in (one, other)]
    apart = np.hypot(*(p[:, None] - q[None]).transpose(2, 0, 1))
    return float(np.sqrt(lengths[0] * lengths[1]) * np.mean(np.exp(-apart / DELTA_M)) / (2.0 * DELTA_M))


@pytest.mark.parametrize(
    ("length_m", "stated"), [(1, 0.0937), (5, 0.3679), (10, 0.5677), (20, 0.7546), (50, 0.900), (100, 0.950)]
)
def test_variance_grows_with_the_length_of_the_link_as_derived(length_m: float, stated: float):
    exact = 1.0 - DELTA_M / length_m * (1.0 - np.exp(-length_m / DELTA_M))
    assert exact == pytest.approx(stated, abs=5e-5)
    turn = 0.7 * length_m
    link = (3.0, -4.0, 3.0 + length_m * np.cos(turn), -4.0 + length_m * np.sin(turn))
    x2 = over_arenas(*link) ** 2
    assert abs(x2.mean() - exact) < STANDARD_ERRORS * x2.std() / np.sqrt(ARENAS)


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
def test_links_are_correlated_by_the_region_that_they_share(other: tuple[float, ...]):
    one = (0.0, 0.0, 10.0, 0.0)
    product = over_arenas(*one) * over_arenas(*other)
    assert abs(product.mean() - covariance(one, other)) < STANDARD_ERRORS * product.std() / np.sqrt(ARENAS)


def test_variogram_over_a_robots_way_is_that_of_the_field():
    """A short link is moved; half the mean squared change, by the definition's double integral."""
    link = (0.0, 0.0, 2.0, 0.0)
    here = over_arenas(*link)
    for moved_m in (0.5, 2.0, 5.0, 10.0, 25.0):
        there = (0.6 * moved_m, 0.8 * moved_m, 2.0 + 0.6 * moved_m, 0.8 * moved_m)
        half_square = 0.5 * (over_arenas(*there) - here) ** 2
        expected = covariance(link, link) - covariance(link, there)
        assert abs(half_square.mean() - expected) < STANDARD_ERRORS * half_square.std() / np.sqrt(ARENAS)


def test_the_field_itself_is_correlated_by_the_exponential_of_distance():
    """Links of 1 cm stand for points: half the mean squared change over the variance is 1 - exp(-d / delta)."""
    here = over_arenas(0.0, 0.0, 0.01, 0.0)
    variance = 0.01 / (2.0 * DELTA_M)  # of 1/sqrt(d) times d of a field with variance sigma^2 / (2 delta)
    for moved_m in (0.5, 1.0, 2.5, 5.0, 10.0, 20.0):
        half_square = 0.5 * (over_arenas(0.8 * moved_m, 0.6 * moved_m, 0.8 * moved_m + 0.01, 0.6 * moved_m) - here) ** 2
        expected = variance * (1.0 - np.exp(-moved_m / DELTA_M))
        assert abs(half_square.mean() - expected) < STANDARD_ERRORS * half_square.std() / np.sqrt(ARENAS)


@pytest.mark.parametrize("link", [(0.0, 0.0, 3.0, 1.0), (-20.0, 5.0, 12.0, -9.0), (4.0, 4.0, 4.0, 4.2)])
def test_a_link_collects_the_integral_of_the_waves_along_its_way(link: tuple[float, ...]):
    """By quadrature, with the library's cosine, of the waves that have less than 20 turns in 40 m."""
    ax, ay, bx, by = link
    length_m = np.hypot(bx - ax, by - ay)
    nodes, weights = np.polynomial.legendre.leggauss(400)
    share = 0.5 * (nodes + 1.0)[:, None]
    for kx, ky, phase in WAVES[:3, :, :SLOW]:
        p = np.cos(2.0 * np.pi * (kx * (ax + share * (bx - ax)) + ky * (ay + share * (by - ay)) + phase)).sum(axis=1)
        integral = 0.5 * length_m * (weights @ p) * AMPLITUDE_DB
        waves = np.zeros(WAVES.shape[1:])
        waves[2] = 0.25  # the others are 0 everywhere
        waves[:, :SLOW] = kx, ky, phase
        found = shadowing_db(waves, AMPLITUDE_DB, *link)
        assert found == pytest.approx(integral / np.sqrt(length_m), rel=1e-8, abs=1e-8)


def test_each_wave_counts_once():
    """`between_db` has its waves written out: one that it left out or took twice would show as it stands alone."""
    count = WAVES.shape[2]
    alone = np.array([0.05, 0.02, 0.1])[:, None] * np.eye(count)[:, None, :]  # (which, 3, waves)
    found = np.array([shadowing_db(waves, AMPLITUDE_DB, -3.0, 1.0, 2.0, 0.5) for waves in alone])
    assert found[0] != 0.0
    assert (found == found[0]).all()


def test_wave_numbers_are_quantiles_of_the_planes_spectrum_one_to_a_stratum():
    """F(k) = 1 - 1 / sqrt(1 + (2 pi delta k)^2) for the exponential covariance of scale delta."""
    k = np.hypot(WAVES[:50, 0], WAVES[:50, 1])
    share = 1.0 - 1.0 / np.sqrt(1.0 + (2.0 * np.pi * DELTA_M * k) ** 2)
    count = k.shape[1]
    assert np.all(np.abs(share * count - np.arange(count) - 0.5) <= 0.5 + 1e-9)


@pytest.mark.parametrize("length_m", [2.0, 20.0, 80.0])
def test_shadowing_is_normal(length_m: float):
    """Kolmogorov-Smirnov, false alarm 1 in 1000."""
    deviation = np.sqrt(1.0 - DELTA_M / length_m * (1.0 - np.exp(-length_m / DELTA_M)))
    assert stats.kstest(over_arenas(-9.0, 1.0, -9.0, 1.0 + length_m) / deviation, "norm").pvalue > 1e-3


def test_every_single_arena_varies_about_as_it_should():
    """Links of 10 m strewn over 100 m x 100 m: about 60 independent patches, so a deviation of about a sixth."""
    places = np.random.default_rng(4)
    ratios = []
    for waves in WAVES[:20]:
        start, turn = places.uniform(-50, 50, (300, 2)), places.uniform(0, 2 * np.pi, 300)
        end = start + 10.0 * np.stack([np.cos(turn), np.sin(turn)], axis=1)
        x = [shadowing_db(waves, AMPLITUDE_DB, *a, *b) for a, b in zip(start, end, strict=True)]
        ratios.append(np.mean(np.square(x)) / 0.5677)
    assert 0.5 < min(ratios) < max(ratios) < 1.6
    assert np.std(ratios) < 0.3


@given(PLACES, PLACES, PLACES, PLACES)
def test_both_directions_agree_to_the_last_bit(ax: float, ay: float, bx: float, by: float):
    assert shadowing_db(WAVES[0], AMPLITUDE_DB, ax, ay, bx, by) == shadowing_db(WAVES[0], AMPLITUDE_DB, bx, by, ax, ay)


def test_touching_robots_have_none():
    assert shadowing_db(WAVES[0], AMPLITUDE_DB, 3.0, 4.0, 3.0, 4.0) == 0.0
    assert over_arenas(3.0, 4.0, 3.0, 4.001).std() < 0.02


def test_the_field_belongs_to_the_arenas_key_alone():
    alone = field_waves(KEYS[7:8], UNIT)[0]
    assert np.array_equal(alone, WAVES[7])
    assert not np.array_equal(WAVES[7], WAVES[8])


def test_deviation_scales_and_length_sets_the_scale_of_distance():
    """Twice the deviation, ten times all lengths: the same field doubled."""
    larger = Shadowing(2.0, 10.0 * DELTA_M)
    waves = field_waves(KEYS[:1], larger)[0]
    doubled = shadowing_db(waves, amplitude_db(larger), 10.0, 20.0, -70.0, 30.0)
    assert doubled == pytest.approx(2.0 * shadowing_db(WAVES[0], AMPLITUDE_DB, 1.0, 2.0, -7.0, 3.0), rel=1e-6)


@given(st.floats(-1e4, 1e4))
def test_the_waves_sines_agree_with_the_librarys(turns: float):
    rest = turns - np.rint(turns)
    assert abs(sine(turns) - np.sin(2.0 * np.pi * rest)) < 3e-11
    assert abs(cosine(turns) - np.cos(2.0 * np.pi * rest)) < 3e-11
    assert sine(-turns) == -sine(turns)
    assert cosine(-turns) == cosine(turns)


@njit  # pyright: ignore[reportUntypedFunctionDecorator] - numba is untyped
def total_of(s):
    return total(s)


def test_a_total_has_each_of_the_sums_once():
    powers = 2.0 ** np.arange(SUMS)
    assert total_of(powers) == 2.0**SUMS - 1.0
