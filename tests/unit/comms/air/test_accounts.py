"""Nothing is lost quietly: one fate for each packet and intended receiver."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from swarmwire.comms.air.accounts import Accounts
from swarmwire.comms.air.intake import Intake
from swarmwire.comms.air.radio import Radio
from swarmwire.comms.air.transmissions import Transmissions
from swarmwire.comms.fates import Fate
from swarmwire.comms.packets import BROADCAST, Sent
from swarmwire.comms.truth import Obstacle
from tests.support.comms.air.runs import Run, at, everybody, make_air, packets, run, scattered

RADIOS = st.builds(
    Radio,
    range_m=st.floats(0.1, 9.0),
    line_of_sight=st.booleans(),
    loss=st.sampled_from([0.0, 0.3, 1.0]),
    latency_s=st.sampled_from([0.0, 0.1, 0.25]),
    jitter_s=st.sampled_from([0.0, 0.02, 0.3]),
    bit_rate_bps=st.sampled_from([300, 2_000, 250_000]),
    overhead_bytes=st.integers(0, 20),
    max_payload_bytes=st.integers(10, 60),
    queue_limit=st.integers(0, 4),
    send_offset=st.sampled_from(["uniform", "tick", 0.0, 0.03, 0.25]),
)
OBSTACLES = [Obstacle("cylinder", 0.5, 0.5, radius_m=0.4), Obstacle("box", -1.0, -1.0, 0.3, size_m=(1.5, 0.4))]


def random_traffic(rng: np.random.Generator, arenas: int, robots: int) -> Sent:
    """Some robots send some packets, to all or to one, in any order."""
    k = int(rng.integers(0, 3 * robots))
    sender = rng.integers(0, arenas * robots, k)
    to = (sender + rng.integers(1, robots, k)) % robots
    return packets(sender, np.where(rng.random(k) < 0.6, BROADCAST, to), rng.integers(0, 70, k))


def random_run(radio: Radio, arenas: int, robots: int, seed: int, quiet_ticks: int) -> Run:
    """Four ticks of random traffic among robots at random places."""
    rng = np.random.default_rng(seed)
    air = make_air(radio, robots, range(arenas), [OBSTACLES] * arenas)
    return run(air, scattered(arenas * robots, seed), lambda _: random_traffic(rng, arenas, robots), 4, quiet_ticks)


@settings(max_examples=150)
@given(RADIOS, st.integers(1, 3), st.integers(2, 12), st.integers(0, 1000), st.sampled_from([0, 1, 8]))
def test_fates_add_up_to_intended_receivers(radio: Radio, arenas: int, robots: int, seed: int, quiet_ticks: int):
    told = random_run(radio, arenas, robots, seed, quiet_ticks)
    np.testing.assert_array_equal(told.tally.fates.sum(axis=1), told.tally.intended)
    assert (told.tally.fates >= 0).all()


@settings(max_examples=60)
@given(RADIOS, st.integers(1, 3), st.integers(2, 12), st.integers(0, 1000))
def test_tally_agrees_with_what_is_listed(radio: Radio, arenas: int, robots: int, seed: int):
    """Heard packets, listed links and the tally tell the same story, in every tick."""
    for one in random_run(radio, arenas, robots, seed, 2).news:
        listed = np.zeros_like(one.tally.fates)
        np.add.at(listed, (one.finished.arena, one.finished.fate), one.finished.receivers)
        but_far = [fate for fate in Fate if fate != Fate.OUT_OF_RANGE]
        np.testing.assert_array_equal(listed[:, but_far], one.tally.fates[:, but_far])
        assert not listed[:, Fate.OUT_OF_RANGE].any()
        assert len(one.heard) == listed[:, Fate.HEARD].sum()
        in_range = listed[:, Fate.HEARD] + listed[:, Fate.LOST]
        assert (one.tally.in_range >= in_range).all()
        if not one.tally.fates[:, Fate.QUEUE_FULL].any():
            np.testing.assert_array_equal(one.tally.in_range, in_range)


def test_sent_and_intended_are_counted_when_the_air_takes_a_packet_up():
    """Even if it goes on air ticks later."""
    told = run(make_air(Radio(2.0, send_offset=0.25), 4), at((0, 0), (1, 0), (2, 0), (5, 0)), everybody(4), 1, 4)
    assert [int(one.tally.intended[0]) for one in told.news] == [0, 12, 0, 0, 0, 0]
    assert [int(one.tally.sent[0]) for one in told.news] == [0, 4, 0, 0, 0, 0]
    assert [int(one.tally.fates.sum()) for one in told.news] == [0, 0, 0, 12, 0, 0]


def test_a_broadcast_intends_only_robots_alive():
    air = make_air(Radio(9.0, send_offset="tick"), 4)
    air.hold(scattered(4), np.array([True, True, False, True]))
    air.send(0, 0, packets([0]))
    tally = air.advance(10**8).tally
    assert tally.intended.tolist() == [2]
    assert tally.fates[0, Fate.HEARD] == 2


def test_what_the_run_ends_under_way_or_queued_is_in_flight():
    """Three packets of 40 ms each: one delivered late, one on air, one waiting; none of them final, none in range."""
    radio = Radio(9.0, latency_s=1.0, bit_rate_bps=2000, send_offset="tick")
    told = run(make_air(radio, 3), at((0, 0), (1, 0), (2, 0)), lambda _: packets([0, 0, 0, 0]), 1)
    assert told.fates() == {"IN_FLIGHT": 8}
    assert told.tally.in_range.tolist() == [0]
    assert told.air.end().fates.sum() == 0


def test_the_books_of_some_arenas_may_be_closed_and_the_others_count_on():
    def handed_over(rows: list[int]) -> Transmissions:
        return Intake(6).take(np.zeros(6, np.int64), packets(rows), np.full(6, 1), 0)

    accounts = Accounts(arenas=3, robots=2)
    accounts.take_up(handed_over([0, 2, 3, 4, 5, 5]))
    closed = accounts.close(np.array([True, False, True]))
    assert (closed.sent.tolist(), closed.intended.tolist()) == ([1, 0, 3], [1, 0, 3])
    accounts.take_up(handed_over([0]))
    rest = accounts.close()
    assert (rest.sent.tolist(), rest.intended.tolist(), rest.fates.sum()) == ([1, 2, 0], [1, 2, 0], 0)
    assert accounts.close().sent.tolist() == [0, 0, 0]
