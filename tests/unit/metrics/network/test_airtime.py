"""Airtime and throughput: by hand, and against sums over packets."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings

from swarmwire.comms.air.radio import Radio
from swarmwire.comms.fates import Fate
from swarmwire.metrics.metrics import Metrics
from tests.support.comms.air.runs import make_air, packets
from tests.support.metrics.radio_runs import radio_runs, rows_of
from tests.support.metrics.recorded import links
from tests.support.metrics.truths import departed, measured, static, truth

MS = 1_000_000
TICK_MS = 100


def test_airtime_is_the_share_of_the_tick_that_a_robot_alive_is_on_air():
    of = static(4, arenas=2)
    two = departed([0, 2], on_air_at_ns=5 * MS, off_air_at_ns=15 * MS, arena=1)
    assert measured("airtime", of, truth(of, departed=two)) == [0.0, pytest.approx(20 / (4 * TICK_MS))]
    dead = np.array([True] * 6 + [False] * 2)
    assert measured("airtime", of, truth(of, departed=two, alive=dead))[1] == pytest.approx(10 / (2 * TICK_MS))


def test_of_a_packet_longer_than_a_tick_the_rest_counts_in_those_that_follow():
    of, metrics, found = static(2), Metrics(["airtime"]), []
    metrics.begin(of)
    for tick, sender in enumerate(([0], [1], [], [])):
        metrics.see(truth(of, tick, departed=departed(sender, off_air_at_ns=(250 - 200 * tick) * MS)))
        found += metrics.latest["airtime"].tolist()
    assert found == pytest.approx([0.5, (1.0 + 0.5) / 2, 0.25, 0.0])


def test_throughput_counts_payload_once_for_each_that_heard_it():
    of = static(3, arenas=2)
    told = links([0, 0, 1], [1, 2, 0], 0, 0, fate=[Fate.HEARD, Fate.HEARD, Fate.LOST])
    told = replace(told, size_bytes=np.array([12, 12, 50]))
    assert measured("throughput", of, truth(of, finished=told)) == [2 * 12 * 8 * 10.0, 0.0]


@pytest.mark.parametrize("name", ["airtime", "throughput", "age_of_information"])
def test_without_a_radio_there_is_none(name):
    of = static(2, radio=False)
    assert np.isnan(measured(name, of, truth(of))).all()


@pytest.mark.parametrize("name", ["airtime", "age_of_information"])
def test_of_an_arena_where_all_are_dead_there_is_none(name):
    of = static(2)
    told = {"finished": links([0], [1], 0, 0), "departed": departed([0], off_air_at_ns=MS)}
    assert np.isnan(measured(name, of, truth(of, alive=np.zeros(2, np.bool_), **told))).all()


def test_of_robots_that_all_send_each_tick_they_are_what_the_radio_says():
    """Airtime 8 x bytes x rate / bit rate; throughput n (n - 1) (1 - p) x 8 x bytes x rate, within 3 %: 5 deviations.

    A packet that goes on air late in a tick counts in the next: of 30 packets of a robot that moves at most one.
    """
    of, size, lost, radio = static(20), 25, 0.3, Radio(range_m=50.0, loss=0.3, bit_rate_bps=20_000, overhead_bytes=5)
    air, metrics, told = make_air(radio, of.robots, of.seeds, [()]), Metrics(["airtime", "throughput"]), []
    air.hold(np.zeros((20, 3)), np.ones(20, np.bool_))
    metrics.begin(of)
    for tick in range(31):
        news = air.advance(tick * TICK_MS * MS)
        metrics.see(truth(of, tick, finished=news.finished, departed=news.departed))
        told.append([metrics.latest[name][0] for name in ("airtime", "throughput")])
        air.send(tick * TICK_MS * MS, tick, packets(np.arange(20), size=np.full(20, size)))
    share, bits = np.mean(told[1:], axis=0)
    assert share == pytest.approx(8 * (size + 5) * 10 / 20_000, rel=1 / 30)
    assert bits == pytest.approx(20 * 19 * (1 - lost) * 8 * size * 10, rel=0.03)


@settings(max_examples=25)
@given(radio_runs())
def test_they_are_sums_over_packets(run):
    of, seen = run
    metrics = Metrics(["airtime", "throughput"])
    metrics.begin(of)
    owed_ns = Counter()
    for one in seen:
        metrics.see(one)
        for arena, sender, fate, on, off in rows_of(
            one.departed, "arena", "sender", "fate", "on_air_at_ns", "off_air_at_ns"
        ):
            assert off >= on if fate == Fate.HEARD else off == on
            owed_ns[arena, sender] += off - on
        share, bits = np.zeros(of.arenas), np.zeros(of.arenas)
        alive = one.alive.reshape(of.arenas, of.robots)
        for arena, robot in list(owed_ns):
            counted_ns = min(owed_ns[arena, robot], TICK_MS * MS)
            owed_ns[arena, robot] -= counted_ns
            share[arena] += counted_ns / (TICK_MS * MS) / alive[arena].sum() if alive[arena, robot] else 0.0
        for arena, fate, size in rows_of(one.finished, "arena", "fate", "size_bytes"):
            bits[arena] += 8 * size if fate == Fate.HEARD else 0
        assert metrics.latest["airtime"] == pytest.approx(share)
        assert metrics.latest["throughput"] == pytest.approx(bits * of.rate_hz)
