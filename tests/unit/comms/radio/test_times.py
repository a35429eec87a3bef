"""When packets are sent, go on air and are received, to the nanosecond."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.clock import to_ns
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.send_times import SendTimes
from tests.support.comms.radio.runs import TICK_NS, at, everybody, make_medium, packets, run, scattered

PAIR = at((0, 0), (1, 0))
AIRTIME_NS = 320_000  # 10 bytes at 250 kbit/s


@given(
    st.floats(0.0, 0.3),
    st.sampled_from([0.0, 0.02, 0.2]),
    st.integers(200, 10**6),
    st.sampled_from(["uniform", "tick", 0.05]),
)
def test_received_no_earlier_than_airtime_and_latency_allow(
    latency_s: float, jitter_s: float, bit_rate_bps: int, send_offset: str | float
):
    """And, jitter included, no later; so never in the packet's own tick."""
    radio = Radio(9.0, latency_s=latency_s, jitter_s=jitter_s, bit_rate_bps=bit_rate_bps, send_offset=send_offset)
    told = run(make_medium(radio, 5), scattered(5), everybody(5), 3, 30)
    airtime_ns = -(-80 * 10**9 // bit_rate_bps)
    late_ns = told.finished("final_at_ns") - told.finished("on_air_at_ns") - airtime_ns - to_ns(latency_s)
    assert len(late_ns) == 60
    assert (late_ns >= 0).all()
    assert (late_ns < max(to_ns(jitter_s), 1)).all()
    assert (told.finished("sent_at_ns") >= told.finished("sequence") * TICK_NS).all()
    assert (told.finished("on_air_at_ns") >= told.finished("sent_at_ns")).all()


def test_what_is_told_at_a_tick_was_received_by_it_and_not_before_the_last():
    told = run(make_medium(Radio(9.0, latency_s=0.15, jitter_s=0.1), 6), scattered(6), everybody(6), 4, 6)
    assert sum(len(one.received) for one in told.news) == 120
    for tick, one in enumerate(told.news):
        assert (one.received.received_at_ns <= tick * TICK_NS).all()
        assert (one.received.received_at_ns > (tick - 1) * TICK_NS).all()
        assert (one.received.sequence < tick).all()


@pytest.mark.parametrize(("late_ns", "ticks"), [(-1, 1), (0, 1), (1, 2)])
def test_a_packet_due_exactly_at_a_tick_is_received_in_it(late_ns: int, ticks: int):
    """In float seconds it would slip a tick now and then."""
    latency_s = (TICK_NS - AIRTIME_NS + late_ns) / 1e9
    told = run(make_medium(Radio(9.0, latency_s=latency_s, send_offset="tick"), 2), PAIR, everybody(2), 50, 3)
    received = [len(one.received) for one in told.news]
    assert received == [0] * ticks + [2] * 50 + [0] * (4 - ticks)


def test_airtime_counts_overhead_and_is_rounded_up():
    told = run(
        make_medium(Radio(9.0, bit_rate_bps=7_000_000, overhead_bytes=5, send_offset="tick"), 2), PAIR, everybody(2), 1
    )
    assert told.received("received_at_ns").tolist() == [17_143, 17_143]


def test_phase_spans_the_tick_and_jitter_a_fifth_of_it():
    told = run(make_medium(Radio(99.0), 40), np.zeros((40, 3)), everybody(40), 20, 3)
    offset_ns = np.full((40, 20), -1)
    sender, sequence = told.finished("sender"), told.finished("sequence")
    offset_ns[sender, sequence] = told.finished("sent_at_ns") - sequence * TICK_NS
    spread_ns = np.ptp(offset_ns, axis=1)
    assert (spread_ns < TICK_NS // 5).all()
    assert spread_ns.max() > 0.17 * TICK_NS
    assert offset_ns.min() >= 0
    assert offset_ns.max() < 1.2 * TICK_NS
    assert np.histogram(offset_ns[:, 0], 4, (0, 1.1 * TICK_NS))[0].min() > 0


def test_the_phase_of_a_slow_robot_spans_its_own_period():
    """Of 200 robots with a period of 4 ticks all are in the same quarter of it by chance in none of 10^100 seeds."""
    every, keys = np.where(np.arange(400) % 2, 4, 1), np.array([1], np.uint64)
    mixed, alone = (SendTimes("uniform", keys, e, 10) for e in (every, np.ones(400, np.int64)))
    sent_at_ns = np.stack([mixed.at(tick * TICK_NS, tick) - tick * TICK_NS for tick in range(0, 40, 4)])
    slow, fast = sent_at_ns[:, 1::2], sent_at_ns[:, ::2]
    assert np.histogram(slow[0], 4, (0, 4.4 * TICK_NS))[0].min() > 20
    assert 0 <= slow.min() < slow.max() < 4.8 * TICK_NS
    assert np.ptp(slow, axis=0).max() < 0.8 * TICK_NS
    assert np.array_equal(fast[3], (alone.at(12 * TICK_NS, 12) - 12 * TICK_NS)[::2])


@pytest.mark.parametrize(("send_offset", "sent_at_ns"), [("tick", 0), (0.03, 30_000_000), (0.25, 250_000_000)])
def test_an_explicit_offset_is_that_of_every_robot(send_offset: str | float, sent_at_ns: int):
    told = run(make_medium(Radio(9.0, send_offset=send_offset), 2), PAIR, everybody(2), 1, 4)
    assert told.finished("sent_at_ns").tolist() == [sent_at_ns] * 2


@pytest.mark.parametrize("send_offset", ["phase", -0.1, float("nan")])
def test_no_other_offset_is_taken(send_offset: str | float):
    with pytest.raises(ValueError, match="send_offset: expected"):
        make_medium(Radio(9.0, send_offset=send_offset), 2)


def test_geometry_is_that_of_the_tick_in_which_a_packet_goes_on_air():
    """Sent in tick 0, on air in tick 1 (its very start included), near in only one of them."""
    near, far = at((0, 0), (1, 0)), at((0, 0), (3, 0))
    for before, after, send_offset, received in ((near, far, 0.15, 0), (far, near, 0.15, 1), (far, near, 0.1, 1)):
        medium = make_medium(Radio(2.0, send_offset=send_offset), 2)
        medium.step(0, before)
        medium.send(0, 0, packets([0]))
        assert len(medium.step(TICK_NS, after).finished.fate) == 0
        assert len(medium.step(2 * TICK_NS, after).received) == received


def test_time_does_not_run_backwards():
    medium = make_medium(Radio(2.0), 2)
    medium.step(TICK_NS, at((0, 0), (1, 0)))
    for pass_time in (medium.advance, lambda until_ns: medium.step(until_ns, at((0, 0), (1, 0)))):
        with pytest.raises(ValueError, match="until_ns"):
            pass_time(TICK_NS - 1)
    with pytest.raises(ValueError, match="at_ns"):
        medium.send(0, 0, packets([0]))


def test_nothing_sent_takes_no_sequence_number_and_needs_no_time():
    medium = make_medium(Radio(9.0, send_offset="tick"), 2)
    medium.step(TICK_NS, at((0, 0), (1, 0)))
    medium.send_at(np.zeros(2, np.int64), packets([]))  # long ago: packets would be refused
    with pytest.raises(ValueError):
        medium.send_at(np.zeros(2, np.int64), packets([0]))


def test_a_disk_without_a_range_is_refused():
    with pytest.raises(ValueError, match="range_m: expected a range, as a unit disk has one"):
        make_medium(Radio(None), 2)
