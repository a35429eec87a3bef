"""Delays that are not uniform are found again. Seeds are fixed."""

import numpy as np
import pytest

from swarmwire.comms.clock import NS_PER_S
from swarmwire.comms.radio.config.impairments import Delays
from swarmwire.comms.radio.stages.delays import delay_distribution, varying_delay_ns
from swarmwire.metrics.radio_fit.delay import LatencyFit, fit_delays, fit_latency

PACKETS = 20_000


def made(delays: Delays, constant_s: float = 0.0) -> np.ndarray:
    """Latencies as the emulator's radio draws them."""
    law, draws = delay_distribution(delays), np.random.default_rng(5).uniform(0.0, 1.0, PACKETS)
    return constant_s + np.array([varying_delay_ns(law, u) for u in draws]) / NS_PER_S


@pytest.mark.parametrize("distribution", ["normal", "lognormal", "pareto"])
def test_each_distribution_is_told_from_the_others_and_found_again(distribution):
    of = fit_latency(made(Delays(distribution, 0.02, 0.006)))
    assert isinstance(of, LatencyFit)
    assert of.delays is not None
    assert of.delays.distribution == distribution
    assert of.delays.apart < 0.02 < of.apart
    # A constant and what varies are told apart less well than their sum.
    assert of.delays.latency_s.value + of.delays.mean_s.value == pytest.approx(0.02, rel=0.03)
    assert of.delays.deviation_s.value == pytest.approx(0.006, rel=0.15)
    assert 0.0 < of.delays.mean_s.standard_error < 0.004


def test_a_constant_below_a_skewed_delay_is_found_again():
    of = fit_delays(made(Delays("lognormal", 0.01, 0.01), constant_s=0.05))
    assert of is not None
    assert of.distribution == "lognormal"
    assert of.latency_s.value == pytest.approx(0.05, abs=0.001)
    assert of.mean_s.value == pytest.approx(0.01, rel=0.05)


def test_made_again_of_its_fit_a_gamma_delay_has_the_same_quantiles():
    """None of the distributions is a gamma one: the nearest of them stands for it."""
    latency_s = np.random.default_rng(6).gamma(2.0, 0.005, PACKETS) + 0.002
    of = fit_latency(latency_s)
    assert isinstance(of, LatencyFit)
    found = of.delays
    assert found is not None
    again_s = made(Delays(found.distribution, found.mean_s.value, found.deviation_s.value), found.latency_s.value)
    for percent in (10.0, 50.0, 90.0):
        assert np.percentile(again_s, percent) == pytest.approx(np.percentile(latency_s, percent), rel=0.05)


def test_uniform_delays_stay_uniform():
    of = fit_latency(made(Delays("uniform", 0.02, 0.005)))
    assert isinstance(of, LatencyFit)
    assert of.delays is None


def test_a_few_very_late_packets_do_not_make_another_distribution():
    latency_s = made(Delays("uniform", 0.02, 0.005))
    latency_s[::40] += 2.0
    of = fit_latency(latency_s)
    assert isinstance(of, LatencyFit)
    assert of.delays is None
