"""A sender's radio sends one packet after the other and refuses what it cannot hold."""

import numpy as np
import pytest

from swarmwire.comms.air.radio import Radio
from swarmwire.comms.fates import Fate
from swarmwire.comms.truth import Obstacle
from tests.support.comms.air.runs import TICK_NS, at, make_air, packets, run

TRIO = at((0, 0), (1, 0), (9, 0))
SLOW = Radio(2.0, bit_rate_bps=4000, send_offset="tick")  # 10 bytes take 20 ms


def test_packets_of_one_sender_follow_each_other_without_gap():
    """First in, first out; another sender does not wait for them."""
    told = run(make_air(SLOW, 3), TRIO, lambda _: packets([0, 0, 1, 0], size=[10, 5, 10, 10]), 1)
    times = {
        (int(s), int(n)): int(t)
        for s, n, t in zip(told.on_air("sender"), told.on_air("sequence"), told.on_air("on_air_at_ns"), strict=True)
    }
    assert times == {(0, 0): 0, (0, 1): 20_000_000, (0, 2): 30_000_000, (1, 0): 0}
    assert (told.on_air("sent_at_ns") == 0).all()


@pytest.mark.parametrize("limit", [0, 1, 3])
def test_a_full_queue_refuses_for_every_intended_receiver(limit: int):
    """One packet is on air and `limit` wait; the refused count as in range where they would have been heard."""
    radio = Radio(2.0, bit_rate_bps=4000, send_offset="tick", queue_limit=limit)
    told = run(make_air(radio, 3), TRIO, lambda _: packets([0] * 5), 1, 3)
    assert told.on_air("sequence").tolist() == list(range(limit + 1))
    assert told.fates() == {"HEARD": limit + 1, "OUT_OF_RANGE": limit + 1, "QUEUE_FULL": 2 * (4 - limit)}
    assert told.tally.in_range.tolist() == [5]


def test_who_stands_behind_an_obstacle_was_not_in_range_of_what_was_refused():
    radio = Radio(2.0, line_of_sight=True, bit_rate_bps=4000, send_offset="tick", queue_limit=0)
    air = make_air(radio, 3, obstacles=[[Obstacle("cylinder", 0.5, 0.0, radius_m=0.1)]])
    told = run(air, at((0, 0), (1, 0), (0, 1)), lambda _: packets([0, 0]), 1, 3)
    assert told.fates() == {"HEARD": 1, "BLOCKED": 1, "QUEUE_FULL": 2}
    assert told.tally.in_range.tolist() == [2]


def test_the_queue_empties_as_time_passes():
    """Packets of 60 ms, two per tick of 100 ms, and room for one: with every other tick one more is refused."""
    radio = Radio(2.0, bit_rate_bps=4000, send_offset="tick", queue_limit=1)
    told = run(make_air(radio, 2), at((0, 0), (1, 0)), lambda _: packets([0, 0], size=30), 6, 3)
    on_air_ms = (told.on_air("on_air_at_ns") // 10**6).tolist()
    assert on_air_ms == [0, 60, 120, 200, 260, 320, 400, 460, 520]
    assert told.fates() == {"HEARD": 9, "QUEUE_FULL": 3}
    assert (np.diff(told.on_air("sequence")) > 0).all()


def test_what_earlier_ticks_left_waiting_counts_against_the_limit():
    """Packets of 60 ms and room for three: 120 and 180 ms still wait at 100 ms, 240 ms at 200 ms."""
    radio = Radio(2.0, bit_rate_bps=4000, send_offset="tick", queue_limit=3)
    told = run(make_air(radio, 2), at((0, 0), (1, 0)), lambda _: packets([0] * 5, size=30), 3, 6)
    assert told.on_air("sequence").tolist() == [0, 1, 2, 3, 5, 10, 11]
    assert told.on_air("on_air_at_ns")[-3:].tolist() == [240_000_000, 300_000_000, 360_000_000]


def test_refused_packets_are_numbered_too():
    """And a packet too large takes no time on air: the next goes out at once."""
    told = run(make_air(SLOW, 2), at((0, 0), (1, 0)), lambda _: packets([0, 0], size=[101, 100]), 1, 3)
    assert told.heard("sequence").tolist() == [1]
    assert told.on_air("on_air_at_ns").tolist() == [0]


def test_a_payload_above_the_maximum_is_too_large_for_every_intended_receiver():
    """Overhead does not count, and nobody was in range of it."""
    radio = Radio(2.0, max_payload_bytes=10, overhead_bytes=50, send_offset="tick")
    told = run(make_air(radio, 3), TRIO, lambda _: packets([0, 0, 1], [-1, -1, 2], [11, 10, 11]), 1)
    assert told.fates() == {"TOO_LARGE": 3, "HEARD": 1, "OUT_OF_RANGE": 1}
    assert told.tally.in_range.tolist() == [1]


def test_a_refusal_is_final_when_it_was_sent():
    """Offset 150 ms: in the second tick, whose poses tell who would have been in range."""
    radio = Radio(2.0, bit_rate_bps=1000, send_offset=0.15, queue_limit=0)  # on air for 80 ms
    air = make_air(radio, 2)
    air.hold(at((0, 0), (3, 0)), np.ones(2, bool))
    air.send(0, 0, packets([0, 0]))
    assert air.advance(TICK_NS).tally.fates.sum() == 0
    air.hold(at((0, 0), (1, 0)), np.ones(2, bool))
    tally = air.advance(2 * TICK_NS).tally
    assert tally.fates[0].sum() == tally.fates[0, Fate.QUEUE_FULL] == 1
    assert tally.in_range.tolist() == [1]
