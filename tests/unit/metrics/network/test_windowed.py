"""PDR and latencies of the last while: by hand, known values, and against sums over the packets of a window."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from swarmwire.comms.air.radio import Radio
from swarmwire.comms.fates import Fate
from swarmwire.comms.packets import BROADCAST
from swarmwire.metrics.metrics import Metrics
from swarmwire.metrics.network.latency import LatencyOnAir, LatencyToAgent
from swarmwire.metrics.network.pdr import PacketDeliveryRatio
from swarmwire.metrics.network.windowed import Window
from tests.support.comms.air.runs import make_air, packets
from tests.support.metrics.radio_runs import radio_runs, rows_of
from tests.support.metrics.truths import finished, measured, static, tally, truth

NAMES = ("pdr", "latency_air", "latency_agent")
MS = 1_000_000


def told(of, seen, window_s):
    """The three metrics in each tick, (3, ticks, arenas)."""
    metrics = Metrics([kind(window_s=window_s) for kind in (PacketDeliveryRatio, LatencyOnAir, LatencyToAgent)])
    metrics.begin(of)
    found = []
    for one in seen:
        metrics.see(one)
        found.append([metrics.latest[name] for name in NAMES])
    return np.array(found).transpose(1, 0, 2)


@given(st.lists(st.integers(-9, 9), max_size=30), st.integers(1, 8))
def test_a_window_holds_the_last_ticks(numbers, size):
    of = static(1, arenas=2)
    window = Window(of, size / of.rate_hz, 1)
    for tick, number in enumerate(numbers):
        own = numbers[max(0, tick + 1 - size) : tick + 1]
        assert window.add([[number, 2 * number]]).tolist() == [[sum(own), 2 * sum(own)]]


def test_a_window_is_rounded_up_to_whole_ticks():
    for window_s, size in ((0.01, 1), (0.1, 1), (0.11, 2), (0.3, 3), (0.7, 7)):
        window = Window(static(1), window_s, 1)
        assert [int(window.add([[1]])[0, 0]) for _ in range(9)][-1] == size


def test_the_ratio_is_of_receivers_in_range_and_of_the_window_alone():
    of = static(arenas=2)
    counts = [
        tally({Fate.HEARD: 3, Fate.LOST: 1, Fate.OUT_OF_RANGE: 9}, {Fate.OUT_OF_RANGE: 2}),
        tally({Fate.HEARD: 1, Fate.COLLIDED: 3}, {}),
        tally({}, {Fate.LOST: 4}),
        tally({}, {}),
    ]
    [pdr, _, _] = told(of, [truth(of, tick, tally=one) for tick, one in enumerate(counts)], window_s=0.2)
    nan = np.nan
    np.testing.assert_allclose(pdr, [[0.75, nan], [0.5, nan], [0.25, 0.0], [nan, 0.0]])


def test_latencies_end_at_hearing_and_at_the_tick_in_which_the_receiver_acts():
    of = static()
    third = replace(of, groups=(replace(of.groups[0], act_every_ticks=3),))
    seen = [truth(of, 1, finished=finished([40 * MS, 0], [65 * MS, 95 * MS])), truth(of, 2, finished=finished([], []))]
    [_, air, agent] = told(third, seen, window_s=0.2)
    assert air.ravel().tolist() == [pytest.approx(0.06)] * 2
    assert agent.ravel().tolist() == [pytest.approx(0.28)] * 2
    [_, air, agent] = told(of, seen, window_s=0.1)
    assert air.ravel().tolist() == [pytest.approx(0.06), pytest.approx(np.nan, nan_ok=True)]
    assert agent.ravel().tolist() == [pytest.approx(0.08), pytest.approx(np.nan, nan_ok=True)]


def test_what_was_not_heard_has_no_latency():
    of = static()
    assert np.isnan(measured("latency_air", of, truth(of, 1, finished=finished([0], [50 * MS], fate=Fate.LOST)))).all()


@pytest.mark.parametrize("name", NAMES)
def test_without_a_radio_there_is_none(name):
    of = static(2, arenas=2, radio=False)
    assert np.isnan(measured(name, of, truth(of))).all()


@settings(max_examples=25)
@given(radio_runs(), st.integers(1, 5), st.integers(1, 3))
def test_they_are_sums_over_the_packets_of_the_window(run, size, every):
    drawn, seen = run
    of = replace(drawn, groups=(replace(drawn.groups[0], act_every_ticks=every),))
    found = told(of, seen, window_s=size * 0.1)
    for tick in range(len(seen)):
        for arena in range(of.arenas):
            window = seen[max(0, tick + 1 - size) : tick + 1]
            heard = sum(int(one.tally.fates[arena, Fate.HEARD]) for one in window)
            in_range = sum(int(one.tally.in_range[arena]) for one in window)
            air, agent = [], []
            for one in window:
                acts_ns = next(tick for tick in range(one.tick, one.tick + every) if tick % every == 0) * 100 * MS
                for its, sent, final, fate in rows_of(one.finished, "arena", "sent_at_ns", "final_at_ns", "fate"):
                    if its == arena and fate == Fate.HEARD:
                        air.append((final - sent) / 1e9)
                        agent.append((acts_ns - sent) / 1e9)
            expected = [
                heard / in_range if in_range else np.nan,
                np.mean(air) if air else np.nan,
                np.mean(agent) if agent else np.nan,
            ]
            assert found[:, tick, arena].tolist() == pytest.approx(expected, nan_ok=True)


LOSSES = 0.3
OPEN = Radio(range_m=50.0, loss=LOSSES, latency_s=0.15, jitter_s=0.1)


def test_of_independent_losses_the_ratio_is_what_is_not_lost_and_the_latency_that_of_the_radio():
    """Of 15000 links the ratio deviates by 0.004, the mean of the jitter by 0.0003 s: five times that is let pass."""
    of = static(20, arenas=4)
    air = make_air(OPEN, of.robots, of.seeds, [()] * of.arenas)
    air.hold(np.zeros((80, 3)), np.ones(80, np.bool_))
    seen = []
    for tick in range(16):
        news = air.advance(tick * 100 * MS)
        seen.append(truth(of, tick, tally=news.tally, finished=news.finished))
        air.send(tick * 100 * MS, tick, packets(np.arange(80), np.full(80, BROADCAST), np.full(80, 10)))
    pdr, air_s, agent_s = told(of, seen, window_s=1.0)[:, -1]
    assert pdr.mean() == pytest.approx(1 - LOSSES, abs=0.02)
    assert air_s.mean() == pytest.approx(0.15 + 0.5 * 0.1, abs=0.0015)
    assert (agent_s >= air_s).all()
    assert (agent_s < air_s + 0.1).all()
