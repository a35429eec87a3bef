"""Delays: each distribution is the one that it says, with the mean and deviation that were asked for.

Keys are fixed; Kolmogorov-Smirnov tests have a false-alarm rate of 1 in 1000.
"""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import integrate, stats

from swarmwire.comms.air.parameters.delays import DISTRIBUTIONS, Delays, refuse_negative
from swarmwire.comms.air.timing.delay_law import LONGEST_NS, delay_law, varying_delay_ns
from swarmwire.comms.clock import NS_PER_S
from swarmwire.comms.draws import derive_key, uniform
from swarmwire.comms.errors import BadInput

DRAWS = uniform(derive_key("delays"), np.arange(20_000), 0, 0, 0)
LAST_DRAW = 1.0 - 2.0**-53
UNITS = st.floats(0.0, LAST_DRAW)


def law_of(distribution: str, mean_s: float = 0.02, deviation_s: float = 0.008):
    delays = Delays(distribution, mean_s, deviation_s)
    refuse_negative(delays, "a.toml", "radio.delay")
    return delay_law(delays)


def reference(distribution: str, mean_s: float, deviation_s: float):
    """The same law, with scipy's own parameters."""
    if distribution == "uniform":
        half_s = np.sqrt(3.0) * deviation_s
        return stats.uniform(mean_s - half_s, 2.0 * half_s)
    if distribution == "normal":
        return stats.truncnorm(-mean_s / deviation_s, np.inf, mean_s, deviation_s)
    if distribution == "lognormal":
        sigma2 = np.log(1.0 + (deviation_s / mean_s) ** 2)
        return stats.lognorm(np.sqrt(sigma2), scale=mean_s * np.exp(-0.5 * sigma2))
    shape = 1.0 + np.sqrt(1.0 + (mean_s / deviation_s) ** 2)
    return stats.pareto(shape, scale=mean_s * (shape - 1.0) / shape)


@pytest.mark.parametrize("distribution", DISTRIBUTIONS)
@pytest.mark.parametrize(("mean_s", "deviation_s"), [(0.02, 0.008), (0.5, 0.001), (0.01, 0.005)])
def test_delays_are_quantiles_of_their_distribution(distribution: str, mean_s: float, deviation_s: float):
    law, expected = law_of(distribution, mean_s, deviation_s), reference(distribution, mean_s, deviation_s)
    for u in (1e-9, 0.001, 0.1, 0.5, 0.9, 0.999, 1.0 - 1e-9):
        # Rounded down to whole ns; scipy's truncated normal has ten digits or so.
        assert varying_delay_ns(law, u) == pytest.approx(expected.ppf(u) * NS_PER_S, rel=1e-9, abs=1.01)


@pytest.mark.parametrize("distribution", DISTRIBUTIONS)
def test_many_delays_have_their_distribution(distribution: str):
    delays_s = np.array([varying_delay_ns(law_of(distribution), u) for u in DRAWS]) / NS_PER_S
    assert stats.kstest(delays_s, reference(distribution, 0.02, 0.008).cdf).pvalue > 1e-3


@pytest.mark.parametrize(("distribution", "tolerance"), [("uniform", 1e-6), ("lognormal", 1e-5), ("pareto", 1e-3)])
def test_mean_and_deviation_are_those_asked_for(distribution: str, tolerance: float):
    """Integrated over the draw; a Pareto's second moment converges slowly."""
    law = law_of(distribution)
    moments = [
        integrate.quad(lambda t, n=n: (varying_delay_ns(law, 1.0 - np.exp(-t)) * 1e-9) ** n * np.exp(-t), 0.0, 36.0)[0]
        for n in (1, 2)
    ]
    assert moments[0] == pytest.approx(0.02, rel=tolerance)
    assert np.sqrt(moments[1] - moments[0] ** 2) == pytest.approx(0.008, rel=10 * tolerance)


def test_a_normal_delay_is_never_negative_and_keeps_its_mean_where_the_cut_is_far():
    near, far = law_of("normal", 0.01, 0.02), law_of("normal", 0.02, 0.002)
    delays_ns = np.array([varying_delay_ns(near, u) for u in DRAWS])
    assert delays_ns.min() >= 0
    assert delays_ns.mean() > 0.015 * NS_PER_S
    far_ns = np.array([varying_delay_ns(far, u) for u in DRAWS])
    assert abs(far_ns.mean() / NS_PER_S - 0.02) < 4.4 * 0.002 / np.sqrt(len(DRAWS))


@pytest.mark.parametrize("distribution", DISTRIBUTIONS)
@given(UNITS, UNITS)
def test_a_greater_draw_never_has_a_shorter_delay(distribution: str, one: float, other: float):
    law = law_of(distribution)
    assert 0 <= varying_delay_ns(law, min(one, other)) <= varying_delay_ns(law, max(one, other))


@pytest.mark.parametrize("distribution", DISTRIBUTIONS)
@pytest.mark.parametrize(("mean_s", "deviation_s"), [(1e-6, 5e-7), (3600.0, 2000.0)])
def test_the_last_draw_is_finite_and_a_whole_number_of_ns(distribution: str, mean_s: float, deviation_s: float):
    law = law_of(distribution, mean_s, deviation_s)
    for u in (0.0, LAST_DRAW):
        assert isinstance(varying_delay_ns(law, u), int)
        assert 0 <= varying_delay_ns(law, u) <= LONGEST_NS


def test_a_uniform_delay_that_would_be_negative_is_refused():
    with pytest.raises(BadInput, match=r"a.toml: radio.delay.deviation_s: expected at most 0.0057735 s"):
        law_of("uniform", 0.01, 0.006)
    assert varying_delay_ns(law_of("uniform", 0.01, 0.005), 0.5) == pytest.approx(0.01 * NS_PER_S, abs=1)
