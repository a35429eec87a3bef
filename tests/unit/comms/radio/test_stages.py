"""Stages of the disk's chain: fixed loss, runs of losses, bodies that block."""

import numpy as np
import pytest
from scipy import stats
from scipy.stats import binomtest

from swarmwire.comms.draws import derive_key
from swarmwire.comms.geometry.obstacles import obstacle_arrays
from swarmwire.comms.packets import Fate
from swarmwire.comms.radio.config.impairments import Bursts
from swarmwire.comms.radio.config.presets import PRESETS, with_preset
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.medium import RadioMedium
from tests.support.comms.radio.runs import RATE_HZ, SIZE_M, at, everybody, living, make_medium, packets, run, scattered

# Two-sided, for each of the losses below; the seed is fixed, so a pass stays a pass.
FALSE_ALARM_RATE = 1e-4


@pytest.mark.parametrize("loss", [0.05, 0.3, 0.9])
def test_share_received_lies_in_the_exact_binomial_interval(loss: float):
    told = run(make_medium(Radio(2.0, loss=loss), 20), scattered(20), everybody(20), 30, 2)
    received, in_range = len(told.received("receiver")), int(told.tally.in_range[0])
    assert in_range > 2000
    assert binomtest(received, in_range, 1.0 - loss).pvalue > FALSE_ALARM_RATE


def test_both_directions_and_following_packets_are_lost_independently():
    """Of the pairs that both send, half x half lose both ways; likewise a packet and the next."""
    told = run(make_medium(Radio(99.0, loss=0.5), 20), scattered(20), everybody(20), 10, 2)
    lost = np.zeros((20, 20, 10), bool)
    lost[told.finished("sender"), told.finished("receiver"), told.finished("sequence")] = (
        told.finished("fate") == Fate.LOST
    )
    pairs = np.triu_indices(20, 1)
    both_ways = (lost & lost.transpose(1, 0, 2))[pairs]
    both_times = (lost[..., 1:] & lost[..., :-1])[~np.eye(20, dtype=bool)][:, ::2]
    assert binomtest(int(both_ways.sum()), both_ways.size, 0.25).pvalue > FALSE_ALARM_RATE
    assert binomtest(int(both_times.sum()), both_times.size, 0.25).pvalue > FALSE_ALARM_RATE


def test_no_loss_loses_nothing_and_full_loss_everything():
    for loss, fate in ((0.0, "RECEIVED"), (1.0, "LOST")):
        assert run(make_medium(Radio(99.0, loss=loss), 5), scattered(5), everybody(5), 3, 2).fates() == {fate: 60}


def test_another_seed_loses_other_packets():
    radio = Radio(99.0, loss=0.5, send_offset="tick")
    one, other = (run(make_medium(radio, 8, [s]), scattered(8), everybody(8), 2, 1).finished("fate") for s in (1, 2))
    assert (one != other).any()


# Wald and Wolfowitz: given how many packets of a sequence are lost, the runs of equal fates are as many as in a random
# order. Two-sided, at 1 in 10,000 for each sequence; keys are fixed.
SENDERS, TICKS = 12, 1500


def sequences(radio: Radio) -> np.ndarray:
    """Which packets of each sender are lost to one listener, (senders, packets), one each tick."""
    pose = at(*((0.01 * i, 0.5) for i in range(SENDERS)), (0.0, 0.0))
    sent = packets(range(SENDERS), SENDERS)
    told = run(make_medium(radio, SENDERS + 1), pose, lambda _: sent, TICKS, 2)
    lost = np.zeros((SENDERS, TICKS), bool)
    lost[told.finished("sender"), told.finished("sequence")] = told.finished("fate") != Fate.RECEIVED
    return lost


