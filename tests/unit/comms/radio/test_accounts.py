"""What radios count, and disrupted links."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.base.arrays import IntArray
from swarmwire.comms.base.sentinels import BROADCAST, NO_ROBOT, UNDER_WAY
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.counters import PacketCounters
from swarmwire.comms.radio.disruption import Disruption
from swarmwire.comms.radio.liveness import LivenessHistory
from swarmwire.comms.radio.medium import RadioMedium
from swarmwire.comms.radio.phy import model as phy_model
from swarmwire.comms.radio.phy.results import ResultBuffer, joined_rows
from swarmwire.comms.robot.packets import Fate, Payloads, SentPackets, TxResult
from tests.support.comms.radio import (
    OBSTACLES,
    RADIOS,
    TICK_NS,
    Run,
    at,
    check_fates,
    everybody,
    jammers,
    make_medium,
    packets,
    random_traffic,
    run,
    run_disrupted,
    scattered,
    signal_radios,
    with_access,
)
from tests.unit.world.scenario.test_bodies import radio_of

BOTH, FIRST = np.array([True, True]), np.array([True, False])
ROBOTS, ARENAS = 3, 2
POSE = np.tile(at((0, 0), (1, 0), (0, 1)), (2, 1))
PAYLOADS = [b"\x01\x02 of arena 0", b"\x03\x04 of arena 1, longer"]
KINDS = {"unit-disk": RADIOS, "signals": signal_radios()}
NEWS_RADIOS = {"unit-disk": Radio(9.0, send_offset="tick"), "signals": with_access("aloha")}
STATUS_IDS: IntArray = np.array([41, 42])
THREE = at((0, 0), (1, 0), (0, 1))
FAR = at((0, 0), (1, 0), (-2.9, 2.4))


def random_run(radio: Radio, arenas: int, robots: int, seed: int, quiet_ticks: int) -> Run:
    """Four ticks of random traffic among robots at random places; with a PHY some are far."""
    rng = np.random.default_rng(seed)
    medium = make_medium(radio, robots, range(arenas), [OBSTACLES] * arenas)
    pose = scattered(arenas * robots, seed)
    if radio.model != "unit-disk":
        pose = pose * [rng.choice([1.0, 30.0]), 20.0, 1.0]
    return run(medium, pose, lambda _: random_traffic(rng, arenas, robots), 4, quiet_ticks)


def check_departed(ended: Run) -> None:
    """Of packets that all have left: once each, intended and out of range as the tally has them."""
    packet = Counter(ended.rows("departed", "arena", "sender", "sequence"))
    assert set(packet.values()) <= {1}
    tally = ended.tally
    assert len(packet) == tally.sent.sum()
    assert ended.departed("intended").sum() == tally.intended.sum()
    assert ended.departed("out_of_range").sum() == tally.fates[:, Fate.OUT_OF_RANGE].sum()
    airtime_ns = ended.departed("off_air_at_ns") - ended.departed("on_air_at_ns")
    assert (airtime_ns >= 0).all()
    assert (airtime_ns == 0)[ended.departed("fate") != Fate.RECEIVED].all()


@pytest.mark.parametrize("radios", KINDS.values(), ids=KINDS)
@given(st.data(), st.integers(1, 3), st.integers(2, 12), st.integers(0, 1000), st.sampled_from([0, 2, 8]))
def test_fates_add_up_and_tally_agrees_with_listed_links(
    radios, data, arenas: int, robots: int, seed: int, quiet_ticks: int
):
    """Received packets, listed links and the tally tell the same story, in every tick; no receiver has two fates."""
    radio = data.draw(radios)
    if quiet_ticks == 8 and radio.frame == "plain":
        radio = replace(radio, bit_rate_bps=250_000)
    result = random_run(radio, arenas, robots, seed, quiet_ticks)
    check_fates(result)
    if quiet_ticks == 8:
        check_departed(result)
    for step in result.news:
        listed = np.zeros_like(step.tally.fates)
        np.add.at(listed, (step.finished.arena, step.finished.fate), step.finished.receivers)
        but_far = [fate for fate in Fate if fate != Fate.OUT_OF_RANGE]
        np.testing.assert_array_equal(listed[:, but_far], step.tally.fates[:, but_far])
        assert not listed[:, Fate.OUT_OF_RANGE].any()
        assert len(step.received) == listed[:, Fate.RECEIVED].sum()
        assert (step.tally.in_range >= listed[:, Fate.RECEIVED]).all()
        in_range = listed[:, Fate.RECEIVED] + listed[:, Fate.LOST]
        if radio.model == "unit-disk":
            assert (step.tally.in_range >= in_range).all()
            if not step.tally.fates[:, Fate.QUEUE_FULL].any():
                np.testing.assert_array_equal(step.tally.in_range, in_range)
    columns = np.column_stack([result.on_air(name) for name in ("arena", "sender", "sequence", "receiver")])
    assert len(np.unique(columns, axis=0)) == len(columns)


def test_sent_and_intended_count_when_the_radio_accepts_a_packet():
    """Even if it goes on air ticks later."""
    result = run(make_medium(Radio(2.0, send_offset=0.25), 4), at((0, 0), (1, 0), (2, 0), (5, 0)), everybody(4), 1, 4)
    assert [int(step.tally.intended[0]) for step in result.news] == [0, 12, 0, 0, 0, 0]
    assert [int(step.tally.sent[0]) for step in result.news] == [0, 4, 0, 0, 0, 0]
    assert [int(step.tally.fates.sum()) for step in result.news] == [0, 0, 0, 12, 0, 0]


def test_link_that_phy_forgets_fails_accounts(monkeypatch):
    def forgetful(parts: list[ResultBuffer]) -> ResultBuffer:
        rows = joined_rows(parts)
        rows.fate[: rows.count[0]][rows.receiver[: rows.count[0]] == 2] = UNDER_WAY
        return rows

    monkeypatch.setattr(phy_model, "joined_rows", forgetful)
    medium = make_medium(with_access("aloha"), 3)
    medium.step(0, THREE)
    medium.send(0, 0, packets([1]))
    with pytest.raises(AssertionError, match="a link has no fate"):
        medium.step(TICK_NS, THREE)


def test_counters_of_some_arenas_close_while_others_count_on():
    accounts = PacketCounters(arenas=3, robots=2)
    accounts.counts["sent"] += [1, 2, 3]
    accounts.counts["fates"][:, Fate.LOST] += [4, 5, 6]
    closed = accounts.close(np.array([True, False, True]))
    assert (closed.sent.tolist(), closed.fates[:, Fate.LOST].tolist()) == ([1, 0, 3], [4, 0, 6])
    accounts.counts["sent"] += [1, 0, 0]
    remaining = accounts.close()
    assert (remaining.sent.tolist(), remaining.fates[:, Fate.LOST].tolist()) == ([1, 2, 0], [0, 5, 0])
    assert accounts.close().sent.tolist() == [0, 0, 0]


def test_departure_has_receivers_and_airtime():
    radio = Radio(range_m=1.0, bit_rate_bps=8_000, send_offset="tick", queue_limit=0)
    sent = packets([0, 2, 2], [BROADCAST, 1, BROADCAST], 20)
    ended = run(make_medium(radio, 3), at((0, 0), (0.5, 0), (2, 0)), lambda _: sent, 1, 1)
    columns = ("sender", "to", "intended", "out_of_range", "fate", "on_air_at_ns", "off_air_at_ns")
    airtime_ns = 20_000_000
    assert sorted(ended.rows("departed", *columns)) == [
        (0, BROADCAST, 2, 1, Fate.RECEIVED, 0, airtime_ns),
        (2, BROADCAST, 2, 0, Fate.QUEUE_FULL, 0, 0),
        (2, 1, 1, 1, Fate.RECEIVED, 0, airtime_ns),
    ]


def test_dead_robots_are_intended_by_packets_sent_before_death_until_none_waits() -> None:
    lives = LivenessHistory(2)
    for alive, epoch in ((BOTH, 0), (FIRST, 1)):
        lives.record(alive)
        assert (lives.epoch, lives.any_dead) == (epoch, alive is FIRST)
    assert lives.intended(np.array([0, 0, 1, 1]), np.array([0, 1, 0, 1])).tolist() == [True, True, True, False]
    lives.record(BOTH)
    for queued, any_dead in (([1, 2], True), ([2], False), ([], False)):
        lives.drop_unused(queued=np.array(queued, np.int64))
        assert lives.any_dead == any_dead
    assert lives.intended(np.array([2, 2]), np.array([0, 1])).all()


def sent(radio: str) -> RadioMedium:
    """Robot 1 of arena 0 has sent to all, robot 2 of arena 1 to robot 0."""
    medium = make_medium(NEWS_RADIOS[radio], ROBOTS, [1, 2])
    medium.step(0, POSE)
    medium.send(0, 0, SentPackets(np.array([1, 5]), np.array([BROADCAST, 0]), Payloads.from_rows(PAYLOADS), STATUS_IDS))
    return medium


@pytest.mark.parametrize("radio", NEWS_RADIOS)
def test_finished_link_has_all_columns_of_its_packet(radio: str):
    finished = sent(radio).step(TICK_NS, POSE).finished
    columns = finished.arena, finished.sender, finished.receiver, finished.to, finished.sequence, finished.fate
    rows = [(0, 1, 0, -1, 0, 0), (0, 1, 2, -1, 0, 0), (1, 2, 0, 0, 0, 0)]
    assert sorted(zip(*(column.tolist() for column in columns), strict=True)) == rows
    assert finished.payload is not None
    assert finished.payloads is not None
    columns = finished.arena, finished.size_bytes, finished.tag, finished.payload
    for arena, size, tag, payload in zip(*(column.tolist() for column in columns), strict=True):
        assert finished.payloads.row(payload) == PAYLOADS[arena]
        assert (size, tag) == (len(PAYLOADS[arena]), int.from_bytes(PAYLOADS[arena][:2], "little"))
    assert (finished.rssi_dbm is None) == (radio == "unit-disk")


@pytest.mark.parametrize("over", [0, 1])
@pytest.mark.parametrize("radio", NEWS_RADIOS)
def test_arena_that_left_reports_nothing(radio: str, over: int):
    medium = sent(radio)
    assert medium.advance(TICK_NS // 2)[0].receiver.tolist() == [0, 2, 3]
    medium.leave(np.arange(2) == over)
    news, remaining = medium.step(TICK_NS, POSE), 1 - over
    assert news.received.receiver.tolist() == [[0, 2], [3]][remaining]
    assert {news.received.payloads.row(int(row)) for row in news.received.payload} == {PAYLOADS[remaining]}
    assert set(news.finished.arena.tolist()) == set(news.departed.arena.tolist()) == {remaining}


@pytest.mark.parametrize("over", [0, 1])
def test_arena_that_left_reports_no_tx_status(over: int):
    medium = make_medium(with_access("csma-802154"), ROBOTS, [1, 2])
    medium.step(0, POSE)
    medium.send(0, 0, SentPackets(np.array([1, 5]), np.array([0, 0]), Payloads.from_rows(PAYLOADS), STATUS_IDS))
    assert medium.advance(TICK_NS // 2)[1].row.tolist() == [1, 5]
    medium.leave(np.arange(2) == over)
    tx_status = medium.step(TICK_NS, POSE).tx_status
    assert (tx_status.row.tolist(), tx_status.id.tolist()) == ([[1, 5][1 - over]], [[41, 42][1 - over]])
    assert tx_status.result.tolist() == [int(TxResult.ACKNOWLEDGED)]


def disrupted(rows: int, dead: list[int] | None = None, off: list[int] | None = None, sides: list[int] | None = None):
    now = Disruption.none(rows)
    now.alive[dead or []] = False
    now.radio_on[off or []] = False
    if sides:
        now.sides = np.array([sides])
    return now


def slow(**changes: float) -> Radio:
    """Ten bytes take 80 ms."""
    return Radio(2.0, bit_rate_bps=1000, send_offset="tick", **changes)


def test_queue_ends_with_its_sender_and_is_empty_after_revival():
    """Four packets at 0, 80, 160 and 240 ms; dead from 100 to 300 ms; the next goes out at once."""
    sent = {0: packets([0] * 4), 3: packets([0])}
    result = run_disrupted(make_medium(slow(), 3), THREE, sent, {1: disrupted(3, dead=[0]), 3: disrupted(3)}, 6)
    assert result.fates() == {"RECEIVED": 6, "SENDER_DEAD": 4}
    assert sorted(set(result.on_air("on_air_at_ns").tolist())) == [0, 80_000_000, 300_000_000]
    assert result.news[1].tally.fates.sum() == 6, "the queue is settled when its sender dies"
    assert result.tally.in_range.tolist() == [10]


def test_packet_on_its_way_to_a_dying_robot_is_lost_even_after_revival():
    medium = make_medium(Radio(2.0, latency_s=0.25, send_offset="tick"), 3)
    result = run_disrupted(medium, THREE, {0: packets([0])}, {1: disrupted(3, dead=[1]), 2: disrupted(3)}, 5)
    assert result.fates() == {"RECEIVED": 1, "RECEIVER_DEAD": 1}
    assert result.received("receiver").tolist() == [2]


def test_broadcast_intends_robots_alive_when_it_was_sent():
    """At 200 ms robot 1 dies and 2 is revived: 1 was meant and is dead, 2 was not and does not hear.

    Packets end at 80, 160, 240 and 320 ms; the second reached robot 1, but was not yet handed over.
    """
    now = {0: disrupted(3, dead=[2]), 2: disrupted(3, dead=[1])}
    result = run_disrupted(make_medium(slow(), 3), THREE, {0: packets([0] * 4)}, now, 6)
    assert result.tally.intended.tolist() == [4]
    assert result.fates() == {"RECEIVED": 1, "RECEIVER_DEAD": 3}
    assert set(result.received("receiver").tolist()) == {1}


def test_packet_for_a_dead_robot_out_of_reach_is_out_of_range():
    now = {0: disrupted(3, dead=[1, 2])}
    result = run_disrupted(make_medium(slow(), 3), FAR, {0: packets([0, 0], [1, 2])}, now, 5)
    assert result.fates() == {"RECEIVER_DEAD": 1, "OUT_OF_RANGE": 1}
    assert result.tally.in_range.tolist() == [1]


def test_radio_off_neither_sends_nor_receives_and_drops_its_queue():
    """Off from 100 to 300 ms: packets at 0 and 80 ms go out, that of 80 ms still; 160 and 240 ms end; 320 ms goes."""
    now = {1: disrupted(3, off=[0]), 3: disrupted(3)}
    result = run_disrupted(make_medium(slow(), 3), THREE, {0: packets([0] * 5), 1: packets([1], 0)}, now, 7)
    assert result.fates() == {"RECEIVED": 6, "BLACKOUT": 5}
    assert sorted(set(result.on_air("on_air_at_ns").tolist())) == [0, 80_000_000, 100_000_000, 320_000_000]
    assert result.tally.in_range.tolist() == [11]


def test_reception_is_lost_if_the_radio_goes_off_before_its_end():
    """Received at 80 and 160 ms; off from 100 ms."""
    result = run_disrupted(make_medium(slow(), 2), THREE[:2], {0: packets([0, 0])}, {1: disrupted(2, off=[1])}, 4)
    assert result.fates() == {"RECEIVED": 1, "BLACKOUT": 1}


def test_partition_stops_only_packets_going_on_air_between_its_sets():
    sent = {0: packets([0, 1, 2])}
    before = run_disrupted(make_medium(slow(), 3), THREE, sent, {0: disrupted(3, sides=[1, 2, 0])}, 4)
    assert before.fates() == {"RECEIVED": 4, "PARTITIONED": 2}
    during = run_disrupted(make_medium(slow(latency_s=0.3), 3), THREE, sent, {1: disrupted(3, sides=[1, 2, 2])}, 8)
    assert during.fates() == {"RECEIVED": 6}


def random_disruption(rng: np.random.Generator, rows: int, most_jammers: int) -> Disruption:
    """Some are dead, some have their radio off, some are kept apart, some are jammed."""
    sides = rng.integers(0, 3, (int(rng.integers(0, 3)), rows))
    one_way = rng.integers(0, 3, (int(rng.integers(0, 2)), rows))
    gain_db, backlog = rng.normal(0.0, 3.0, (2, rows)), rng.integers(0, 3, rows)
    held = [
        {
            "carrier": rng.integers(NO_ROBOT, rows // ARENAS),
            "x_m": rng.normal(0.0, 20.0),
            "power_dbm": rng.uniform(-60.0, 20.0),
            "on_ns": rng.integers(1, 10**7),
            "period_ns": rng.integers(10**7, 10**8),
        }
        for _ in range(rng.integers(0, most_jammers + 1))
    ]
    alive, radio_on = rng.random(rows) < 0.7, rng.random(rows) < 0.8
    return Disruption(alive, radio_on, backlog, sides, one_way, *gain_db, jammers(*held))


@st.composite
def presets(draw: st.DrawFn) -> Radio:
    """Radios with an access of their own, whose packets last for long."""
    esb = {"preset": "crazyradio-250k", "access": {"safelink": draw(st.booleans())}}
    radio = draw(st.sampled_from([radio_of(esb), replace(radio_of({"preset": "ble-1M"}), bit_rate_bps=9_600)]))
    lifetime_s, loss = draw(st.sampled_from([None, 0.002])), draw(st.sampled_from([0.0, 0.3]))
    return replace(radio, loss=loss, queue_lifetime_s=lifetime_s, queue_limit=draw(st.integers(0, 4)))


@pytest.mark.parametrize(
    ("radios", "most_jammers"), [(RADIOS, 0), (signal_radios(), 3), (presets(), 3)], ids=[*KINDS, "presets"]
)
@given(st.data(), st.integers(2, 9), st.integers(0, 1000), st.sampled_from([0, 1, 8]))
def test_fates_add_up_under_any_disruption(radios, most_jammers: int, data, robots: int, seed: int, quiet_ticks: int):
    """Also while the radio's parameters change; and nobody dead, off or not meant hears anything."""
    radio, rng = data.draw(radios), np.random.default_rng(seed)
    rows, ticks, sent = ARENAS * robots, 6, dict[int, SentPackets]()
    now = {tick: random_disruption(rng, rows, most_jammers) for tick in range(ticks)}
    other = replace(radio, queue_limit=int(rng.integers(0, 4)), loss=0.2)
    for tick in range(ticks):
        drawn = random_traffic(rng, ARENAS, robots)
        sent[tick] = drawn.select(np.flatnonzero(now[tick].alive[drawn.sender]))
    medium = make_medium(radio, robots, range(ARENAS), [OBSTACLES] * ARENAS)
    radios_by_tick = {tick: other for tick in range(ticks) if rng.random() < 0.3}
    result = run(medium, scattered(rows, seed), sent.__getitem__, ticks, quiet_ticks, now, radios_by_tick)
    check_fates(result)
    for tick, step in enumerate(result.news[:ticks]):
        assert now[tick].alive[step.received.receiver].all()
