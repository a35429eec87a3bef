"""Airtime and throughput: by hand, and against sums over packets."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings

from swarmwire.comms.clock import NS_PER_S
from swarmwire.comms.fates import Fate
from swarmwire.metrics.metrics import Metrics
from tests.metrics.radio_runs import radio_runs, rows_of
from tests.metrics.recorded import links
from tests.metrics.truths import departed, measured, static, truth

MS = 1_000_000
TICK_MS = 100


def test_airtime_is_the_share_of_the_tick_that_a_robot_alive_is_on_air():
    of = static(4, arenas=2)
    two = departed([0, 2], on_air_at_ns=5 * MS, off_air_at_ns=15 * MS, arena=1)
    assert measured("airtime", of, truth(of, departed=two)) == [0.0, pytest.approx(20 / (4 * TICK_MS))]
    alive = np.array([True] * 6 + [False] * 2)
    assert measured("airtime", of, truth(of, departed=two, alive=alive))[1] == pytest.approx(20 / (2 * TICK_MS))


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


@settings(max_examples=25)
@given(radio_runs())
def test_over_a_run_they_are_the_sums_over_packets(run):
    of, seen = run
    metrics = Metrics(["airtime", "throughput"])
    metrics.begin(of)
    on_air_s, bits = np.zeros(of.arenas), np.zeros(of.arenas)
    for one in seen:
        metrics.see(one)
        alive = one.alive.reshape(of.arenas, of.robots).sum(axis=1)
        for arena, fate, on, off in rows_of(one.departed, "arena", "fate", "on_air_at_ns", "off_air_at_ns"):
            assert off >= on if fate == Fate.HEARD else off == on
            on_air_s[arena] += (off - on) / NS_PER_S / alive[arena]
        for arena, fate, size in rows_of(one.finished, "arena", "fate", "size_bytes"):
            bits[arena] += 8 * size if fate == Fate.HEARD else 0
    duration_s = len(seen) / of.rate_hz
    found = metrics.end(None)["metrics"]
    assert [own["airtime"]["mean"] for own in found] == pytest.approx(on_air_s / duration_s)
    assert [own["throughput"]["mean"] for own in found] == pytest.approx(bits / duration_s)
