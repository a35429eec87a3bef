"""Results do not depend on how the world or the crew is divided."""

from dataclasses import replace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from swarmwire.comms.air.parameters.gives import BearingGiven, Gives, RangeGiven
from swarmwire.comms.air.radio import Radio
from swarmwire.comms.packets import Sent
from swarmwire.comms.truth import Obstacle
from tests.support.comms.air.runs import Run, make_air, packets, run, scattered

ROBOTS = 7
RADIO = Radio(
    3.0,
    loss=0.3,
    latency_s=0.1,
    jitter_s=0.05,
    bit_rate_bps=3000,
    queue_limit=2,
    gives=Gives(RangeGiven(0.1), BearingGiven(0.2)),
)
OBSTACLES = [[Obstacle("cylinder", 0.1 * a, 0.0, radius_m=0.3 + 0.1 * a)] for a in range(3)]
COLUMNS = ("receiver", "sender", "sequence", "heard_at_ns")


def story(told: Run, arena: int = 0) -> list[tuple[object, ...]]:
    """Everything heard in one arena, with what came with it, then its tally."""
    rows: list[tuple[object, ...]] = []
    for tick, one in enumerate(told.news):
        h = one.heard
        for i in np.flatnonzero(h.receiver // ROBOTS == arena):
            given = tuple(column[i] for column in h.given.values())
            rest = h.sender[i], h.sequence[i], h.heard_at_ns[i], *given, h.payloads.row(h.payload[i])
            rows.append((tick, h.receiver[i] % ROBOTS, *rest))
    return [*rows, (*told.tally.fates[arena], told.tally.in_range[arena])]


def two_each(arenas: int) -> Sent:
    """Each robot sends two different packets."""
    sent = packets(range(2 * ROBOTS), size=20)
    payloads = sent.payloads.rows(np.tile(np.arange(2 * ROBOTS), arenas))
    return Sent(np.repeat(np.arange(arenas * ROBOTS), 2), np.tile(sent.to, arenas), payloads)


def test_an_arena_alone_gives_the_same_as_beside_others():
    seeds = (11, 12, 13)
    pose = scattered(3 * ROBOTS)
    beside = run(make_air(RADIO, ROBOTS, seeds, OBSTACLES), pose, lambda _: two_each(3), 5, 2)
    for arena, seed in enumerate(seeds):
        alone_air = make_air(RADIO, ROBOTS, [seed], [OBSTACLES[arena]])
        alone = run(alone_air, pose[arena * ROBOTS : (arena + 1) * ROBOTS], lambda _: two_each(1), 5, 2)
        assert len(story(alone)) > 50
        assert story(alone) == story(beside, arena)


@settings(max_examples=20)
@given(st.randoms(use_true_random=False))
def test_the_order_among_senders_is_indifferent(shuffle):
    """Each sender's own packets keep theirs."""
    sent = two_each(1)
    place = shuffle.sample(range(len(sent)), len(sent))
    order = np.array(place)[np.argsort(sent.sender[place], kind="stable")]
    index = np.empty_like(order)
    index[:] = np.array(place)
    for s in range(ROBOTS):
        index[np.isin(index, (2 * s, 2 * s + 1))] = 2 * s, 2 * s + 1
    mixed = Sent(sent.sender[index], sent.to[index], sent.payloads.rows(index))
    pose = scattered(ROBOTS)
    assert story(run(make_air(RADIO, ROBOTS), pose, lambda _: mixed, 3, 2)) == story(
        run(make_air(RADIO, ROBOTS), pose, lambda _: sent, 3, 2)
    )


def test_no_stage_shifts_the_draws_of_another():
    """With and without noise in what is given, the same packets are lost, equally late."""
    pose = scattered(ROBOTS)
    full, bare = (
        run(make_air(radio, ROBOTS), pose, lambda _: two_each(1), 5, 2)
        for radio in (RADIO, replace(RADIO, gives=Gives()))
    )
    for name in COLUMNS:
        np.testing.assert_array_equal(full.heard(name), bare.heard(name))


def test_heard_is_sorted_by_receiver_time_sender_and_sequence():
    """Also where times tie, and for robots that hear many."""
    for radio in (RADIO, Radio(99.0, send_offset="tick", jitter_s=0.2), Radio(99.0, send_offset="tick", latency_s=0.1)):
        told = run(make_air(radio, 30), scattered(30), lambda _: packets([*range(30), *range(30)]), 4, 4)
        for one in told.news:
            h = one.heard
            order = np.lexsort((h.sequence, h.sender, h.heard_at_ns, h.receiver))
            np.testing.assert_array_equal(order, np.arange(len(h)))
        assert len(told.heard("receiver")) > 1000


def test_the_order_of_ties_is_that_of_senders_also_over_ticks():
    """Robot 2 takes 150 ms from tick 0, robot 1 takes 50 ms from tick 1: both are heard at 150 ms."""
    air = make_air(Radio(99.0, bit_rate_bps=800, send_offset="tick"), 3)
    told = run(air, scattered(3), lambda tick: [packets([2], size=15), packets([1], size=5)][tick], 2, 2)
    heard_by_0 = told.heard("receiver") == 0
    assert told.heard("heard_at_ns")[heard_by_0].tolist() == [150_000_000] * 2
    assert told.heard("sender")[heard_by_0].tolist() == [1, 2]


def test_payloads_hold_only_packets_that_somebody_heard():
    told = run(make_air(RADIO, ROBOTS), scattered(ROBOTS), lambda _: two_each(1), 5, 2)
    for one in told.news:
        np.testing.assert_array_equal(np.unique(one.heard.payload), np.arange(len(one.heard.payloads)))
