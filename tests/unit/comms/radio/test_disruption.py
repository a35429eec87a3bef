"""The dead, radios that are off, and partitions: who hears what, and that the books still add up."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.packets import SentPackets
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.disruption import Disruption, Jammers
from tests.support.comms.radio.runs import at, make_medium, packets, scattered
from tests.support.comms.radio.traffic import OBSTACLES, RADIOS, random_traffic, run_disrupted

THREE = at((0, 0), (1, 0), (0, 1))
FAR = at((0, 0), (1, 0), (-2.9, 2.4))


def disrupted(rows: int, dead: list[int] | None = None, off: list[int] | None = None, sides: list[int] | None = None):
    now = Disruption.none(rows)
    now.alive[dead or []] = False
    now.radio_on[off or []] = False
    if sides:
        now.sides = np.array([sides])
    return now


def slow(**given_: float) -> Radio:
    """Ten bytes take 80 ms."""
    return Radio(2.0, bit_rate_bps=1000, send_offset="tick", **given_)


def test_a_queue_ends_with_its_sender_and_is_empty_when_it_is_revived():
    """Four packets at 0, 80, 160 and 240 ms; dead from 100 to 300 ms; the next goes out at once."""
    sent = {0: packets([0] * 4), 3: packets([0])}
    told = run_disrupted(make_medium(slow(), 3), THREE, sent, {1: disrupted(3, dead=[0]), 3: disrupted(3)}, 6)
    assert told.fates() == {"RECEIVED": 6, "SENDER_DEAD": 4}
    assert sorted(set(told.on_air("on_air_at_ns").tolist())) == [0, 80_000_000, 300_000_000]
    assert told.news[1].tally.fates.sum() == 6, "the queue is settled when its sender dies"
    assert told.tally.in_range.tolist() == [10]


def test_what_is_on_its_way_to_a_robot_that_dies_reaches_nobody_not_even_it_revived():
    told = run_disrupted(
        make_medium(Radio(2.0, latency_s=0.25, send_offset="tick"), 3),
        THREE,
        {0: packets([0])},
        {1: disrupted(3, dead=[1]), 2: disrupted(3)},
        5,
    )
    assert told.fates() == {"RECEIVED": 1, "RECEIVER_DEAD": 1}
    assert told.received("receiver").tolist() == [2]


def test_a_broadcast_intends_those_alive_when_it_was_sent():
    """At 200 ms robot 1 dies and 2 is revived: 1 was meant and is dead, 2 was not and does not hear.

    Packets end at 80, 160, 240 and 320 ms; the second reached robot 1, but was not yet handed over.
    """
    now = {0: disrupted(3, dead=[2]), 2: disrupted(3, dead=[1])}
    told = run_disrupted(make_medium(slow(), 3), THREE, {0: packets([0] * 4)}, now, 6)
    assert told.tally.intended.tolist() == [4]
    assert told.fates() == {"RECEIVED": 1, "RECEIVER_DEAD": 3}
    assert set(told.received("receiver").tolist()) == {1}


def test_a_packet_for_a_dead_robot_out_of_reach_is_out_of_range():
    now = {0: disrupted(3, dead=[1, 2])}
    told = run_disrupted(make_medium(slow(), 3), FAR, {0: packets([0, 0], [1, 2])}, now, 5)
    assert told.fates() == {"RECEIVER_DEAD": 1, "OUT_OF_RANGE": 1}
    assert told.tally.in_range.tolist() == [1]


def test_a_radio_that_is_off_neither_sends_nor_receives_and_loses_what_it_was_to_send():
    """Off from 100 to 300 ms: packets at 0 and 80 ms go out, that of 80 ms still; 160 and 240 ms end; 320 ms goes."""
    now = {1: disrupted(3, off=[0]), 3: disrupted(3)}
    told = run_disrupted(make_medium(slow(), 3), THREE, {0: packets([0] * 5), 1: packets([1], 0)}, now, 7)
    assert told.fates() == {"RECEIVED": 6, "BLACKOUT": 5}
    assert sorted(set(told.on_air("on_air_at_ns").tolist())) == [0, 80_000_000, 100_000_000, 320_000_000]
    assert told.tally.in_range.tolist() == [11]


def test_a_reception_that_goes_on_when_the_radio_is_switched_off_is_lost_and_one_that_is_over_is_not():
    """Received at 80 and 160 ms; off from 100 ms."""
    told = run_disrupted(make_medium(slow(), 2), THREE[:2], {0: packets([0, 0])}, {1: disrupted(2, off=[1])}, 4)
    assert told.fates() == {"RECEIVED": 1, "BLACKOUT": 1}


def test_a_partition_stops_what_goes_on_air_between_its_sets_and_nothing_else():
    sent = {0: packets([0, 1, 2])}
    assert run_disrupted(make_medium(slow(), 3), THREE, sent, {0: disrupted(3, sides=[1, 2, 0])}, 4).fates() == {
        "RECEIVED": 4,
        "PARTITIONED": 2,
    }
    during = run_disrupted(make_medium(slow(latency_s=0.3), 3), THREE, sent, {1: disrupted(3, sides=[1, 2, 2])}, 8)
    assert during.fates() == {"RECEIVED": 6}


@given(RADIOS, st.integers(1, 3), st.integers(2, 9), st.integers(0, 1000), st.sampled_from([0, 1, 8]))
def test_fates_add_up_whatever_happens(radio: Radio, arenas: int, robots: int, seed: int, quiet_ticks: int):
    """Deaths, revivals, blackouts and partitions at random; and nobody dead, off or not meant hears anything."""
    rng = np.random.default_rng(seed)
    rows, ticks = arenas * robots, 6
    now: dict[int, Disruption] = {}
    for tick in range(ticks):
        sides = rng.integers(0, 3, (int(rng.integers(0, 3)), rows))
        one_way = rng.integers(0, 3, (int(rng.integers(0, 2)), rows))
        backlog = rng.integers(0, 3, rows)
        gain_db = rng.normal(0.0, 3.0, (2, rows))
        now[tick] = Disruption(
            rng.random(rows) < 0.7, rng.random(rows) < 0.8, backlog, sides, one_way, *gain_db, Jammers.none()
        )
    sent: dict[int, SentPackets] = {}
    for tick in range(ticks):
        drawn = random_traffic(rng, arenas, robots)
        keep = np.flatnonzero(now[tick].alive[drawn.sender])
        sent[tick] = SentPackets(drawn.sender[keep], drawn.to[keep], drawn.payloads.rows(keep))
    medium = make_medium(radio, robots, range(arenas), [OBSTACLES] * arenas)
    told = run_disrupted(medium, scattered(rows, seed), sent, now, ticks + quiet_ticks)
    np.testing.assert_array_equal(told.tally.fates.sum(axis=1), told.tally.intended)
    assert (told.tally.fates >= 0).all()
    assert (told.tally.in_range <= told.tally.intended).all()
    for tick, one in enumerate(told.news[:ticks]):
        assert now[tick].alive[one.received.receiver].all()
