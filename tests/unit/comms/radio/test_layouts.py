"""Results do not depend on how the world, the backend or time is divided, and order is kept where it is asked for."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from swarmwire.comms.base.arrays import AnyArray, FloatArray, IntArray
from swarmwire.comms.base.clock import tick_start_ns
from swarmwire.comms.base.geometry.shapes import Obstacle
from swarmwire.comms.base.sentinels import BROADCAST, NO_TX_STATUS
from swarmwire.comms.base.threads import WORTH_ROWS
from swarmwire.comms.radio.config.impairments import BearingMeasure, Delays, Measures, RangeMeasure
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.disruption import Disruption
from swarmwire.comms.radio.medium import RadioMedium
from swarmwire.comms.radio.results import Results
from swarmwire.comms.robot.packets import ReceivedPackets, SentPackets
from tests.support.comms.radio import (
    METHODS,
    RADIOS,
    RATE_HZ,
    TICK_NS,
    Run,
    drawing,
    everybody,
    jammed_by,
    jammers,
    make_medium,
    packets,
    random_traffic,
    run,
    run_disrupted,
    scattered,
    story,
    with_access,
)
from tests.unit.world.scenario.test_bodies import radio_of

ROBOTS = 7
RADIO = Radio(
    3.0,
    loss=0.3,
    latency_s=0.1,
    jitter_s=0.05,
    bit_rate_bps=3000,
    queue_limit=2,
    measures=Measures(RangeMeasure(0.1), BearingMeasure(0.2)),
)
OBSTACLES = [[Obstacle("cylinder", 0.1 * a, 0.0, radius_m=0.3 + 0.1 * a)] for a in range(3)]
COLUMNS = ("receiver", "sender_index", "sequence", "received_at_ns")


def two_each(arenas: int) -> SentPackets:
    """Each robot sends two different packets, one to all and one to its neighbour, of which it asks for the status."""
    sender, number = np.repeat(np.arange(ROBOTS), 2), np.arange(2 * ROBOTS)
    sent = packets(sender, np.where(number % 2, (sender + 1) % ROBOTS, BROADCAST), size=20)
    payloads, to = sent.payloads.select(np.tile(number, arenas)), np.tile(sent.to, arenas)
    ids = np.where(to == BROADCAST, NO_TX_STATUS, np.tile(number, arenas))
    return SentPackets(np.repeat(np.arange(arenas * ROBOTS), 2), to, payloads, ids)


def poses(radio: Radio, rows: int) -> FloatArray:
    """Random poses, twenty times as far apart where signals are heard as far."""
    return scattered(rows) * ([1.0, 1.0, 1.0] if radio.model == "unit-disk" else [20.0, 20.0, 1.0])


def disrupted(radio: Radio, arenas: Sequence[int]) -> dict[int, Disruption]:
    """Robots of arena 0 send so strongly that all would be near to them; jammers stand or move in each arena."""
    held = [
        jammer
        for row, arena in enumerate(arenas)
        for jammer in (
            {"arena": row, "x_m": 20.0 * arena, "on_ns": 3 * 10**6, "period_ns": 10**7},
            {"arena": row, "carrier": ROBOTS * row + arena, "power_dbm": -35.0},
        )
    ]
    now = jammed_by(jammers(*held if radio.model != "unit-disk" else ()), len(arenas) * ROBOTS)
    return {0: replace(now, send_gain_db=np.repeat([30.0 * (arena == 0) for arena in arenas], ROBOTS))}


@pytest.mark.parametrize(
    "radio",
    [RADIO, *map(drawing, METHODS), radio_of({"preset": "ble-1M"})],
    ids=["unit-disk", *METHODS, "advertising"],
)
def test_arena_alone_equals_the_arena_among_others(radio: Radio):
    pose, seeds = poses(radio, 3 * ROBOTS), (11, 12, 13)
    medium, now = make_medium(radio, ROBOTS, seeds, OBSTACLES), disrupted(radio, range(3))
    together = run(medium, pose, lambda _: two_each(3), 5, 2, now)
    for arena, seed in enumerate(seeds):
        medium, now = make_medium(radio, ROBOTS, [seed], [OBSTACLES[arena]]), disrupted(radio, [arena])
        alone = run(medium, pose[arena * ROBOTS : (arena + 1) * ROBOTS], lambda _: two_each(1), 5, 2, now)
        assert len(story(alone, ROBOTS)) > 30
        assert story(alone, ROBOTS) == story(together, ROBOTS, arena)


@pytest.mark.parametrize("radio", [RADIO, drawing("csma-802154")], ids=["unit-disk", "signals"])
@settings(max_examples=20)
@given(shuffle=st.randoms(use_true_random=False))
def test_order_among_senders_does_not_matter(radio: Radio, shuffle):
    """Each sender's own packets keep theirs."""
    sent = two_each(1)
    index = np.array(shuffle.sample(range(len(sent)), len(sent)))
    for s in range(ROBOTS):
        index[np.isin(index, (2 * s, 2 * s + 1))] = 2 * s, 2 * s + 1
    sent_in_order, mixed = (
        run(make_medium(radio, ROBOTS), poses(radio, ROBOTS), lambda _, each=each: each, 3, 2)
        for each in (sent, sent.select(index))
    )
    assert story(sent_in_order, ROBOTS) == story(mixed, ROBOTS)