def runs_p(lost: np.ndarray) -> float:
    """The p-value of one sequence."""
    n, a = len(lost), int(lost.sum())
    b = n - a
    runs = 1 + int(np.count_nonzero(lost[1:] != lost[:-1]))
    mean = 1.0 + 2.0 * a * b / n
    variance = (mean - 1.0) * (mean - 2.0) / (n - 1.0)
    return float(2.0 * stats.norm.sf(abs(runs - mean) / np.sqrt(variance)))


@pytest.mark.parametrize("loss", [0.1, 0.5])
def test_fixed_loss_passes_the_runs_test(loss: float):
    p = [runs_p(lost) for lost in sequences(Radio(9.0, send_offset="tick", loss=loss))]
    assert min(p) > FALSE_ALARM_RATE / SENDERS
    # And the p-values are uniform, so that the test is neither blind nor loud: Kolmogorov-Smirnov, 1 in 10,000.
    assert stats.kstest(p, "uniform").pvalue > FALSE_ALARM_RATE


@pytest.mark.parametrize("bursts", [Bursts(0.5, 2.0), Bursts(0.5, 2.0, 0.8, 0.05)])
def test_bursts_of_as_much_loss_fail_it_on_every_link(bursts: Bursts):
    lost = sequences(Radio(9.0, send_offset="tick", bursts=bursts))
    assert max(runs_p(link) for link in lost) < FALSE_ALARM_RATE
    assert lost.mean() == pytest.approx(bursts.loss, abs=0.05)


RADIUS_M = 0.1
BLOCKING = Radio(9.0, send_offset="tick", bodies_block=True)


def medium_of(radio: Radio, robots: int, arenas: int = 1) -> RadioMedium:
    """Without obstacles, every robot with the same radius."""
    keys = np.array([derive_key("bodies", arena) for arena in range(arenas)], np.uint64)
    radius_m = np.full(robots, RADIUS_M)
    return RadioMedium(radio, keys, robots, SIZE_M, obstacle_arrays(((),) * arenas), RATE_HZ, radius_m=radius_m)


@pytest.mark.parametrize(
    ("between_y_m", "fates"),
    [(0.0, {"RECEIVED": 4, "BLOCKED": 2}), (0.099, {"RECEIVED": 4, "BLOCKED": 2}), (0.101, {"RECEIVED": 6})],
)
def test_a_disc_on_the_line_between_two_centres_blocks_both_ways(between_y_m: float, fates: dict[str, int]):
    pose = at((-1, 0), (0, between_y_m), (1, 0))
    told = run(medium_of(BLOCKING, 3), pose, everybody(3), 1)
    assert told.fates() == fates
    assert told.tally.in_range.tolist() == [fates["RECEIVED"]]


def test_bodies_do_not_block_unless_asked_to():
    told = run(medium_of(Radio(9.0, send_offset="tick"), 3), at((-1, 0), (0, 0), (1, 0)), everybody(3), 1)
    assert told.fates() == {"RECEIVED": 6}


def test_the_dead_are_in_the_way_and_the_graph_has_no_edge_through_bodies():
    pose, medium = at((-1, 0), (0, 0), (1, 0)), medium_of(BLOCKING, 3)
    assert medium.step(0, pose).edges.tolist() == [[0, 1], [1, 2]]
    assert medium.step(1, pose, living([True, False, True])).edges.tolist() == []


def test_an_arena_among_others_is_blocked_as_it_is_alone():
    pose = scattered(60)
    together = run(medium_of(BLOCKING, 30, 2), pose, everybody(60), 1).tally.fates
    alone = run(medium_of(BLOCKING, 30), pose[:30], everybody(30), 1).tally.fates
    assert together[0].tolist() == alone[0].tolist()
    assert together[0].tolist() != together[1].tolist()


@pytest.mark.parametrize("name", ["argos-rab", "infrared-epuck"])
def test_infrared_presets_are_blocked_by_bodies(name: str):
    assert PRESETS[name].radio["bodies_block"]
    assert with_preset({"preset": name, "bodies_block": False})["bodies_block"] is False
