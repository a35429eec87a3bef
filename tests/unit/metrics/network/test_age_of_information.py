"""Age of information: by hand, and against a dictionary of what each robot has heard."""

import numpy as np
import pytest
from hypothesis import given, settings

from swarmwire.comms.clock import NS_PER_S
from swarmwire.comms.fates import Fate
from swarmwire.metrics.metrics import Metrics
from swarmwire.metrics.network import age_of_information
from tests.support.metrics.radio_runs import DISK, radio_runs, rows_of, ticks
from tests.support.metrics.recorded import links
from tests.support.metrics.truths import static, truth

MS = 1_000_000
NAME = "age_of_information"


def ages(of, seen):
    """The metric in each tick, (ticks, arenas)."""
    metrics = Metrics([NAME])
    metrics.begin(of)
    found = []
    for one in seen:
        metrics.see(one)
        found.append(metrics.latest[NAME])
    return np.array(found)


def heard(sender, receiver, sent_at_ms, fate=Fate.HEARD, arena=0):
    return links(sender, receiver, 0, [at * MS for at in sent_at_ms], fate=fate, arena=arena)


def test_it_is_the_mean_over_pairs_of_the_time_since_the_newest_heard_was_sent():
    of = static(3, arenas=2)
    nothing = heard([], [], [])
    told = [
        nothing,
        heard([0, 0], [1, 2], [30, 40]),  # at 100 ms: ages of 70 and 60 ms
        nothing,
        heard([0], [1], [210]),  # at 300 ms: 90 and 260 ms
    ]
    found = ages(of, [truth(of, tick, finished=one) for tick, one in enumerate(told)])
    assert found[:, 0].tolist() == [pytest.approx(value, nan_ok=True) for value in (np.nan, 0.065, 0.165, 0.175)]
    assert np.isnan(found[:, 1]).all()


def test_a_pair_that_went_out_of_reach_ages_on_as_the_metrics_help_says():
    of, nothing = static(2), heard([], [], [])
    apart = np.array([(0.0, 0.0, 0.0), (7.0, 0.0, 0.0)])  # the range is 2 m
    seen = [truth(of, 1, finished=heard([0], [1], [50]))]
    seen += [truth(of, tick, finished=nothing, pose=apart) for tick in (2, 3)]
    assert ages(of, seen).ravel().tolist() == [pytest.approx(value) for value in (0.05, 0.15, 0.25)]
    assert "out of reach now age on" in age_of_information.AgeOfInformation.help


def test_what_was_overtaken_or_lost_changes_nothing_and_several_at_once_count_once():
    of = static(2)
    told = [
        heard([0, 0, 0], [1, 1, 1], [40, 80, 50]),
        heard([0, 0], [1, 1], [60, 150], fate=[Fate.HEARD, Fate.LOST]),
    ]
    found = ages(of, [truth(of, tick, finished=one) for tick, one in enumerate(told, 1)])
    assert found.ravel().tolist() == [pytest.approx(0.02), pytest.approx(0.12)]


def test_pairs_with_a_dead_robot_do_not_count_until_it_lives_again():
    of, nothing = static(3), heard([], [], [])
    dead = np.array([False, True, True])
    seen = [
        truth(of, 1, finished=heard([0, 1], [1, 2], [10, 80])),  # ages of 90 and 20 ms
        truth(of, 2, finished=nothing, alive=dead),
        truth(of, 3, finished=heard([0], [2], [250]), alive=dead),  # still on its way when its sender died
        truth(of, 4, finished=nothing),  # 390, 320 and 150 ms
    ]
    assert ages(of, seen).ravel().tolist() == [pytest.approx(value) for value in (0.055, 0.12, 0.22, 0.86 / 3)]


def test_of_many_robots_every_nth_counts_as_a_receiver(monkeypatch):
    monkeypatch.setattr(age_of_information, "MOST_PAIRS", 20)  # 6 x 6 / 20: every second
    of = static(6)
    told = heard([0, 0, 0], [1, 2, 4], [90, 80, 60])
    assert ages(of, [truth(of, 1, finished=told)]).ravel().tolist() == [pytest.approx(0.03)]