def test_measurement_noise_does_not_shift_other_draws():
    """With and without noise in what is given, the same packets are lost, equally late."""
    pose = scattered(ROBOTS)
    full, bare = (
        run(make_medium(radio, ROBOTS), pose, lambda _: two_each(1), 5, 2)
        for radio in (RADIO, replace(RADIO, measures=Measures()))
    )
    for name in COLUMNS:
        np.testing.assert_array_equal(full.received(name), bare.received(name))


def test_received_is_sorted_by_receiver_time_sender_and_sequence():
    """Also where times tie, and for robots that hear many."""
    for radio in (RADIO, Radio(99.0, send_offset="tick", jitter_s=0.2), Radio(99.0, send_offset="tick", latency_s=0.1)):
        result = run(make_medium(radio, 30), scattered(30), lambda _: packets([*range(30), *range(30)]), 4, 4)
        for step in result.news:
            h = step.received
            order = np.lexsort((h.sequence, h.sender_index, h.received_at_ns, h.receiver))
            np.testing.assert_array_equal(order, np.arange(len(h)))
        assert len(result.received("receiver")) > 1000


def test_ties_over_ticks_are_in_the_order_of_senders():
    """Robot 2 takes 150 ms from tick 0, robot 1 takes 50 ms from tick 1: both are received at 150 ms."""
    medium = make_medium(Radio(99.0, bit_rate_bps=800, send_offset="tick"), 3)
    result = run(medium, scattered(3), lambda tick: [packets([2], size=15), packets([1], size=5)][tick], 2, 2)
    received_by_0 = result.received("receiver") == 0
    assert result.received("received_at_ns")[received_by_0].tolist() == [150_000_000] * 2
    assert result.received("sender_index")[received_by_0].tolist() == [1, 2]


def test_payloads_hold_only_received_packets():
    result = run(make_medium(RADIO, ROBOTS), scattered(ROBOTS), lambda _: two_each(1), 5, 2)
    for step in result.news:
        np.testing.assert_array_equal(np.unique(step.received.payload), np.arange(len(step.received.payloads)))


SIX, TICKS = 6, 5
PULSES = {"on_ns": 10**7, "period_ns": 2 * 10**7}, {"power_dbm": -60.0, "on_ns": 333_333, "period_ns": 10**6}
SIGNALS = st.sampled_from([*map(with_access, METHODS), *map(drawing, METHODS)])


def all_results(news: list[Results]) -> list[Any]:
    """All that was told, whenever that was: as plain values, sorted."""
    out = []
    for step in news:
        h, f, d = step.received, step.finished, step.departed
        for i in range(len(h)):
            measured = tuple(float(column[i]) for column in h.measured.values())
            numbers = int(h.receiver[i]), int(h.sender_index[i]), int(h.sequence[i]), int(h.received_at_ns[i])
            out.append(("received", *numbers, measured, h.payloads.row(int(h.payload[i]))))
        columns = f.sender, f.receiver, f.receivers, f.sequence, f.on_air_at_ns, f.final_at_ns, f.fate
        out += [("finished", *row) for row in zip(*(column.tolist() for column in columns), strict=True)]
        columns = d.sender, d.sequence, d.intended, d.fate, d.on_air_at_ns, d.off_air_at_ns
        out += [("departed", *row) for row in zip(*(column.tolist() for column in columns), strict=True)]
    return sorted(out)


