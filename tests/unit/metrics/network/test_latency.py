"""How late packets are, and how old what is known: PDR and latencies of a window, and the age of information."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from swarmwire.comms.base.clock import NS_PER_S
from swarmwire.comms.base.sentinels import BROADCAST
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.robot.packets import Fate
from swarmwire.metrics.measures.network import age_of_information
from swarmwire.metrics.measures.network.delivery import LinkPacketDeliveryRatio, PacketDeliveryRatio, Window
from swarmwire.metrics.measures.network.latency import (
    LARGEST_NS,
    RELATIVE_ERROR,
    LatencyOnAir,
    LatencyToAgent,
    LogHistogram,
)
from tests.support.comms.radio import make_medium, packets
from tests.support.metrics.radio import radio_runs, rows_of
from tests.support.metrics.recorded import links
from tests.support.metrics.truths import in_each_tick, static, truth

MS = 1_000_000
PERCENTS = (0.0, 50.0, 90.0, 99.0, 100.0)
KINDS = PacketDeliveryRatio, LinkPacketDeliveryRatio, LatencyOnAir, LatencyToAgent


def window_values(run, truths, window_s):
    """The metrics of KINDS in each tick, (4, ticks, arenas)."""
    return in_each_tick(run, truths, *(kind(window_s=window_s) for kind in KINDS)).transpose(1, 0, 2)


@given(st.lists(st.integers(-9, 9), max_size=30), st.integers(1, 8))
def test_window_holds_the_last_ticks(numbers, size):
    run = static(1, arenas=2)
    window = Window(run, size / run.rate_hz, 1)
    for tick, number in enumerate(numbers):
        own = numbers[max(0, tick + 1 - size) : tick + 1]
        assert window.add([[number, 2 * number]]).tolist() == [[sum(own), 2 * sum(own)]]


def test_window_is_rounded_up_to_whole_ticks():
    for window_s, size in ((0.01, 1), (0.1, 1), (0.11, 2), (0.3, 3), (0.7, 7)):
        window = Window(static(1), window_s, 1)
        assert [int(window.add([[1]])[0, 0]) for _ in range(9)][-1] == size


@settings(max_examples=25)
@given(radio_runs(), st.integers(1, 5), st.integers(1, 3))
def test_ratios_and_latencies_are_sums_over_packets_of_the_window(run, size, every):
    drawn, truths = run
    run = replace(drawn, groups=(replace(drawn.groups[0], act_every_ticks=every),))
    values = window_values(run, truths, window_s=size * 0.1)
    for tick in range(len(truths)):
        for arena in range(run.arenas):
            window = truths[max(0, tick + 1 - size) : tick + 1]
            received = sum(int(one.tally.fates[arena, Fate.RECEIVED]) for one in window)
            in_range = sum(int(one.tally.in_range[arena]) for one in window)
            ended = sum(int(one.tally.fates[arena].sum()) for one in window)
            air, agent = [], []
            for one in window:
                acts_ns = next(tick for tick in range(one.tick, one.tick + every) if tick % every == 0) * 100 * MS
                for its, sent, final, fate in rows_of(one.finished, "arena", "sent_at_ns", "final_at_ns", "fate"):
                    if its == arena and fate == Fate.RECEIVED:
                        air.append((final - sent) / 1e9)
                        agent.append((acts_ns - sent) / 1e9)
            expected = [
                received / ended if ended else np.nan,
                received / in_range if in_range else np.nan,
                np.mean(air) if air else np.nan,
                np.mean(agent) if agent else np.nan,
            ]
            assert values[:, tick, arena].tolist() == pytest.approx(expected, nan_ok=True)


LOSSES = 0.3
OPEN = Radio(range_m=50.0, loss=LOSSES, latency_s=0.15, jitter_s=0.1)


def test_ratio_and_latency_under_independent_losses_match_the_radio():
    """Of 15000 links the ratio deviates by 0.004, the mean of the jitter by 0.0003 s: five times that is let pass."""
    run = static(20, arenas=4)
    air = make_medium(OPEN, run.robots, run.seeds, [()] * run.arenas)
    truths = []
    for tick in range(16):
        news = air.step(tick * 100 * MS, np.zeros((80, 3)))
        truths.append(truth(run, tick, tally=news.tally, finished=news.finished))
        air.send(tick * 100 * MS, tick, packets(np.arange(80), np.full(80, BROADCAST), np.full(80, 10)))
    pdr, link_pdr, air_s, agent_s = window_values(run, truths, window_s=1.0)[:, -1]
    np.testing.assert_array_equal(pdr, link_pdr)  # everybody is in range
    assert pdr.mean() == pytest.approx(1 - LOSSES, abs=0.02)
    assert air_s.mean() == pytest.approx(0.15 + 0.5 * 0.1, abs=0.0015)
    assert (agent_s >= air_s).all()
    assert (agent_s < air_s + 0.1).all()


NAME = "age_of_information"


def ages(run, truths):
    """The metric in each tick, (ticks, arenas)."""
    return in_each_tick(run, truths, NAME)[:, 0]


def links_received(sender, receiver, sent_at_ms, fate=Fate.RECEIVED, arena=0):
    return links(sender, receiver, 0, [at * MS for at in sent_at_ms], fate=fate, arena=arena)


def received_at(sent_at_ms, final_at_ms):
    """Packets from robot 0 to 1."""
    columns = {"sent_at_ns": MS * np.array(sent_at_ms), "final_at_ns": MS * np.array(final_at_ms)}
    return replace(links_received([0] * len(sent_at_ms), [1] * len(sent_at_ms), sent_at_ms), **columns)


def test_peak_age_is_the_age_just_before_a_newer_packet_came():
    run = static(2)
    links = [
        received_at([30], [60]),  # the first: no peak
        received_at([110, 150], [190, 170]),  # 170 - 30; the other comes too late
        replace(received_at([210], [230]), fate=np.array([Fate.LOST])),
        received_at([310], [330]),  # 330 - 150
    ]
    truths = [truth(run, tick, finished=one) for tick, one in enumerate(links)]
    values = in_each_tick(run, truths, "peak_age_of_information")[:, 0]
    assert values.ravel().tolist() == [pytest.approx(value, nan_ok=True) for value in (np.nan, 0.14, 0.14, 0.16)]


def test_receivers_are_thinned_in_the_age_of_large_swarms(monkeypatch):
    monkeypatch.setattr(age_of_information, "MAX_PAIRS", 20)  # 6 x 6 / 20: every second
    run = static(6)
    links = links_received([0, 0, 0], [1, 2, 4], [90, 80, 60])
    assert ages(run, [truth(run, 1, finished=links)]).ravel().tolist() == [pytest.approx(0.03)]


def test_age_sums_beyond_64_bits_have_the_right_mean():
    run, long_ns = static(4), 10**18
    pairs = [(a, b) for a in range(4) for b in range(4) if a != b]
    links = [links_received(*np.transpose(some), [long_ns // MS] * 6) for some in (pairs[:6], pairs[6:])]
    truths = [truth(run, tick, time_ns=(tick + 2) * long_ns, finished=one) for tick, one in enumerate(links)]
    assert ages(run, truths).ravel().tolist() == [pytest.approx(1e9), pytest.approx(2e9)]
    dead = np.array([False, True, True, True])
    truths.append(truth(run, 2, time_ns=4 * long_ns, finished=links_received([], [], []), alive=dead))
    assert ages(run, truths)[2, 0] == pytest.approx(3e9)


@settings(max_examples=25)
@given(radio_runs())
def test_age_is_that_of_a_dictionary_of_what_each_has_received(run):
    run, truths = run
    newest, expected = {}, []
    for one in truths:
        for arena, sender, receiver, sent, fate in rows_of(
            one.finished, "arena", "sender", "receiver", "sent_at_ns", "fate"
        ):
            if fate == Fate.RECEIVED:
                pair = arena, sender, receiver
                newest[pair] = max(newest.get(pair, sent), sent)
        alive = one.alive.reshape(run.arenas, run.robots)
        own = [
            [
                one.time_ns - sent
                for (arena, a, b), sent in newest.items()
                if arena == each and alive[each][[a, b]].all()
            ]
            for each in range(run.arenas)
        ]
        expected.append([sum(times) / len(times) / NS_PER_S if times else np.nan for times in own])
    np.testing.assert_allclose(ages(run, truths), expected, rtol=1e-12)


@pytest.mark.parametrize("lost", [0.0, 0.3, 0.6])
def test_age_under_independent_losses_is_that_of_renewal_theory(lost):
    """Mean d + T (1 + p) / (2 (1 - p)): of 40,000 periods it deviates by a hundredth at most."""
    rng, arenas, periods, delay_ms, period_ms = np.random.default_rng(3), 100, 400, 50, 300
    run, truths = static(2, arenas=arenas), []
    for tick in range(1, 3 * periods):
        arrived = np.flatnonzero(rng.random(arenas) >= lost) if tick % 3 == 1 else np.arange(0)
        none = np.zeros(len(arrived), np.int64)
        links = links_received(none, none + 1, none + (tick - 1) * 100, arena=arrived)
        truths.append(truth(run, tick, finished=links))
    mean_s = np.mean(ages(run, truths)[100:])
    # Known from the tick after: seen at 0.1, 0.2, … s of age, whose mean is that of 0.05 s of delay.
    expected_s = (delay_ms + period_ms * (1 + lost) / (2 * (1 - lost))) / 1000
    assert mean_s == pytest.approx(expected_s, rel=0.02)


def percentiles_ns(durations_ns):
    histogram = LogHistogram(1)
    values = np.array(durations_ns, np.int64)
    half = len(values) // 2
    for part in (values[:half], values[half:]):
        histogram.add(np.zeros(len(part), np.int64), part)
    return histogram.percentiles_ns(0, PERCENTS)


@given(st.lists(st.one_of(st.integers(0, 20), st.integers(0, LARGEST_NS)), min_size=1, max_size=60))
def test_percentiles_are_numpys_within_the_stated_error(durations_ns):
    exact = np.percentile(durations_ns, PERCENTS, method="inverted_cdf")
    np.testing.assert_allclose(percentiles_ns(durations_ns), exact, rtol=RELATIVE_ERROR * (1 + 1e-9))


def test_percentiles_of_no_latencies_are_nan():
    assert np.isnan(percentiles_ns([])).all()


def test_latency_beyond_the_largest_counts_as_the_largest():
    assert percentiles_ns([10 * LARGEST_NS])[1] == pytest.approx(LARGEST_NS, rel=RELATIVE_ERROR)