def test_a_run_so_long_that_times_add_up_beyond_64_bits_has_its_mean():
    of, long_ns = static(4), 10**18
    pairs = [(a, b) for a in range(4) for b in range(4) if a != b]
    told = [heard(*np.transpose(some), [long_ns // MS] * 6) for some in (pairs[:6], pairs[6:])]
    seen = [truth(of, tick, time_ns=(tick + 2) * long_ns, finished=one) for tick, one in enumerate(told)]
    assert ages(of, seen).ravel().tolist() == [pytest.approx(1e9), pytest.approx(2e9)]
    dead = np.array([False, True, True, True])
    seen.append(truth(of, 2, time_ns=4 * long_ns, finished=heard([], [], []), alive=dead))
    assert ages(of, seen)[2, 0] == pytest.approx(3e9)


@settings(max_examples=25)
@given(radio_runs())
def test_it_is_that_of_a_dictionary_of_what_each_has_heard(run):
    of, seen = run
    newest, expected = {}, []
    for one in seen:
        for arena, sender, receiver, sent, fate in rows_of(
            one.finished, "arena", "sender", "receiver", "sent_at_ns", "fate"
        ):
            if fate == Fate.HEARD:
                pair = arena, sender, receiver
                newest[pair] = max(newest.get(pair, sent), sent)
        alive = one.alive.reshape(of.arenas, of.robots)
        own = [
            [
                one.time_ns - sent
                for (arena, a, b), sent in newest.items()
                if arena == each and alive[each][[a, b]].all()
            ]
            for each in range(of.arenas)
        ]
        expected.append([sum(times) / len(times) / NS_PER_S if times else np.nan for times in own])
    np.testing.assert_allclose(ages(of, seen), expected, rtol=1e-12)


def test_an_arena_has_the_same_ages_alone_and_among_others():
    alone, among = static(5, arenas=1), static(5, arenas=3)
    seen = list(ticks(DISK, alone, 3))
    thrice = []
    for one in seen:
        assert one.finished is not None
        columns = {name: getattr(one.finished, name) for name in one.finished.__slots__ if name != "rssi_dbm"}
        columns = {name: np.tile(column, 3) for name, column in columns.items()}
        columns["arena"] = np.repeat(np.arange(3), len(one.finished.arena))
        thrice.append(truth(among, one.tick, alive=np.tile(one.alive, 3), finished=type(one.finished)(**columns)))
    np.testing.assert_array_equal(ages(among, thrice), np.tile(ages(alone, seen), (1, 3)))


@pytest.mark.parametrize("lost", [0.0, 0.3, 0.6])
def test_of_independent_losses_it_is_what_the_renewals_say(lost):
    """Mean d + T (1 + p) / (2 (1 - p)): of 40,000 periods it deviates by a hundredth at most."""
    rng, arenas, periods, delay_ms, period_ms = np.random.default_rng(3), 100, 400, 50, 300
    of, found = static(2, arenas=arenas), []
    metrics = Metrics([NAME])
    metrics.begin(of)
    for tick in range(1, 3 * periods):
        arrived = np.flatnonzero(rng.random(arenas) >= lost) if tick % 3 == 1 else np.arange(0)
        none = np.zeros(len(arrived), np.int64)
        told = heard(none, none + 1, none + (tick - 1) * 100, arena=arrived)
        metrics.see(truth(of, tick, finished=told))
        found.append(metrics.latest[NAME])
    mean_s = np.mean(found[100:])
    # Known from the tick after: seen at 0.1, 0.2, … s of age, whose mean is that of 0.05 s of delay.
    expected_s = (delay_ms + period_ms * (1 + lost) / (2 * (1 - lost))) / 1000
    assert mean_s == pytest.approx(expected_s, rel=0.02)