def played(medium: RadioMedium, parts: list[float], seed: int, out: int | None) -> tuple[list[Any], list[int]]:
    """What becomes of packets sent at several times within ticks, where time passes in these parts of a tick, too.

    Where robots are out, one is dead and one's radio is off for two ticks, while jammers pulse on a PHY. What is
    received by a tick's start is told before that: a robot that has been handed a packet has received it, though it be
    dead a moment later.
    """
    rng = np.random.default_rng(seed)
    pose = scattered(SIX, seed)
    news, within = list[Results](), list[ReceivedPackets]()
    for tick in range(TICKS):
        start_ns, disruption = tick_start_ns(tick, RATE_HZ), None
        if out is not None and tick in (1, 3):
            is_jammed = tick == 1 and medium.radio.model != "unit-disk"
            disruption = jammed_by(jammers(*PULSES if is_jammed else ()), SIX)
            if tick == 1:
                disruption.radio_on[out] = disruption.alive[(out + 1) % SIX] = False
        within.append(medium.advance(start_ns)[0])
        news.append(medium.step(start_ns, pose + 0.01 * tick, disruption))
        sends = [(start_ns + int(at), rng.integers(0, SIX, 3)) for at in sorted(rng.integers(0, TICK_NS, 3))]
        looks = [(start_ns + round(part * TICK_NS), None) for part in parts]
        for at_ns, sender in sorted(sends + looks, key=lambda step: (step[0], step[1] is None)):
            if sender is None:
                within.append(medium.advance(at_ns)[0])
            else:
                medium.send_at(np.full(len(sender), at_ns), packets(sender, size=12))
    within.append(medium.advance(tick_start_ns(TICKS, RATE_HZ))[0])
    news.append(medium.step(tick_start_ns(TICKS, RATE_HZ), pose))
    last = medium.end()
    tallies = sum((step.tally for step in news[1:]), news[0].tally) + last
    assert tallies.fates.sum() == tallies.intended.sum()
    assert sum(map(len, within)) == sum(len(step.received) for step in news)  # each is handed over once
    return all_results(news), [int(count.sum()) for count in (tallies.sent, tallies.intended, tallies.in_range)]


@given(
    RADIOS | SIGNALS,
    st.lists(st.floats(0.0, 1.0), max_size=12).map(sorted),
    st.integers(0, 1000),
    st.none() | st.integers(0, SIX - 1),
)
def test_advance_in_any_parts_of_a_tick_changes_nothing(radio: Radio, parts: list[float], seed: int, out: int | None):
    assert played(make_medium(radio, SIX), parts, seed, out) == played(make_medium(radio, SIX), [], seed, out)


LATE = Delays("lognormal", 0.15, 0.2)
DISK = Radio(4.0, loss=0.1, jitter_s=0.1, delays=LATE)
LATE_RADIOS = (DISK, *(replace(with_access(method), delays=LATE) for method in ("none", "csma-802154")))
FIVE, ARENAS, LATE_TICKS = 5, 2, 6


def in_order(radio: Radio) -> Radio:
    """The radio, with the order kept."""
    assert radio.delays is not None
    return replace(radio, delays=replace(radio.delays, keep_order=True))


def received(radio: Radio, seed: int, between: Sequence[float] = ()) -> IntArray:
    """Receiver, sender, sequence and time of all that is received, as it is told, (k, 4).

    `between` are moments, as shares of a tick, at which the medium is asked, too.
    """
    rng, pose = np.random.default_rng(seed), scattered(ARENAS * FIVE, seed)
    result = Run(make_medium(radio, FIVE, range(ARENAS)))
    for tick in range(LATE_TICKS + 40):
        at_ns = tick_start_ns(tick, RATE_HZ)
        result.news.append(result.medium.step(at_ns, pose))
        if tick < LATE_TICKS:
            result.medium.send(at_ns, tick, random_traffic(rng, ARENAS, FIVE))
        for share in between:
            result.medium.advance(at_ns + int(share * TICK_NS))
    return np.array(result.rows("received", "receiver", "sender_index", "sequence", "received_at_ns"))


def sorted_rows(rows: IntArray) -> Any:
    return rows[np.lexsort(rows.T)].tolist()


def overtaken(rows: IntArray) -> int:
    """How many packets are received before one of their link with a smaller number."""
    count = 0
    for link in np.unique(rows[:, :2], axis=0):
        count += int(np.count_nonzero(np.diff(rows[(rows[:, :2] == link).all(axis=1), 2]) < 0))
    return count


@pytest.mark.parametrize("radio", LATE_RADIOS)
def test_packets_overtake_unless_order_is_kept(radio: Radio):
    free, ordered = received(radio, 3), received(in_order(radio), 3)
    assert overtaken(free) > 10
    assert overtaken(ordered) == 0
    # The same packets, each as late as the latest up to it on its link.
    expected = free[np.lexsort((free[:, 2], free[:, 1], free[:, 0]))]
    for i in range(1, len(expected)):
        if (expected[i, :2] == expected[i - 1, :2]).all():
            expected[i, 3] = max(expected[i, 3], expected[i - 1, 3])
    assert sorted_rows(ordered) == sorted_rows(expected)


@settings(max_examples=12)
@given(
    st.sampled_from(LATE_RADIOS),
    st.integers(0, 1000),
    st.lists(st.floats(0.0, 0.999), min_size=1, max_size=3).map(sorted),
)
def test_order_of_delayed_packets_is_independent_of_advance(radio: Radio, seed: int, between: list[float]):
    at_ticks, often = received(in_order(radio), seed), received(in_order(radio), seed, between)
    assert overtaken(often) == 0
    assert sorted_rows(at_ticks) == sorted_rows(often)


def test_reception_ended_by_a_disruption_delays_no_other():
    """The radio of robot 0 is off while first packets are on their way to it; second ones come in their own time."""
    radio = Radio(9.0, send_offset="tick", delays=Delays("uniform", 0.5, 0.28))
    sent, off = dict.fromkeys((0, 2), packets(range(1, 12))), Disruption.none(12)
    off.radio_on[0] = False
    times: list[dict[tuple[int, int], int]] = []
    for variant in (radio, in_order(radio)):
        now = {1: off, 2: Disruption.none(12)}
        result = run_disrupted(make_medium(variant, 12), scattered(12), sent, now, 14)
        rows = result.rows("received", "receiver", "sender_index", "sequence", "received_at_ns")
        times.append({(sender, sequence): at_ns for to, sender, sequence, at_ns in rows if to == 0})
    free, ordered = times
    ended = [sender for sender in range(1, 12) if (sender, 0) not in free]
    assert len(ended) > 5
    assert [ordered[sender, 1] for sender in ended] == [free[sender, 1] for sender in ended]
    assert ordered.keys() == free.keys()


MANY, FEW = 150, 8  # robots


def all_columns(medium: RadioMedium, poses: list[FloatArray]) -> list[AnyArray]:
    """All columns of what was received, every fate and every edge, tick by tick, while everybody sends."""
    columns: list[AnyArray] = []
    for tick, pose in enumerate(poses):
        news = medium.step(tick_start_ns(tick, RATE_HZ), pose)
        medium.send(tick_start_ns(tick, RATE_HZ), tick, everybody(len(pose))(tick))
        received, links = news.received, news.finished
        columns += [received.receiver, received.sender_index, received.sequence, received.received_at_ns]
        columns += [links.arena, links.receiver, links.sender, links.sequence, links.fate, links.final_at_ns]
        columns += [np.nan_to_num(links.rssi_dbm), news.edges, news.tally.fates, *received.measured.values()]
    return columns


def test_links_of_a_phy_are_equal_with_any_number_of_threads():
    """Of so many robots that their links are worth another thread."""
    rng = np.random.default_rng(3)
    poses = [scattered(MANY) + rng.normal(0.0, 0.1, (MANY, 3)) for _ in range(4)]
    assert MANY * (MANY - 1) // 2 > WORTH_ROWS
    radio = drawing("csma-802154")
    alone, threaded = (all_columns(make_medium(radio, MANY, threads=threads), poses) for threads in (1, 3))
    assert sum(map(len, alone)) > WORTH_ROWS
    assert all(map(np.array_equal, alone, threaded))


@pytest.mark.parametrize("method", METHODS)
def test_links_of_a_phy_kept_equal_links_computed_anew(method: str):
    """A robot out of everybody's reach moves, or does not, while all others stand."""
    poses = [scattered(FEW) for _ in range(8)]
    for pose in poses:
        pose[-1, :2] = 1e5
    stand = all_columns(make_medium(drawing(method), FEW), poses)
    for tick, pose in enumerate(poses):
        pose[-1, 0] += tick
    moved = all_columns(make_medium(drawing(method), FEW), poses)
    assert sum(map(len, stand)) > 0
    assert all(map(np.array_equal, stand, moved))
